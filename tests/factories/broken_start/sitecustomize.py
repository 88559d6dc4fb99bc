"""A system on which no worker can start, while the file exists that BROKEN_START names.

Python imports this module at its start where its folder is on PYTHONPATH.
"""

from __future__ import annotations

import os
import sys
from pathlib import Path

REASON = "no worker starts here"


def is_forkserver() -> bool:
    return any("multiprocessing.forkserver" in word for word in sys.orig_argv)


if is_forkserver() and Path(os.environ["BROKEN_START"]).exists():
    sys.exit(REASON)
