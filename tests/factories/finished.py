"""A registration that has succeeded, in a runtime without workers, and exports without a child."""

from __future__ import annotations

import io
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from service.clouds.inputs import CloudInput
from service.jobs.model import JobRow, Outcome
from service.runtime import Runtime
from service.schemas.deviation import Deviation
from service.settings import Settings
from service.workers.exporter import ExportedFile
from service.workers.register_clouds import INLIERS_NAME, RESULT_NAME
from service.workers.task import FileTask, TaskEnvironment
from tests.factories.attempts import result_files
from tests.factories.jobs import LEASE_S, new_job

EXPORTED = b"0123456789"
DEVIATION = Deviation(
    signed=False,
    count=1,
    beyond=0,
    mean=0.5,
    std=0.0,
    rms=0.5,
    minimum=0.5,
    maximum=0.5,
    percentiles=[],
    shares=[],
    histogram_edges=[0.0, 1.0],
    histogram_counts=[1],
)


def add_finished(runtime: Runtime, inliers: NDArray[np.void] | None = None) -> str:
    """Id of a registration whose result and clouds are stored; two pairs unless some are given."""
    files = result_files()
    if inliers is not None:
        np.save(buffer := io.BytesIO(), inliers)
        files[INLIERS_NAME] = buffer.getvalue()
    cloud = runtime.blobs.put([b"0 0 0\n"])
    result = runtime.blobs.put([files[RESULT_NAME]])
    pairs = runtime.blobs.put([files[INLIERS_NAME]])
    source = CloudInput(cloud.sha256, cloud.size)
    job = runtime.submit(new_job(tenant="default", source=source, target=source))
    claimed = runtime.transitions.claim("register", lease_s=LEASE_S)
    assert claimed is not None
    outcome = Outcome(result.sha256, pairs.sha256, 1, 0.9, source, source, {}, [])
    assert runtime.transitions.succeed(claimed, outcome, None)
    return job.id


@dataclass
class FakeExporter:
    """Writes EXPORTED, or a document where one is read, in place of a child process."""

    folder: Path
    written: list[str] = field(default_factory=list)
    """Names of the files that were written."""

    @contextmanager
    def export(
        self, job: JobRow, make_task: Callable[[TaskEnvironment], FileTask]
    ) -> Iterator[ExportedFile]:
        task = make_task(
            TaskEnvironment.create(
                job_id=job.id,
                tenant=job.tenant,
                scratch=self.folder,
                settings=Settings(data_dir=self.folder),
            )
        )
        self.written.append(task.output.name)
        is_document = task.output.suffix == ".json"
        task.output.write_bytes(DEVIATION.model_dump_json().encode() if is_document else EXPORTED)
        yield ExportedFile(task.output, ())
