"""Registration methods side by side, one a file, all called the same way."""

from __future__ import annotations

from benchmarks.methods.cpd import CPD
from benchmarks.methods.em_icp import EM_ICP
from benchmarks.methods.fgr import FGR, FGR_TUTORIAL
from benchmarks.methods.fpfh_ransac import FPFH_RANSAC, FPFH_RANSAC_TUTORIAL
from benchmarks.methods.gicp import GICP
from benchmarks.methods.icp import ICP
from benchmarks.methods.kiss import KISS, KISS_EXAMPLE
from benchmarks.methods.lm_icp import LM_ICP
from benchmarks.methods.method import Method
from benchmarks.methods.ours import MPE, MPL, MPL_PAPER
from benchmarks.methods.pcl import PCL_LM_ICP, PCL_TRIMMED_ICP, ROPS, ROPS_GICP, SAC_IA
from benchmarks.methods.probreg import FILTERREG, GMMREG
from benchmarks.methods.trimmed import TRIMMED_ICP

GLOBAL = [MPL, KISS, FPFH_RANSAC, FGR]
"""Methods that need no start, each followed by its own fine registration, at the best settings that
were found."""

AS_DOCUMENTED = [KISS_EXAMPLE, FPFH_RANSAC_TUTORIAL, FGR_TUTORIAL]
"""The same with the settings of their own documentation."""

LOCAL = [
    ICP,
    TRIMMED_ICP,
    GICP,
    LM_ICP,
    EM_ICP,
    PCL_LM_ICP,
    PCL_TRIMMED_ICP,
    FILTERREG,
    CPD,
    GMMREG,
]
"""Methods that start from where the clouds lie, here with their centroids laid on each other."""

__all__ = [
    "AS_DOCUMENTED",
    "CPD",
    "EM_ICP",
    "FGR",
    "FILTERREG",
    "FPFH_RANSAC",
    "GICP",
    "GLOBAL",
    "GMMREG",
    "ICP",
    "KISS",
    "LM_ICP",
    "LOCAL",
    "MPE",
    "MPL",
    "MPL_PAPER",
    "PCL_LM_ICP",
    "PCL_TRIMMED_ICP",
    "ROPS",
    "ROPS_GICP",
    "SAC_IA",
    "TRIMMED_ICP",
    "Method",
]
