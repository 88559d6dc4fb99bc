"""Cores and memory are those of the control groups, of either version."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

import mpe_core.machine
from mpe_core.machine import available_cores, count_oom_kills, memory_left, memory_limit

CORES = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
GIB = 2**30
V2 = {"proc/self/cgroup": "0::/pod/job\n"}
V1 = {"proc/self/cgroup": "5:memory:/docker/ab\n4:cpu,cpuacct:/docker/ab\n3:cpuset:/docker/ab\n"}


def tree(root, files):
    """Folder with these files, as a machine's root."""
    for name, text in files.items():
        path = root / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    return root


def test_without_control_groups_it_is_the_machine(tmp_path):
    assert available_cores(tmp_path) == CORES
    assert memory_limit(tmp_path) == os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    assert memory_left(tmp_path) is None
    assert count_oom_kills(tmp_path) == 0


@pytest.mark.parametrize(
    ("quota", "cores"),
    [("100000 100000", 1), ("50000 100000", 1), ("190000 100000", 1), ("max 100000", CORES)],
)
def test_the_quota_of_version_2_bounds_the_cores(tmp_path, quota, cores):
    root = tree(tmp_path, V2 | {"sys/fs/cgroup/pod/job/cpu.max": quota})
    assert available_cores(root) == cores


@pytest.mark.parametrize(("quota", "cores"), [("100000", 1), ("-1", CORES)])
def test_the_quota_of_version_1_bounds_the_cores(tmp_path, quota, cores):
    # within a container the group is that at the top
    cpu = "sys/fs/cgroup/cpu,cpuacct/cpu.cfs_"
    root = tree(tmp_path, V1 | {cpu + "quota_us": quota, cpu + "period_us": "100000"})
    assert available_cores(root) == cores


@pytest.mark.parametrize(
    ("files", "name"),
    [
        (V2, "sys/fs/cgroup/pod/cpuset.cpus.effective"),
        (V1, "sys/fs/cgroup/cpuset/docker/ab/cpuset.effective_cpus"),
    ],
)
def test_the_set_of_cores_bounds_them(tmp_path, files, name):
    assert available_cores(tree(tmp_path, files | {name: "3\n"})) == 1
    assert available_cores(tree(tmp_path, files | {name: "0-63,80\n"})) == CORES


def test_the_smallest_limit_of_the_groups_above_holds(tmp_path):
    folder = "sys/fs/cgroup/pod"
    root = tree(
        tmp_path,
        V2
        | {
            f"{folder}/memory.max": f"{GIB}",
            f"{folder}/memory.current": f"{GIB * 3 // 4}",
            f"{folder}/memory.stat": f"anon 1\ninactive_file {GIB // 4}\n",
            f"{folder}/job/memory.max": "max",
            f"{folder}/job/memory.events": "low 0\noom 2\noom_kill 2\n",
        },
    )
    assert memory_limit(root) == GIB
    assert memory_left(root) == GIB // 2
    assert count_oom_kills(root) == 2


def test_version_1_writes_a_huge_number_for_no_limit(tmp_path):
    folder = "sys/fs/cgroup/memory/docker/ab"
    root = tree(
        tmp_path,
        V1
        | {
            f"{folder}/memory.limit_in_bytes": "9223372036854771712",
            "sys/fs/cgroup/memory/memory.limit_in_bytes": f"{GIB}",
            "sys/fs/cgroup/memory/memory.usage_in_bytes": f"{GIB // 4}",
            f"{folder}/memory.oom_control": "oom_kill_disable 0\nunder_oom 0\noom_kill 1\n",
        },
    )
    assert memory_limit(root) == GIB
    assert memory_left(root) == GIB * 3 // 4
    assert count_oom_kills(root) == 1


def test_without_groups_that_count_the_machine_does(tmp_path):
    root = tree(tmp_path, {"proc/vmstat": "nr_free_pages 5\noom_kill 7\n"})
    assert count_oom_kills(root) == 7


MOUNT = Path("/sys/fs/cgroup")
ONE_CORE, MEMORY = "100000", 256 << 20
LIMITS = (
    {"": {"cpu.max": f"{ONE_CORE} {ONE_CORE}", "memory.max": str(MEMORY)}}
    if (MOUNT / "cgroup.controllers").exists()
    else {
        "cpu": {"cpu.cfs_period_us": ONE_CORE, "cpu.cfs_quota_us": ONE_CORE},
        "memory": {"memory.limit_in_bytes": str(MEMORY)},
    }
)
LOOK = """
import importlib.util, sys
spec = importlib.util.spec_from_file_location("machine", sys.argv[1])
machine = sys.modules["machine"] = importlib.util.module_from_spec(spec)
spec.loader.exec_module(machine)
print(machine.available_cores(), machine.memory_limit(), machine.count_oom_kills(), flush=True)
b"1" * (int(sys.argv[2]) << 20)
"""


@pytest.fixture
def groups():
    """Real control groups of one core and 256 MiB; skipped loudly where none can be made."""
    folders = [MOUNT / controller / f"mpe-test-{os.getpid()}" for controller in LIMITS]
    try:
        for folder, files in zip(folders, LIMITS.values(), strict=True):
            folder.mkdir()
            for name, text in files.items():
                (folder / name).write_text(text)
        yield folders
    except OSError as error:
        pytest.skip(f"no control groups can be made here, so real ones are not tested: {error}")
    finally:
        for folder in folders:
            if folder.is_dir():
                folder.rmdir()


def test_the_limits_of_real_control_groups_hold(groups):
    enter = "".join(f"echo $$ > {folder}/cgroup.procs; " for folder in groups)
    look = f"'{sys.executable}' -c '{LOOK}' '{Path(mpe_core.machine.__file__)}'"
    script = f"{enter} {look} 0; {look} 600; {look} 0"
    done = subprocess.run(["sh", "-c", script], capture_output=True, text=True, check=False)
    lines = [list(map(int, line.split())) for line in done.stdout.splitlines()]
    assert lines[0] == [1, MEMORY, 0], done.stderr
    assert lines[2] == [1, MEMORY, 1], "the process that took too much was ended by the kernel"
