"""Coverage-guided fuzzing of one reader: python -m tests.fuzz.formats FORMAT SECONDS.

Whatever the bytes, a reader raises CloudFileError or gives an (N, 3) cloud no longer than the
bytes. An input that breaks this is written to build/fuzz/FORMAT/; put right, it belongs into
tests/unit/service/formats/findings/, where every test run reads it.
"""

from __future__ import annotations

import faulthandler
import multiprocessing
import sys
import tempfile
import time
import warnings
from pathlib import Path

import atheris

with atheris.instrument_imports(include=["service.formats", "laspy", "pye57", "trimesh"]):
    import laspy  # noqa: F401
    import pye57  # noqa: F401
    import trimesh  # noqa: F401

    from service.formats import FORMATS, CloudFileError, ReadLimits, read_points, sniff

from tests.factories.array_files import array_seeds
from tests.factories.cloud_files import seeds
from tests.factories.scanner_files import kitti, scanner_seeds, whole_e57
from tests.factories.vtk_files import solid_grid

LIMITS = ReadLimits(max_points=100_000)
MAX_BYTES = 20_000
WHOLE = {"e57": whole_e57}
"""What puts checksums right, without which no change gets far."""
MAX_RUNS = {"e57": 30_000}
"""libE57 keeps 62 KB for each file that it fails on: a new process takes over with the corpus."""
CHOSEN = {
    "scan": 0,
    "faces": True,
    "attributes": True,
    "weights": "intensity",
    "columns": 5,
    "array": "points",
}


def main() -> None:
    name, end = sys.argv[1], time.monotonic() + int(sys.argv[2])
    while (seconds := int(end - time.monotonic())) > 0:
        child = multiprocessing.get_context("fork").Process(target=fuzz, args=(name, seconds))
        child.start()
        child.join()
        if child.exitcode != 0:
            sys.exit(f"{name}: exit status {child.exitcode}")


def fuzz(name: str, seconds: int) -> None:
    """Fuzz for so long, or for the most runs; ends the process."""
    (format,) = (item for item in FORMATS if item.name == name)
    folder = Path("build/fuzz") / name
    folder.mkdir(parents=True, exist_ok=True)
    files = seeds() | scanner_seeds() | array_seeds() | {"kitti": kitti(), "vtk": solid_grid()}
    for kind, content in files.items():
        if kind == name or sniff(content[:4096]) == name:
            (folder / kind.replace(" ", "-")).write_bytes(content)
    options = [f"-max_total_time={seconds}", f"-max_len={MAX_BYTES}", "-timeout=20"]
    options += ["-rss_limit_mb=3000", "-print_final_stats=1", f"-artifact_prefix={folder}/"]
    options += [f"-runs={MAX_RUNS.get(name, -1)}"]
    with tempfile.TemporaryDirectory(dir="/dev/shm") as scratch:
        path = Path(scratch) / "cloud"

        def one_input(data: bytes) -> None:
            path.write_bytes(WHOLE.get(name, bytes)(data))
            for chosen in ({}, {name: CHOSEN[name] for name in format.choices}):
                try:
                    points = read_points(path, LIMITS, format=name, **chosen).points
                except CloudFileError:
                    continue
                assert points.ndim == 2
                assert points.shape[1] == 3
                is_compressed = format.read is None or name == "draco"
                assert is_compressed or len(points) <= max(len(data), 10)

        faulthandler.enable()
        warnings.simplefilter("ignore")
        atheris.Setup([sys.argv[0], *options, str(folder)], one_input)
        atheris.Fuzz()


if __name__ == "__main__":
    main()
