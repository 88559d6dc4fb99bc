"""What each exception means to a caller."""

from __future__ import annotations

import errno
from types import ModuleType

import pytest

import service.outbound.errors as outbound
from mpe_core import errors as core
from service import problems
from service.formats.errors import CloudFileError, MissingAttributeError, TruncatedFileError
from service.problems import (
    INTERNAL,
    QueueFullError,
    ServiceError,
    all_problem_types,
    error_document,
    problem_document,
    problem_type,
)


def test_no_two_problem_types_share_a_slug() -> None:
    slugs = [kind.slug for kind in all_problem_types()]
    assert sorted(slugs) == sorted(set(slugs))


@pytest.mark.parametrize("module", [problems, outbound])
def test_every_exception_has_a_problem_type_of_its_own_or_of_its_parent(module: ModuleType) -> None:
    errors = [
        item
        for item in vars(module).values()
        if isinstance(item, type) and issubclass(item, ServiceError) and item is not ServiceError
    ]
    assert errors
    assert all(error.problem is not INTERNAL for error in errors)
    assert all(400 <= error.problem.status < 600 for error in errors)


@pytest.mark.parametrize(
    ("error", "slug"),
    [
        (QueueFullError("full"), "queue-full"),
        (outbound.FetchTlsError("no"), "fetch-tls"),
        (outbound.FetchCutError("cut"), "fetch-failed"),
        (TruncatedFileError("short"), "unreadable-cloud"),
        (MissingAttributeError("none"), "invalid-weights"),
        (core.InvalidWeightsError("negative"), "invalid-weights"),
        (core.InvalidCloudError("no cloud"), "registration-error"),
        (ServiceError("unnamed"), "internal-error"),
        (KeyError("bug"), "internal-error"),
        (MemoryError(), "internal-error"),
    ],
)
def test_the_nearest_ancestor_gives_the_type(error: Exception, slug: str) -> None:
    assert problem_type(error).slug == slug


def test_a_document_has_the_members_of_rfc_9457() -> None:
    assert error_document(QueueFullError("Retry later.")) == {
        "type": "urn:mpe:problem:queue-full",
        "title": "The queue is full",
        "status": 429,
        "detail": "Retry later.",
    }
    assert problem_document(INTERNAL, "x", job="7")["job"] == "7"


def test_retry_after_is_that_of_the_class_unless_stated() -> None:
    assert QueueFullError("x").headers == {"Retry-After": "5"}
    assert QueueFullError("x", retry_after_s=0.2).headers == {"Retry-After": "1"}
    assert ServiceError("x", headers={"Allow": "GET"}).headers == {"Allow": "GET"}


@pytest.mark.parametrize("number", [errno.ENOSPC, errno.EDQUOT])
@pytest.mark.parametrize("is_wrapped", [False, True])
def test_a_full_disk_is_nobodys_fault_and_tells_no_path(number: int, is_wrapped: bool) -> None:
    error: Exception = OSError(number, "No space left", "/data/blobs/ab")
    if is_wrapped:
        cause, error = error, CloudFileError("source: [Errno 28] /data/scratch/x")
        error.__cause__ = cause
    document = error_document(error)
    assert (document["status"], document["type"]) == (507, "urn:mpe:problem:disk-full")
    assert "/data" not in document["detail"]
