"""A restricted process reads its inputs, writes its scratch folder, and reaches no other file."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from service.workers.sandbox.landlock import SCOPED_SIGNALS_ABI, landlock_abi

PROJECT = Path(__file__).parents[5]

RESTRICTED = """
import errno, os, sys
from pathlib import Path
from service.workers.sandbox.landlock import restrict_files

root = Path(sys.argv[1])
scratch = root / "scratch"

def denied(call, *arguments):
    try:
        call(*arguments)
    except OSError as error:
        return error.errno in (errno.EACCES, errno.EPERM, errno.EXDEV)
    return False

assert restrict_files([root / "input", root / "folder", root / "missing"], [scratch])
assert (root / "input").read_text() == "input"
assert (root / "folder" / "inner").read_text() == "inner"
assert denied((root / "input").write_text, "changed")
assert denied((root / "secret").read_text)
assert denied((root / "new").write_text, "x")
assert denied(os.listdir, root)
assert denied((root / "secret").unlink)
assert denied(os.truncate, root / "secret", 0)
assert denied(Path("/proc/self/environ").read_bytes)
assert denied(Path(f"/proc/{os.getppid()}/mem").open, "rb")
(scratch / "part").write_text("result")
(scratch / "part").replace(scratch / "result")
assert os.listdir(scratch) == ["result"]
assert denied(os.symlink, root / "secret", scratch / "link")
assert denied(os.link, root / "input", scratch / "link")
assert denied(os.mkfifo, scratch / "pipe")
assert denied(os.rename, scratch / "result", root / "folder" / "result")
print("signals" if denied(os.kill, os.getppid(), 0) else "no signals")
"""


@pytest.mark.skipif(landlock_abi() < 3, reason="the kernel has no Landlock of version 3")
def test_a_restricted_process_reaches_its_files_alone(tmp_path: Path) -> None:
    for folder in ("folder", "scratch"):
        (tmp_path / folder).mkdir()
    for name in ("input", "secret", "folder/inner"):
        (tmp_path / name).write_text(Path(name).name)
    done = subprocess.run(
        [sys.executable, "-c", RESTRICTED, str(tmp_path)],
        cwd=PROJECT,
        capture_output=True,
        text=True,
    )
    confined = landlock_abi() >= SCOPED_SIGNALS_ABI
    assert done.stdout == ("signals\n" if confined else "no signals\n"), done.stderr
    assert (tmp_path / "secret").read_text() == "secret"
