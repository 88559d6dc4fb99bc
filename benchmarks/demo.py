"""`make demo`: a running service registers two scans of a generated blade, or any two files."""

from __future__ import annotations

import argparse
import json
import os
import shlex
import shutil
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from pathlib import Path
from typing import Any

import httpx
import numpy as np
from numpy.typing import NDArray

from benchmarks.blade import scan
from mpe_core.geometry.rigid import apply, inverse, rotation_error
from service.formats import read_points, write_ply

Array = NDArray[np.float64]
FOLDER = Path("build") / "demo"
SOURCE_VIEW = np.radians((-60, 15, 170))  # azimuth, elevation, roll
TARGET_VIEW = np.radians((-110, 20, -30))
SHOWN_POINTS = 6_000
START_S = 600
"""Longest wait for the service: a first start compiles the kernels."""
END_S = 600
"""Longest wait for the end of the registration, on a busy machine."""


def main() -> int:
    """Run the demonstration; return the exit status."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--source", type=Path, help="the cloud that is moved")
    parser.add_argument("--target", type=Path, help="the cloud that stays")
    parser.add_argument("--url", help="of a service that runs; otherwise one is started")
    given = parser.parse_args()
    if (given.source is None) != (given.target is None):
        parser.error("give SOURCE and TARGET, or neither")
    FOLDER.mkdir(parents=True, exist_ok=True)
    if given.source:
        source, target, truth = given.source, given.target, None
    else:
        source, target, truth = scan_blade()
    with nullcontext(given.url) if given.url else _service() as url:
        job = _post(url, source, target)
    if job is None or job.get("result") is None:
        return 1
    T_target_source = np.array(job["result"]["transform"])
    clouds = [read_points(path).points.astype(float) for path in (source, target)]
    if truth is not None:
        _compare(T_target_source, truth, clouds[0])
    picture = FOLDER / "before-after.png"
    _draw(clouds[0], clouds[1], T_target_source, picture)
    print(f"\nThe picture is {picture}.")
    return 0


def scan_blade() -> tuple[Path, Path, Array]:
    """Write two scans, each in its scanner's frame; return both paths and T_target_source."""
    paths = FOLDER / "source.ply", FOLDER / "target.ply"
    poses = []
    for seed, (path, view) in enumerate(zip(paths, (SOURCE_VIEW, TARGET_VIEW), strict=True)):
        points, T_scanner_blade = scan(*view, seed=seed)
        write_ply(path, points.astype(np.float32))
        poses.append(T_scanner_blade)
        print(f"Scanned the blade: {path}, {len(points)} points, millimetres, in its own frame.")
    return *paths, poses[1] @ inverse(poses[0])


@contextmanager
def _service() -> Iterator[str]:
    """Run the service on a free port, yield its URL and stop it at the end."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    url = f"http://127.0.0.1:{port}"
    shutil.rmtree(FOLDER / "data", ignore_errors=True)
    environment = os.environ | {"MPE_DATA_DIR": str(FOLDER / "data")}
    command = [sys.executable, "-m", "service.cli", "serve", "--port", str(port)]
    with (FOLDER / "service.log").open("wb") as log:
        process = subprocess.Popen(command, env=environment, stdout=log, stderr=log)
    try:
        _await_ready(url, process)
        print(f"The service runs at {url}.")
        yield url
    finally:
        process.terminate()
        process.wait(timeout=30)


def _await_ready(url: str, process: subprocess.Popen[bytes]) -> None:
    deadline = time.monotonic() + START_S
    while time.monotonic() < deadline and process.poll() is None:
        try:
            if httpx.get(f"{url}/readyz", trust_env=False).status_code == 200:
                return
        except httpx.TransportError:
            pass
        time.sleep(0.1)
    raise SystemExit(f"The service did not start; its log is {FOLDER / 'service.log'}.")


def _post(url: str, source: Path, target: Path) -> dict[str, Any] | None:
    """Run curl as printed; returns the answer, or None after printing what went wrong."""
    files = ["-F", f"source=@{source}", "-F", f"target=@{target}"]
    command = ["curl", "-sS", "-H", "Prefer: wait=60", *files, f"{url}/v1/registrations"]
    print(f"\n$ {shlex.join(command)}")
    done = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=False)
    if done.returncode:
        return None
    job: dict[str, Any] = _await_end(url, json.loads(done.stdout))
    print(_shortened(job))
    return job


def _await_end(url: str, job: dict[str, Any]) -> dict[str, Any]:
    """Return the registration once it has ended; a problem document is returned as it is."""
    deadline = time.monotonic() + END_S
    while job["status"] in ("queued", "running") and time.monotonic() < deadline:
        print(f"It is {job['status']} still: {job['progress']['stage']}.")
        try:
            place, headers = f"{url}/v1/registrations/{job['id']}", {"Prefer": "wait=10"}
            job = httpx.get(place, headers=headers, timeout=60, trust_env=False).json()
        except httpx.TransportError:
            time.sleep(1)
    return job


def _shortened(job: dict[str, Any]) -> str:
    """Return the answer as indented JSON, short lists in one line, the list of pairs cut."""
    pairs = (job.get("result") or {}).get("inliers", {}).get("pairs")
    shown = json.loads(json.dumps(job))
    if pairs:
        shown["result"]["inliers"]["pairs"] = [*pairs[:2], f"... {len(pairs) - 2} more"]
    return "\n".join(_lines(shown, ""))


def _lines(value: Any, indent: str) -> Iterator[str]:
    """Yield JSON with one member a line, one row of a matrix a line, other lists in one line."""
    yield "{"
    for number, (key, member) in enumerate(value.items(), 1):
        comma = "," if number < len(value) else ""
        if isinstance(member, dict) and member:
            first, *rest = _lines(member, indent + "  ")
            yield f"{indent}  {json.dumps(key)}: {first}"
            yield from rest[:-1]
            yield rest[-1] + comma
        elif isinstance(member, list) and member and isinstance(member[0], list):
            rows = f",\n{indent}    ".join(json.dumps(row) for row in member)
            yield f"{indent}  {json.dumps(key)}: [\n{indent}    {rows}\n{indent}  ]{comma}"
        else:
            yield f"{indent}  {json.dumps(key)}: {json.dumps(member)}{comma}"
    yield indent + "}"


def _compare(found: Array, truth: Array, source: Array) -> None:
    centroid = source.mean(axis=0, keepdims=True)
    shift = np.linalg.norm(apply(found, centroid) - apply(truth, centroid))
    print(f"\nThe scanners' frames differ by {rotation_error(truth, np.eye(4)):.2f} degrees.")
    print(
        f"Error against the truth: {rotation_error(found, truth):.3f} degrees, "
        f"{shift:.3f} mm at the centroid."
    )


def _draw(source: Array, target: Array, T_target_source: Array, path: Path) -> None:
    """Draw both clouds before and after, along the target's principal axes."""
    import matplotlib as mpl

    mpl.use("Agg")
    import matplotlib.pyplot as plt

    source, target = (cloud[np.isfinite(cloud).all(axis=1)] for cloud in (source, target))
    moved = apply(T_target_source, source)
    _, _, axes = np.linalg.svd(target - target.mean(axis=0), full_matrices=False)
    figure, panels = plt.subplots(1, 2, figsize=(8, 4.5), layout="constrained")
    rng = np.random.default_rng(0)
    for panel, title, cloud in zip(panels, ("before", "after"), (source, moved), strict=True):
        for points, color in ((target, "#9aa5b1"), (cloud, "#d95f02")):
            some = points[rng.permutation(len(points))[:SHOWN_POINTS]]
            panel.plot(*(some @ axes[[1, 0]].T).T, ".", ms=1, color=color, rasterized=True)
        panel.set(title=title, aspect="equal", xticks=[], yticks=[])
    figure.savefig(path, dpi=90)
    plt.close(figure)


if __name__ == "__main__":
    sys.exit(main())
