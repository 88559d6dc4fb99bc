"""Bare Debian machines in a directory: debootstrap, and commands run in a chroot of it.

Needs root. The mirror is the one in this machine's apt sources; commands that install see this
machine's pip and npm configuration and certificates, which are mounted for them and stay out of the
tree.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

SUITE = "bookworm"
PATH = "/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin"
CERTIFICATES = Path("/etc/ssl/certs/ca-certificates.crt")
REGISTRY_FILES = {
    "etc/pip.conf": Path("/etc/pip.conf"),
    "root/.config/pip/pip.conf": Path.home() / ".config/pip/pip.conf",
    "root/.npmrc": Path.home() / ".npmrc",
}


def require(*commands: str) -> None:
    """Exit and say what is missing unless this is root and the commands exist."""
    missing = [command for command in commands if shutil.which(command) is None]
    if os.geteuid() != 0 or missing:
        sys.exit(f"Needs root and {', '.join(commands)}; missing: {', '.join(missing) or 'root'}.")


def bare_debian(cache: Path, root: Path, packages: Sequence[str]) -> None:
    """Make a fresh Debian with the packages at ``root``; its bare part is kept in ``cache``."""
    if not (cache / "etc/debian_version").exists():
        shutil.rmtree(cache, ignore_errors=True)
        run(["debootstrap", "--variant=minbase", SUITE, str(cache), _mirror()])
    shutil.rmtree(root, ignore_errors=True)
    run(["cp", "-a", "--reflink=auto", str(cache), str(root)])
    shutil.copy("/etc/resolv.conf", root / "etc/resolv.conf")
    install = f"apt-get install -qq -y --no-install-recommends {' '.join(packages)} >/dev/null"
    in_chroot(root, ["sh", "-ec", f"apt-get update -qq; {install}"])


def in_chroot(
    root: Path,
    command: Sequence[str],
    *,
    environment: Mapping[str, str] | None = None,
    user: str = "0:0",
    folder: str = "/",
    binds: Mapping[str, Path] | None = None,
) -> None:
    """Run a command that may install, with folders of this machine mounted read-only.

    Raises
    ------
    subprocess.CalledProcessError
        The command failed.
    """
    variables = {"PATH": PATH, "HOME": "/root", "DEBIAN_FRONTEND": "noninteractive"}
    variables |= {k: v for k, v in os.environ.items() if k in ("PIP_INDEX_URL", "PIP_TRUSTED_HOST")}
    certificates = f"/run/{CERTIFICATES.name}"
    variables |= {"PIP_CERT": certificates, "npm_config_cafile": certificates}
    variables |= dict(environment or {})
    mounts = [f"mount -t proc proc {root}/proc", f"mount --rbind /dev {root}/dev"]
    mounts += [f"mount -t tmpfs tmpfs {root}/tmp"]
    for inside, outside in (REGISTRY_FILES | {f"run/{CERTIFICATES.name}": CERTIFICATES}).items():
        if outside.exists():
            (root / inside).parent.mkdir(parents=True, exist_ok=True)
            (root / inside).touch()
            mounts.append(f"mount --bind {outside} {root}/{inside}")
    for inside, outside in (binds or {}).items():
        (root / inside).mkdir(parents=True, exist_ok=True)
        mounts += [f"mount --bind {outside} {root}/{inside}"]
        mounts += [f"mount -o remount,bind,ro {root}/{inside}"]
    script = "\n".join([*mounts, f'exec chroot --userspec={user} {root} env -i -C {folder} "$@"'])
    pairs = [f"{name}={value}" for name, value in variables.items()]
    run(["unshare", "--mount", "sh", "-ec", script, "sh", *pairs, *command])


def run(command: Sequence[str]) -> None:
    """Run a command.

    Raises
    ------
    subprocess.CalledProcessError
        The command failed.
    """
    subprocess.run(command, check=True)


def _mirror() -> str:
    """Return the first Debian mirror in this machine's apt sources."""
    sources = [*Path("/etc/apt").glob("sources.list.d/debian*"), Path("/etc/apt/sources.list")]
    for path in sources:
        text = path.read_text() if path.is_file() else ""
        found = re.search(r"^(?:URIs:|deb(?: \[.*?\])?)\s+(\S+/debian)/?\s", text, re.M)
        if found:
            return found[1]
    sys.exit("No Debian mirror in /etc/apt.")
