"""Families of worlds: each makes a scene and scans it from two places.

A family takes a generator of the scene and one of the scanners: pairs of the same scene have the
first in common, pairs of two scenes of one kind, which no pose registers, do not.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from benchmarks.worlds import indoors, objects, outdoors
from benchmarks.worlds.scanners import Scan
from benchmarks.worlds.scene import Scene

Family = Callable[[np.random.Generator, np.random.Generator], tuple[Scene, Callable[[int], Scan]]]

FAMILIES: dict[str, Family] = {
    "street_stations": outdoors.street_stations,
    "street_drive": outdoors.street_drive,
    "room_stations": indoors.room_stations,
    "room_frames": indoors.room_frames,
    "room_fragments": indoors.room_fragments,
    "bare_room": indoors.bare_room,
    "corridor": indoors.corridor,
    "stairwell": indoors.stairwell,
    "forest": outdoors.forest,
    "airborne_town": outdoors.airborne_town,
    "desk": objects.desk,
    "statue": objects.statue,
    "machine_part": objects.machine_part,
    "cartons": objects.cartons,
}
"""Families of worlds by name."""
