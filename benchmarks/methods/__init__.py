"""Registration methods side by side, one a file, all called the same way."""

from __future__ import annotations

from benchmarks.methods.cpd import CPD
from benchmarks.methods.em_icp import EM_ICP
from benchmarks.methods.fgr import FGR
from benchmarks.methods.fpfh_ransac import FPFH_RANSAC
from benchmarks.methods.gicp import GICP
from benchmarks.methods.icp import ICP
from benchmarks.methods.kiss import KISS
from benchmarks.methods.lm_icp import LM_ICP
from benchmarks.methods.method import Method
from benchmarks.methods.ours import MPE, MPL, MPL_PAPER
from benchmarks.methods.trimmed import TRIMMED_ICP

GLOBAL = [MPL, KISS, FPFH_RANSAC, FGR]
"""Methods that need no start, each followed by its own fine registration."""

LOCAL = [ICP, TRIMMED_ICP, GICP, LM_ICP, EM_ICP, CPD]
"""Methods that start from where the clouds lie, here with their centroids laid on each other."""

__all__ = [
    "CPD",
    "EM_ICP",
    "FGR",
    "FPFH_RANSAC",
    "GICP",
    "GLOBAL",
    "ICP",
    "KISS",
    "LM_ICP",
    "LOCAL",
    "MPE",
    "MPL",
    "MPL_PAPER",
    "TRIMMED_ICP",
    "Method",
]
