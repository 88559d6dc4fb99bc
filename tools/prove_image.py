"""Prove the image without a container engine: run the Dockerfile's own steps, then the service.

What it covers: every RUN, COPY, ARG, ENV, USER, WORKDIR, ENTRYPOINT, CMD and HEALTHCHECK of the
Dockerfile as it stands, in chroots made by debootstrap; the service started as the image's user,
with its init as process 1, without capabilities, on a read-only root with a tmpfs at /tmp and one
data directory, in a network of its own (loopback alone); the health check; a registration; what
was written where; the stop by SIGTERM.
What it does not cover: the base image itself (Debian's own Python 3.11 stands in for it), layers
and image size, the engine's seccomp profile, volumes and restart, compose.yaml.
"""

from __future__ import annotations

import json
import os
import re
import shlex
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from fnmatch import fnmatch
from pathlib import Path, PurePosixPath

from tools.chroots import PATH, bare_debian, in_chroot, require, run

PROJECT = Path(__file__).parent.parent
BASES = {"python:3.11-slim-bookworm": ["python3", "python3-venv", "ca-certificates"]}
READY_S = 60


@dataclass
class Stage:
    """A stage of the Dockerfile while its steps are run."""

    root: Path
    environment: dict[str, str] = field(default_factory=lambda: {"PATH": PATH})
    arguments: dict[str, str] = field(default_factory=dict)
    user: str = "0:0"
    folder: str = "/"
    entrypoint: list[str] = field(default_factory=list)
    command: list[str] = field(default_factory=list)
    health: list[str] = field(default_factory=list)


def main() -> int:
    """Build the image's tree, serve from it, and check what is promised."""
    require("debootstrap", "unshare", "nsenter", "ip", "curl", "setpriv")
    place = Path(sys.argv[1] if len(sys.argv) > 1 else PROJECT / "build" / "image").resolve()
    place.mkdir(parents=True, exist_ok=True)
    stage = _build(place)
    _say(f"built; {_size(stage.root)} MB beside {_size(place / 'bare')} MB of bare Debian")
    _serve_and_check(stage, place)
    return 0


def instructions(dockerfile: str) -> list[tuple[str, str]]:
    """Return keyword and rest of each instruction, lines joined, comments left out."""
    lines = [line for line in dockerfile.splitlines() if not line.lstrip().startswith("#")]
    joined = re.sub(r"\\\n", " ", "\n".join(lines))
    return [tuple(line.split(None, 1)) for line in joined.splitlines() if line.strip()]  # type: ignore[misc]


def _build(place: Path) -> Stage:
    stages: dict[str, Stage] = {}
    stage = Stage(place)
    for keyword, rest in instructions((PROJECT / "Dockerfile").read_text()):
        _say(f"{keyword} {rest}")
        if keyword == "FROM":
            base, _, name = rest.partition(" AS ")
            stage = Stage(place / f"stage-{len(stages)}")
            stages[name or "last"] = stage
            bare_debian(place / "bare", stage.root, BASES[base])
            (stage.root / "usr/local/bin/python").symlink_to("/usr/bin/python3")
        else:
            _step(stage, keyword, rest, stages)
    return stage


def _step(stage: Stage, keyword: str, rest: str, stages: dict[str, Stage]) -> None:
    match keyword:
        case "RUN":
            variables = stage.arguments | stage.environment
            command = ["sh", "-c", rest]
            in_chroot(
                stage.root, command, environment=variables, user=stage.user, folder=stage.folder
            )
        case "COPY":
            _copy(stage, shlex.split(rest), stages)
        case "ARG":
            name, _, value = rest.partition("=")
            stage.arguments[name] = value
        case "ENV":
            for pair in shlex.split(rest):
                name, _, value = pair.partition("=")
                stage.environment[name] = _expand(value, stage.arguments | stage.environment)
        case "USER":
            stage.user = rest
        case "WORKDIR":
            stage.folder = rest
        case "ENTRYPOINT":
            stage.entrypoint = json.loads(rest)
        case "CMD":
            stage.command = json.loads(rest)
        case "HEALTHCHECK":
            stage.health = json.loads(rest.partition(" CMD ")[2])
        case "VOLUME" | "EXPOSE":
            pass
        case _:
            sys.exit(f"The Dockerfile has an instruction that is not understood here: {keyword}")


def _expand(value: str, known: dict[str, str]) -> str:
    return re.sub(r"\$\{(\w+)\}", lambda found: known[found[1]], value)


def _copy(stage: Stage, words: list[str], stages: dict[str, Stage]) -> None:
    """COPY of files or folders, from the build context as .dockerignore leaves it or a stage."""
    origin = PROJECT
    if words[0].startswith("--from="):
        origin = stages[words.pop(0).removeprefix("--from=")].root
    *sources, target = words
    destination = stage.root / target.lstrip("/")
    for source in sources:
        path = origin / source.lstrip("/")
        if origin == PROJECT and not in_context(source):
            sys.exit(f".dockerignore leaves out {source}")
        goal = destination / path.name if target.endswith("/") else destination
        goal.parent.mkdir(parents=True, exist_ok=True)
        if path.is_dir():
            ignored = (
                shutil.ignore_patterns("__pycache__", "node_modules", "static")
                if origin == PROJECT
                else None
            )
            shutil.copytree(path, goal, symlinks=True, ignore=ignored, dirs_exist_ok=True)
        else:
            shutil.copy2(path, goal)


def in_context(source: str) -> bool:
    """Return whether .dockerignore lets the file into the build's context."""
    kept = True
    places = [source, *map(str, PurePosixPath(source).parents)]
    for line in (PROJECT / ".dockerignore").read_text().splitlines():
        rule = line.lstrip("!")
        if line and not line.startswith("#") and any(fnmatch(place, rule) for place in places):
            kept = line.startswith("!")
    return kept


def _serve_and_check(stage: Stage, place: Path) -> None:
    data = place / "data"
    shutil.rmtree(data, ignore_errors=True)
    data.mkdir()
    uid, gid = map(int, stage.user.split(":"))
    os.chown(data, uid, gid)
    log = place / "service.log"
    started = time.monotonic()
    with log.open("wb") as output:
        outer = subprocess.Popen(_container(stage, data), stdout=output, stderr=output)
    try:
        init = _init_of(outer)
        _wait_until_healthy(stage, init, log)
        _say(f"healthy {time.monotonic() - started:.1f} s after the start")
        _check_confinement(stage, init)
        _register(init, place)
        os.kill(init, signal.SIGTERM)
        outer.wait(timeout=30)
        _say(f"stopped by SIGTERM with exit code {outer.returncode}")
    finally:
        if outer.poll() is None:
            outer.kill()
    written = sorted(path.name for path in data.iterdir())
    _say(f"in the data volume: {', '.join(written)}")


def _container(stage: Stage, data: Path) -> list[str]:
    root, (uid, gid) = stage.root, stage.user.split(":")
    script = f"""
        ip link set lo up
        mount --bind {root} {root}
        mount --bind {data} {root}/data
        mount -t proc proc {root}/proc
        mount -t tmpfs -o nosuid,nodev,mode=1777 tmpfs {root}/tmp
        mount -t tmpfs -o nosuid,mode=755 tmpfs {root}/dev
        for device in null zero full random urandom; do
            touch {root}/dev/$device; mount --bind /dev/$device {root}/dev/$device
        done
        mkdir -m 1777 {root}/dev/shm; mount -t tmpfs tmpfs {root}/dev/shm
        mount -o remount,bind,ro {root}
        exec chroot {root} setpriv --no-new-privs --bounding-set=-all --inh-caps=-all \\
            --clear-groups --reuid={uid} --regid={gid} env -i -C {stage.folder} "$@"
    """
    # its network is its own loopback, as compose.yaml publishes it to the machine's own
    environment = stage.environment | {"MPE_ALLOW_ANONYMOUS_REMOTE": "true"}
    pairs = [f"{name}={value}" for name, value in environment.items()]
    command = [*stage.entrypoint, *stage.command]
    spaces = ["--mount", "--pid", "--net", "--ipc", "--uts", "--fork", "--kill-child"]
    return ["unshare", *spaces, "sh", "-ec", script, "sh", *pairs, *command]


def _init_of(outer: subprocess.Popen[bytes]) -> int:
    """Return the process that is number 1 inside: unshare's only child."""
    children = Path(f"/proc/{outer.pid}/task/{outer.pid}/children")
    for _ in range(100):
        if outer.poll() is not None:
            break
        if found := children.read_text().split():
            return int(found[0])
        time.sleep(0.05)
    sys.exit("The container did not start.")


def _inside(stage: Stage, init: int, command: Sequence[str]) -> subprocess.CompletedProcess[str]:
    """Run a command as the image's user in the running container, like docker exec."""
    pairs = [f"{name}={value}" for name, value in stage.environment.items()]
    uid, gid = stage.user.split(":")
    enter = ["nsenter", f"--target={init}", "--all", "--root", f"--setuid={uid}", f"--setgid={gid}"]
    return subprocess.run(
        [*enter, "env", "-i", *pairs, *command],
        capture_output=True,
        text=True,
        check=False,
        timeout=30,
    )


def _wait_until_healthy(stage: Stage, init: int, log: Path) -> None:
    deadline = time.monotonic() + READY_S
    while time.monotonic() < deadline:
        if _inside(stage, init, stage.health).returncode == 0:
            return
        time.sleep(0.2)
    sys.exit(f"The health check did not pass within {READY_S} s. The log:\n{log.read_text()}")


def _check_confinement(stage: Stage, init: int) -> None:
    process = Path(f"/proc/{init}")
    name = (process / "comm").read_text().strip()
    status = dict(re.findall(r"(\w+):\s+(\w+)", (process / "status").read_text()))
    assert status["Uid"] == stage.user.split(":")[0], "process 1 is not the image's user"
    assert int(status["CapBnd"], 16) == 0, "capabilities are left"
    mounts = [line.split() for line in (process / "mountinfo").read_text().splitlines()]
    writable = sorted(m[4] for m in mounts if m[5].split(",")[0] == "rw" and m[4][:5] != "/dev/")
    assert writable == ["/data", "/dev", "/proc", "/tmp"], f"mounted for writing: {writable}"
    for folder in ("/data", "/tmp"):
        done = _inside(stage, init, ["sh", "-ec", f"touch {folder}/probe; rm {folder}/probe"])
        assert done.returncode == 0, f"{folder} cannot be written: {done.stderr}"
    _say(f"process 1 is {name}, user {status['Uid']}, no capabilities; the root is read-only")


def _register(init: int, place: Path) -> None:
    """POST the demo's two scans from within the container's network."""
    scans = PROJECT / "build" / "demo"
    if not (scans / "source.ply").exists():
        run(["make", "-C", str(PROJECT), "demo"])
    files = ["-F", f"source=@{scans}/source.ply", "-F", f"target=@{scans}/target.ply"]
    url = "http://127.0.0.1:8000/v1/registrations"
    curl = ["curl", "-sS", "-H", "Prefer: wait=60", *files, url]
    done = subprocess.run(
        ["nsenter", f"--target={init}", "--net", *curl],
        check=True,
        stdout=subprocess.PIPE,
    )
    job = json.loads(done.stdout)
    assert job["status"] == "succeeded", json.dumps(job)[:2000]
    result, timing = job["result"], job["timing"]
    _say(
        f"registered: {result['rotation']['angle_deg']:.2f} degrees, overlap "
        f"{result['overlap']:.2f}, confidence {result['confidence']:.2f}, {timing['total_s']:.2f} s"
    )


def _size(root: Path) -> int:
    done = subprocess.run(["du", "-sm", str(root)], stdout=subprocess.PIPE, check=True)
    return int(done.stdout.split()[0])


def _say(text: str) -> None:
    print(f"== {text}", flush=True)


if __name__ == "__main__":
    sys.exit(main())
