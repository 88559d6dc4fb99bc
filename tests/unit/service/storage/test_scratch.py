"""Scratch folders last as long as their owner, and are removed if he was killed."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from service.storage.scratch import discard_scratch, scratch_folder

PROJECT = Path(__file__).parents[4]
HOLDS_A_FOLDER = """
import sys
from pathlib import Path
from service.storage.scratch import scratch_folder

with scratch_folder(Path(sys.argv[1]), "held") as folder:
    print(folder, flush=True)
    sys.stdin.read()
"""

LOCKS_ITS_FOLDER = """
import ctypes, os, struct, sys
from pathlib import Path
from service.storage.scratch import count_bytes, scratch_folder

header, none = struct.pack("Ii", 0x20080522, 0), bytes(24)
assert ctypes.CDLL(None).capset(header, none) == 0  # root has no more rights than the owner
with scratch_folder(Path(sys.argv[1]), "job-1") as folder:
    (folder / "outer").mkdir(0o300)
    (folder / "outer" / "inner").mkdir(0)
    (folder / "outer" / "file").write_bytes(b"1234567")
    print(count_bytes(folder))
"""


def folders(data_dir: Path) -> list[str]:
    return sorted(path.name for path in (data_dir / "scratch").iterdir())


def test_a_folder_is_removed_with_its_content_when_the_work_ends(tmp_path: Path) -> None:
    with scratch_folder(tmp_path, "job-1") as folder:
        (folder / "half").write_bytes(b"half")
        assert folders(tmp_path) == ["job-1"]
    assert folders(tmp_path) == []


@pytest.mark.skipif(sys.platform != "linux", reason="rights of root are those of Linux")
def test_a_folder_is_removed_with_what_its_user_has_locked(tmp_path: Path) -> None:
    program = [sys.executable, "-c", LOCKS_ITS_FOLDER, str(tmp_path)]
    done = subprocess.run(program, cwd=PROJECT, check=True, capture_output=True, text=True)
    assert done.stdout == "7\n"
    assert folders(tmp_path) == []


def test_a_folder_is_removed_when_the_work_fails(tmp_path: Path) -> None:
    with pytest.raises(ZeroDivisionError), scratch_folder(tmp_path, "job-1"):
        raise ZeroDivisionError
    assert folders(tmp_path) == []


def test_a_name_in_use_is_refused(tmp_path: Path) -> None:
    with scratch_folder(tmp_path, "job-1") as folder:
        with pytest.raises(FileExistsError), scratch_folder(tmp_path, "job-1"):
            pass
        assert folder.exists()


def test_a_folder_in_use_is_kept(tmp_path: Path) -> None:
    with scratch_folder(tmp_path, "job-1"):
        discard_scratch(tmp_path)
        assert folders(tmp_path) == ["job-1"]


def test_a_folder_is_kept_while_its_process_lives_and_removed_after_a_kill(tmp_path: Path) -> None:
    program = [sys.executable, "-c", HOLDS_A_FOLDER, str(tmp_path)]
    with subprocess.Popen(
        program, cwd=PROJECT, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None
        assert process.stdout.readline()
        discard_scratch(tmp_path)
        assert folders(tmp_path) == ["held"]
        process.kill()
    discard_scratch(tmp_path)
    assert folders(tmp_path) == []


def test_a_folder_without_a_lock_belongs_to_nobody(tmp_path: Path) -> None:
    discard_scratch(tmp_path)
    (tmp_path / "scratch" / "left" / "below").mkdir(parents=True)
    discard_scratch(tmp_path)
    assert folders(tmp_path) == []
