"""Cores and memory of this process: those of the machine, or of its control groups where less.

A container is limited by control groups, of version 1 or 2. Nothing else of the package is
imported, so that the kernels can ask before they choose their threads.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

ROOT = Path("/")
"""Folder in which `proc` and `sys` lie; tests give another one."""

UNLIMITED_BYTES = 1 << 60
"""Limit from which on version 1 means that there is none."""


@dataclass(frozen=True, slots=True)
class _Names:
    """Controller and names of the files of one version."""

    cpu: str
    memory: str
    memory_limit: str
    memory_usage: str
    cpuset: str
    cpuset_cpus: str


_V1 = _Names(
    "cpu",
    "memory",
    "memory.limit_in_bytes",
    "memory.usage_in_bytes",
    "cpuset",
    "cpuset.effective_cpus",
)
_V2 = _Names("", "", "memory.max", "memory.current", "", "cpuset.cpus.effective")
_VERSIONS = (_V1, _V2)


def available_cores(root: Path = ROOT) -> int:
    """Count the cores that this process may use, at least 1.

    The smallest of its affinity, its set of cores and its share of processor time; a share of 2.5
    cores counts as 2, because a third thread would be stopped half of the time.
    """
    counts: list[float | None] = [_affinity()]
    for names in _VERSIONS:
        counts += [_count_cpus(text) for text in _texts(root, names.cpuset, names.cpuset_cpus)]
    counts += [_quota(*text.split()[:2]) for text in _texts(root, "", "cpu.max")]
    counts += [
        _quota(_text(folder / "cpu.cfs_quota_us"), _text(folder / "cpu.cfs_period_us"))
        for folder in _folders(root, "cpu")
    ]
    return max(1, int(min(count for count in counts if count is not None)))


def memory_limit(root: Path = ROOT) -> int:
    """Return the memory that this process may use, in bytes."""
    physical = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    limits = [limit for _, _, limit in _memory_limits(root)]
    return min([physical, *limits, *_address_space()])


def memory_left(root: Path = ROOT) -> int | None:
    """Return the bytes that the control groups still allow; None where they set no limit.

    Cached files count as free, because the kernel drops them first.
    """
    left = [
        limit - max(0, (_number(_text(folder / names.memory_usage)) or 0) - _cached(folder))
        for folder, names, limit in _memory_limits(root)
    ]
    return max(0, min(left)) if left else None


def count_oom_kills(root: Path = ROOT) -> int:
    """Count the processes that the kernel ended for want of memory.

    Those of the control groups of this process; where these do not count, of the machine.
    """
    for name, controller in (("memory.events", ""), ("memory.oom_control", "memory")):
        for folder in _folders(root, controller):
            count = _field(_text(folder / name), "oom_kill")
            if count is not None:
                return count
    return _field(_text(root / "proc" / "vmstat"), "oom_kill") or 0


def _affinity() -> int:
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def _address_space() -> list[int]:
    """Return the limit of the address space (ulimit -v), if there is one."""
    try:
        import resource  # Unix only
    except ImportError:
        return []
    limit = resource.getrlimit(resource.RLIMIT_AS)[0]
    return [] if limit == resource.RLIM_INFINITY else [limit]


def _memory_limits(root: Path) -> Iterator[tuple[Path, _Names, int]]:
    for names in _VERSIONS:
        for folder in _folders(root, names.memory):
            limit = _number(_text(folder / names.memory_limit))
            if limit is not None and 0 < limit < UNLIMITED_BYTES:
                yield folder, names, limit


def _texts(root: Path, controller: str, name: str) -> list[str]:
    texts = (_text(folder / name) for folder in _folders(root, controller))
    return [text for text in texts if text]


def _folders(root: Path, controller: str) -> Iterator[Path]:
    """Yield the folders of this process's group and of those above it, innermost first.

    Within a container the group may be named as outside of it: its folder is then missing, and
    that at the top is its own.

    Parameters
    ----------
    root
        Folder of `proc` and `sys`.
    controller
        Controller of version 1; empty for version 2.
    """
    for line in _text(root / "proc" / "self" / "cgroup").splitlines():
        _, _, rest = line.partition(":")
        controllers, _, path = rest.partition(":")
        if controller not in controllers.split(","):
            continue
        mount = root / "sys" / "fs" / "cgroup"
        tops = [mount / controllers, mount / controller, mount / "unified"]
        top = next((top for top in tops if controller and top.is_dir()), mount)
        group = top / path.lstrip("/")
        for folder in (group, *group.parents):
            if folder.is_dir():
                yield folder
            if folder == top:
                break


def _text(path: Path) -> str:
    try:
        return path.read_text()
    except (OSError, ValueError):
        return ""


def _number(text: str) -> int | None:
    return int(text) if text.strip().isdigit() else None


def _quota(quota: str, period: str = "100000") -> float | None:
    """Cores that a quota of a period allows; None for "max", -1 and a missing file."""
    share, length = _number(quota), _number(period)
    return share / length if share and length else None


def _count_cpus(text: str) -> int | None:
    """Count the cores of a list like 0-3,8; None if it is none."""
    count = 0
    for part in text.strip().split(","):
        first, _, last = part.partition("-")
        if not (first.isdigit() and (last or first).isdigit()):
            return None
        count += int(last or first) - int(first) + 1
    return count


def _field(text: str, name: str) -> int | None:
    """Value of the line "name value"."""
    for line in text.splitlines():
        words = line.split()
        if len(words) == 2 and words[0] == name:
            return _number(words[1])
    return None


def _cached(folder: Path) -> int:
    statistics = _text(folder / "memory.stat")
    total = _field(statistics, "total_inactive_file")
    return _field(statistics, "inactive_file") or 0 if total is None else total
