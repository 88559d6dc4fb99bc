"""The methods of this project."""

from __future__ import annotations

from benchmarks.methods.method import Array, Method, version_of
from mpe_core import RegistrationOptions, register


def _method(name: str, settings: str, options: RegistrationOptions) -> Method:
    def run(source: Array, target: Array) -> Array:
        return register(source, target, options).T_target_source

    return Method(name, version_of("mpe"), run, settings)


MPL = _method("MPL", "defaults: global search", RegistrationOptions())
MPL_PAPER = _method(
    "MPL as printed",
    "Algorithm 1 on 1,600 points, then trimmed ICP",
    RegistrationOptions(search="sparse"),
)
MPE = _method(
    "MPE",
    "Algorithm 1 on all points, distant ones summed by a tree",
    RegistrationOptions(method="mpe"),
)
