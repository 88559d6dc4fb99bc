"""Set the clock of a server: its time.time reads an offset, in seconds, from a file.

Python imports this module at its start where its folder is on PYTHONPATH.
"""

from __future__ import annotations

import os
import time
from pathlib import Path

_system_time = time.time
_file = os.environ.get("TEST_CLOCK_FILE")


def _shifted_time() -> float:
    try:
        return _system_time() + float(Path(str(_file)).read_text() or 0)
    except (OSError, ValueError):
        return _system_time()


if _file is not None:
    time.time = _shifted_time
