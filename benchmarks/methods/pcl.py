"""PCL's methods, through the driver in benchmarks/pcl."""

from __future__ import annotations

import subprocess
import sys
from functools import partial

import numpy as np

from benchmarks.methods.method import BUILT, Array, Method, diagonal, rigid
from benchmarks.methods.open3d_clouds import polish

DRIVER = BUILT / "pcl" / "pcl_driver"
VERSION = "PCL 1.13" if DRIVER.is_file() else None
TIMEOUT_S = 300


def run(method: str, source: Array, target: Array) -> Array:
    """Return the driver's (4, 4) pose, or one that matches the centroids where it fails."""
    unit = diagonal(target)
    message = np.array([len(source), len(target)], np.int32).tobytes()
    for cloud in (source, target):
        message += ((cloud - cloud.mean(axis=0)) / unit).astype(np.float32).tobytes()
    T = np.eye(4)
    try:
        answer = subprocess.run(
            [str(DRIVER), method], input=message, capture_output=True, check=True, timeout=TIMEOUT_S
        )
        T = np.array(answer.stdout.split()[-16:], float).reshape(4, 4)
    except subprocess.SubprocessError as error:
        print(f"PCL, {method}: {error}", file=sys.stderr)
    return rigid(T[:3, :3], T[:3, 3], source, target, unit)


def _then_icp(method: str, source: Array, target: Array) -> Array:
    return polish(source, target, run(method, source, target))


PCL_LM_ICP = Method(
    "LM-ICP (PCL)", VERSION, partial(run, "lm_icp"), "every pair counts, 100 iterations"
)
PCL_TRIMMED_ICP = Method(
    "trimmed ICP (PCL)",
    VERSION,
    partial(run, "trimmed_icp"),
    "overlap of 0.4 to 0.99 with the least error / overlap^3, up to 2,000 source points",
)
SAC_IA = Method(
    "SAC-IA+ICP",
    VERSION,
    partial(_then_icp, "sac_ia"),
    "FPFH, voxel = diagonal / 50, 1,000 iterations",
)
ROPS = Method(
    "RoPS",
    VERSION,
    partial(run, "rops"),
    "mesh spacing = diagonal / 100, support 15 of it, key points at diagonal / 25, RANSAC",
)
ROPS_GICP = Method("RoPS+GICP", VERSION, partial(run, "rops_gicp"), "as RoPS, then PCL's GICP")
