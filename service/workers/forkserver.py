"""Preload module of the forkserver: what every child needs, loaded once before the first fork."""

from __future__ import annotations

import gc
import os

import DracoPy  # noqa: F401
import h5py  # noqa: F401
import laspy  # noqa: F401
import pye57  # noqa: F401
import trimesh  # noqa: F401

from mpe_core import deviation, register  # noqa: F401
from mpe_core.kernels import cell_filter, decimal_rows, lzf  # noqa: F401
from service.schemas import deviation as deviation_schema  # noqa: F401
from service.schemas import serialize_result  # noqa: F401
from service.telemetry.json_logs import configure_logs
from service.workers import (  # noqa: F401
    child_main,
    export_aligned,
    export_deviation,
    export_preview,
    export_report,
    fetch_inputs,
    register_clouds,
)
from service.workers.sandbox.confinement import library_paths
from service.workers.sandbox.limits import (
    die_with_parent,
    forbid_inspection,
    remember_forkserver,
)

forbid_inspection()
remember_forkserver()
die_with_parent(os.getppid())
library_paths()  # cached here for all children
configure_logs(os.environ.get("MPE_LOG_LEVEL", "INFO"))
# without the freeze a child's garbage collector touches, and so copies, every page that it shares
# with this process (docs/tuning.md, service.workers)
gc.collect()
gc.freeze()
