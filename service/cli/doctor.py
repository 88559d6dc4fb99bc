"""`mpe doctor`: what the machine gives, what the service would refuse, and how to mend it."""

from __future__ import annotations

import argparse
import ctypes
import json
import os
import shutil
import sys
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from service.cli.exit_codes import EXIT_ERROR, EXIT_OK
from service.settings import InvalidSettingsError, Settings, load_settings

_GIBIBYTE = 2**30
_CLOCK_UNSYNCHRONISED = 5
"""What adjtimex returns while nothing sets the clock (TIME_ERROR)."""
_TIMEX_BYTES = 512
"""Room for the kernel's struct timex, in bytes: more than it has on any system."""
_LIBRARIES = ("mpe", "numpy", "scipy", "numba", "fastapi", "httpx", "psycopg", "obstore")


@dataclass(frozen=True, slots=True)
class Finding:
    """One thing that was looked at."""

    name: str
    state: str
    fault: str | None = None
    """What is wrong and how to mend it; None: nothing."""


def add_doctor(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the command."""
    doctor = commands.add_parser(
        "doctor", help="print what the machine gives, what the service would refuse, and the remedy"
    )
    doctor.add_argument("--json", action="store_true", help="print JSON")


def run_doctor(arguments: argparse.Namespace) -> int:
    """Carry out `mpe doctor`; 1 if something has to be mended."""
    findings = list(examine())
    if arguments.json:
        print(json.dumps([asdict(each) for each in findings]))
    else:
        for each in findings:
            print(f"{each.name:<12}{each.state}")
    faults = dict.fromkeys(each.fault for each in findings if each.fault is not None)
    for fault in faults:
        print(f"mpe: {fault}", file=sys.stderr)
    return EXIT_ERROR if faults else EXIT_OK


def examine() -> Iterator[Finding]:
    """Look at everything, cheap things first."""
    yield Finding("libraries", ", ".join(_list_versions()))
    yield _look_at_cores()
    try:
        settings = load_settings()
    except InvalidSettingsError as error:
        yield Finding("settings", "not valid", f"`mpe serve` refuses its settings: {error}")
    else:
        yield Finding("settings", f"valid; {settings.workers} workers")
        yield look_at_memory(settings)
        yield look_at_disk(settings)
    yield _look_at_clock()
    yield look_at_kernels(_kernel_folder())
    yield from _look_at_sandbox()
    yield _look_at_workers()


def _list_versions() -> Iterator[str]:
    for name in _LIBRARIES:
        try:
            yield f"{name} {version(name)}"
        except PackageNotFoundError:
            yield f"{name} missing"


def _look_at_cores() -> Finding:
    from mpe_core.machine import available_cores

    cores, all_cores = available_cores(), os.cpu_count() or 1
    kept = "" if cores >= all_cores else f" of {all_cores}: a quota or an affinity keeps the others"
    return Finding("cores", f"{cores}{kept}")


def look_at_memory(settings: Settings) -> Finding:
    """Compare what is left of the memory with the floor of the service."""
    from mpe_core.machine import memory_left, memory_limit

    state, left = f"{memory_limit() / _GIBIBYTE:.1f} GiB", memory_left()
    if left is None:
        return Finding("memory", state)
    fault = None
    if left < settings.min_free_memory_bytes:
        fault = (
            f"submissions are refused (503): {left} bytes of memory are left, less than "
            f"MPE_MIN_FREE_MEMORY_BYTES={settings.min_free_memory_bytes}; end other programs, or "
            "lower MPE_WORKERS"
        )
    return Finding("memory", f"{state}, of which {left / _GIBIBYTE:.1f} GiB are left", fault)


def look_at_disk(settings: Settings) -> Finding:
    """Compare what is free in the data directory with the floor of the service."""
    folder = settings.data_dir
    there = next(path for path in (folder, *folder.parents) if path.exists())
    free, fault = shutil.disk_usage(there).free, None
    if not os.access(there, os.W_OK):
        fault = f"{there} cannot be written: set MPE_DATA_DIR to a directory that can"
    elif free < settings.min_free_disk_bytes:
        fault = (
            f"submissions are refused (503): {free} bytes are free for {folder}, less than "
            f"MPE_MIN_FREE_DISK_BYTES={settings.min_free_disk_bytes}; make room, or set "
            "MPE_DATA_DIR to a larger disk"
        )
    return Finding("disk", f"{free / _GIBIBYTE:.1f} GiB are free for {folder}", fault)


def _look_at_clock() -> Finding:
    """Ask the kernel whether something keeps its clock right; only several services need that."""
    try:
        answer = ctypes.CDLL(None).adjtimex(ctypes.create_string_buffer(_TIMEX_BYTES))
    except AttributeError:  # no Linux
        return Finding("clock", "not known")
    if answer == _CLOCK_UNSYNCHRONISED:
        return Finding("clock", "not synchronised: services that share a database need that")
    return Finding("clock", "synchronised" if answer >= 0 else "not known")


def look_at_kernels(folder: Path) -> Finding:
    """Say whether the compiled kernels are kept in the folder, so that a start is quick."""
    kept = len(list(folder.rglob("*.nbc")))
    there = next(path for path in (folder, *folder.parents) if path.exists())
    if kept:
        return Finding("kernels", f"{kept} compiled, in {folder}")
    if os.access(there, os.W_OK):
        return Finding("kernels", f"none compiled; the first start compiles them into {folder}")
    fault = (
        f"each start compiles the kernels (a minute): {folder} cannot be written; set "
        "NUMBA_CACHE_DIR to a directory that can"
    )
    return Finding("kernels", "cannot be kept", fault)


def _kernel_folder() -> Path:
    import mpe_core

    given = os.environ.get("NUMBA_CACHE_DIR")
    return Path(given) if given else Path(mpe_core.__file__).parent / "kernels" / "__pycache__"


def _look_at_sandbox() -> Iterator[Finding]:
    from service.workers.sandbox.confinement import describe_sandbox, missing_parts

    faults = "; ".join(f"this system lacks {part}" for part in missing_parts())
    for line in describe_sandbox().splitlines():
        name, _, state = line.partition(" ")
        state = state.strip()
        yield Finding(name, state, faults if "missing" in state else None)


def _look_at_workers() -> Finding:
    from service.workers.start_check import find_start_failure

    failure = find_start_failure()
    if failure is None:
        return Finding("workers", "start")
    return Finding("workers", "do not start", f"a worker does not start: {failure}")
