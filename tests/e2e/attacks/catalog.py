"""All attacks by name; each is one round of one attacker."""

from __future__ import annotations

import random
from collections.abc import Callable

from tests.e2e.attacks import bodies, connections, floods
from tests.e2e.attacks.target import Target

Attack = Callable[[Target, random.Random], None]

ATTACKS: dict[str, Attack] = {
    attack.__name__: attack
    for attack in (
        connections.stay_silent,
        connections.confuse_parsers,
        connections.invent_methods,
        connections.read_slowly,
        connections.abandon_uploads,
        bodies.confuse_sniffers,
        bodies.repeat_near_boundaries,
        bodies.nest_json,
        bodies.keep_long_labels,
        bodies.lie_in_files,
        bodies.expand_archives,
        floods.flood_exports,
        floods.flood_inliers,
        floods.flood_reads,
        floods.hold_waits,
        floods.fill_queue,
        floods.name_slow_urls,
        floods.replay_callbacks,
    )
}
