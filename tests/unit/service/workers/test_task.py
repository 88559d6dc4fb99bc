"""Tasks are handed over by the service process, which loads none of what they need."""

from __future__ import annotations

import pickle
import subprocess
import sys
from pathlib import Path

import pytest

from service.clouds.inputs import CloudInput
from service.outbound import FetchPolicy
from service.settings import Settings
from service.workers.aligned_pair import AlignedPair
from service.workers.export_aligned import ExportAligned
from service.workers.fetch_inputs import FetchInputs
from service.workers.register_clouds import RegisterClouds
from service.workers.task import CPU_SLACK_S, Task, TaskEnvironment

PROJECT = Path(__file__).parents[4]
SETTINGS = Settings(workers=1, threads_per_worker=1, job_timeout_s=100, job_memory_bytes=1 << 30)
ENVIRONMENT = TaskEnvironment.create(
    job_id="job", tenant="lab", scratch=Path("scratch"), settings=SETTINGS
)
CLOUD = CloudInput(sha256="ab" * 32, size=1)
FETCH = FetchInputs(ENVIRONMENT, CLOUD, CLOUD, FetchPolicy.of(SETTINGS))
REGISTER = RegisterClouds(ENVIRONMENT, CLOUD, CLOUD, {"seed": 1})
EXPORT = ExportAligned(ENVIRONMENT, AlignedPair([[1.0]], CLOUD, CLOUD, None), False, False, "ply")


@pytest.mark.parametrize("task", [FETCH, REGISTER, EXPORT], ids=lambda task: type(task).__name__)
def test_a_task_survives_the_pipe(task: Task) -> None:
    assert pickle.loads(pickle.dumps(task)) == task


def test_only_the_task_that_decodes_nothing_keeps_its_network() -> None:
    assert FETCH.uses_network
    assert not REGISTER.uses_network
    assert not EXPORT.uses_network


def test_the_wall_clock_ends_a_task_before_its_cpu_time() -> None:
    assert ENVIRONMENT.limits.cpu_s == 100 + CPU_SLACK_S
    assert ENVIRONMENT.limits.memory_bytes == 1 << 30


def test_the_service_process_loads_no_kernels() -> None:
    program = "import sys, service.app; print('numba' in sys.modules, 'scipy' in sys.modules)"
    done = subprocess.run(
        [sys.executable, "-c", program], cwd=PROJECT, capture_output=True, text=True
    )
    assert done.stdout == "False False\n", done.stderr
