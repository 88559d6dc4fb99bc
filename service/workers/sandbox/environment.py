"""Preload module of the forkserver: it restarts itself with an environment without secrets.

The restart comes before anything is loaded, so that neither the forkserver nor a child of it has
ever had the secrets in its memory. The service process keeps its environment.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Mapping

KEPT_NAMES = frozenset(("HOME", "LANG", "MPE_LOG_LEVEL", "PATH", "TMPDIR", "TZ", "USER"))
KEPT_PREFIXES = (
    "COVERAGE_",
    "GOMP_",
    "KMP_",
    "LC_",
    "LD_",
    "MALLOC_",
    "MKL_",
    "NUMBA_",
    "OMP_",
    "OPENBLAS_",
    "PYTHON",
    "SSL_CERT_",
    "XDG_CACHE_",
)
"""Beginnings of the names of variables that the interpreter and the libraries read."""
_FORKSERVER_PROGRAM = "from multiprocessing.forkserver import main"


def keep_harmless(environment: Mapping[str, str]) -> dict[str, str]:
    """Return the variables that the interpreter and the libraries need, and no others."""
    return {
        name: value
        for name, value in environment.items()
        if name in KEPT_NAMES or name.startswith(KEPT_PREFIXES)
    }


def _restart_without_secrets() -> None:
    harmless = keep_harmless(os.environ)
    if harmless != dict(os.environ):
        os.execve(sys.orig_argv[0], sys.orig_argv, harmless)  # noqa: S606


if any(argument.startswith(_FORKSERVER_PROGRAM) for argument in sys.orig_argv):
    _restart_without_secrets()
