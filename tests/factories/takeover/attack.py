"""What code does that runs in a decoder: it tries to reach all that is not its own.

Executed in the child by `sitecustomize`; DATA_DIR is put before it. Each attempt leaves None where
it was denied, and else what it reached.
"""

# mypy: ignore-errors
# ruff: noqa
import ctypes
import errno
import fcntl
import glob
import os
import re
import signal
import socket
import subprocess
import sqlite3
import stat
import tempfile
from pathlib import Path

libc = ctypes.CDLL(None, use_errno=True)
forkserver = os.getppid()


def attempt(name):
    def run(call):
        try:
            found[name] = str(call())[:100]
        except BaseException:
            found[name] = None

    return run


def must(result):
    """The result of a C function; an error where the system denies it."""
    if result == -1 and ctypes.get_errno() in (0, errno.EPERM, errno.EACCES, errno.ENOSYS):
        raise OSError(ctypes.get_errno())
    return result, ctypes.get_errno()


def parent_of(pid):
    return int(Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[1])


def secrets():
    return [k for k in os.environ if re.search("SECRET|PASSWORD|DATABASE_URL|AWS_", k)] or must(-1)


def inherited():
    """Descriptors beside the pipe, the log and what this code has opened."""
    reached = []
    for number in range(3, 256):
        try:
            status = os.fstat(number)
        except OSError:
            continue
        if stat.S_ISREG(status.st_mode) or stat.S_ISDIR(status.st_mode):
            reached.append(number)
    return reached or must(-1)


def store_written():
    with sqlite3.connect(f"{DATA_DIR}/jobs.sqlite3") as store:
        store.execute("DELETE FROM jobs")


def fork():
    if pid := os.fork():
        return pid
    os._exit(0)


def link_out():
    os.symlink("/etc/passwd", Path(tempfile.gettempdir()) / "link")


attempt("files of other tenants")(
    lambda: [len(Path(p).read_bytes()) for p in glob.glob(f"{DATA_DIR}/blobs/*/*")][1]
)
attempt("list of the data directory")(lambda: os.listdir(DATA_DIR))
attempt("store, read")(lambda: Path(f"{DATA_DIR}/jobs.sqlite3").read_bytes()[:16])
attempt("store, written")(store_written)
attempt("file beside the store")(lambda: Path(f"{DATA_DIR}/new").write_text("x"))
attempt("file in the common temporary folder")(lambda: Path("/tmp/escaped").write_text("x"))
attempt("users of the machine")(lambda: Path("/etc/passwd").read_text())
attempt("secrets in the environment")(secrets)
attempt("environment of the forkserver")(lambda: Path(f"/proc/{forkserver}/environ").read_bytes())
attempt("the service by /proc")(lambda: parent_of(forkserver))
attempt("memory of the forkserver")(lambda: open(f"/proc/{forkserver}/mem", "rb"))
attempt("inherited files")(inherited)
attempt("signal to the forkserver")(lambda: os.kill(forkserver, 0))
attempt("signal to all")(lambda: os.kill(-1, 0))
attempt("tracing")(lambda: must(libc.ptrace(16, forkserver, 0, 0)))
attempt("network")(lambda: socket.socket())
attempt("local socket")(lambda: socket.socket(socket.AF_UNIX))
attempt("fork")(fork)
attempt("program")(lambda: subprocess.run(["/bin/true"], check=True))
attempt("exec")(lambda: os.execv("/bin/true", ["true"]))
attempt("namespace")(lambda: must(libc.unshare(0x10000000)))
attempt("mount")(lambda: must(libc.mount(b"none", b"/mnt", b"tmpfs", 0, None)))
attempt("symbolic link")(link_out)
attempt("mode of the store")(lambda: os.chmod(f"{DATA_DIR}/jobs.sqlite3", 0o600))
attempt("mode of the data directory")(lambda: os.chmod(DATA_DIR, 0o700))
attempt("owner of the store")(lambda: os.chown(f"{DATA_DIR}/jobs.sqlite3", -1, -1))
attempt("age of a file")(lambda: os.utime(f"{DATA_DIR}/store.mark"))
attempt("length of the store")(lambda: os.truncate(f"{DATA_DIR}/jobs.sqlite3", 0))
attempt("signal of a descriptor to the forkserver")(lambda: fcntl.fcntl(0, 8, forkserver))
attempt("bpf")(lambda: must(libc.syscall(321, 0, 0, 0)))
attempt("io_uring")(lambda: must(libc.syscall(425, 1, 0)))
attempt("keys of the kernel")(lambda: must(libc.syscall(250, 0, -3, 0)))
attempt("pidfd")(lambda: must(libc.syscall(434, forkserver, 0)))
attempt("its own scratch folder")(lambda: Path(tempfile.gettempdir(), "x").write_text("x"))
