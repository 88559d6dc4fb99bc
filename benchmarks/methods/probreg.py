"""probreg: FilterReg (Gao and Tedrake 2019) and GMMReg (Jian and Vemuri 2011)."""

from __future__ import annotations

import numpy as np

from benchmarks.methods.method import Array, Method, rigid, version_of

OUTLIERS = 0.1  # weight of the uniform part, as for CPD
# GMMReg on the bunny from up to 60 degrees: one step, its default, ends 15 to 44 degrees off, these
# ten 0.7 to 1.5, twenty with 150 components 0.2 to 1.2 in three times the time
COMPONENTS, ANNEALINGS, SHRINK = 80, 10, 0.8


def _filterreg(source: Array, target: Array) -> Array:
    from probreg import filterreg

    unit = float(target.std())
    found, _, _ = filterreg.registration_filterreg(
        (source - source.mean(axis=0)) / unit,
        (target - target.mean(axis=0)) / unit,
        update_sigma2=True,
        w=OUTLIERS,
        maxiter=100,
        tol=1e-6,
    )
    return rigid(found.rot, found.t, source, target, unit)


def _gmmreg(source: Array, target: Array) -> Array:
    from probreg import l2dist_regs
    from threadpoolctl import threadpool_limits

    unit = float(target.std())
    np.random.seed(0)  # noqa: NPY002  its mixtures begin with numpy's global generator
    registration = l2dist_regs.RigidGMMReg(
        (source - source.mean(axis=0)) / unit, n_gmm_components=COMPONENTS, delta=SHRINK
    )
    # one thread: the matrices are small; the minimizer divides by zero when it is done
    with threadpool_limits(1), np.errstate(divide="ignore", invalid="ignore"):
        found = registration.registration(
            (target - target.mean(axis=0)) / unit, maxiter=ANNEALINGS, tol=1e-6
        )
    return rigid(found.rot, found.t, source, target, unit)


FILTERREG = Method(
    "FilterReg", version_of("probreg"), _filterreg, "outlier weight 0.1, variance updated"
)
GMMREG = Method(
    "GMMReg", version_of("probreg"), _gmmreg, "80 components, 10 annealing steps by 0.8"
)
