"""Preload module of the forkserver: what every child needs, loaded once before the first fork."""

from __future__ import annotations

import gc
import os
from importlib import import_module
from pkgutil import iter_modules, walk_packages
from types import ModuleType

import mpe_core
from service import formats, report, schemas, workers
from service.formats.libraries import LIBRARIES, import_library
from service.telemetry.json_logs import configure_logs
from service.workers import child_main  # noqa: F401
from service.workers.sandbox.confinement import library_paths
from service.workers.sandbox.limits import (
    die_with_parent,
    forbid_inspection,
    remember_forkserver,
)

TASKS = ("export_", "fetch_", "register_")
"""Beginnings of the names of the modules of `service.workers` that define tasks."""


def import_package(package: ModuleType) -> None:
    """Import all modules of a package, those of its kernels included."""
    for module in walk_packages(package.__path__, f"{package.__name__}."):
        import_module(module.name)


for each in (mpe_core, formats, report, schemas):
    import_package(each)
for task in iter_modules(workers.__path__, f"{workers.__name__}."):
    if task.name.rpartition(".")[2].startswith(TASKS):
        import_module(task.name)
for library in LIBRARIES:
    import_library(library)

forbid_inspection()
remember_forkserver()
die_with_parent(os.getppid())
library_paths()  # cached here for all children
configure_logs(os.environ.get("MPE_LOG_LEVEL", "INFO"))
# without the freeze a child's garbage collector touches, and so copies, every page that it shares
# with this process (docs/tuning.md, service.workers)
gc.collect()
gc.freeze()
