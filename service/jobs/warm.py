"""Imported by the forkserver alone: what every worker needs, loaded once before the first fork."""

from __future__ import annotations

import os

from service.jobs import attempt  # noqa: F401
from service.jobs.confinement import die_with_parent

FORKSERVER = os.getpid()

die_with_parent(os.getppid())
