"""The forkserver and its children have no secret in their environment."""

from __future__ import annotations

import pytest

from service.workers.sandbox.environment import keep_harmless


@pytest.mark.parametrize(
    "name",
    [
        "MPE_DATABASE_URL",
        "MPE_S3_SECRET_ACCESS_KEY",
        "MPE_WEBHOOK_SECRET",
        "AWS_SECRET_ACCESS_KEY",
        "PGPASSWORD",
        "API_TOKEN",
    ],
)
def test_secrets_are_left_out(name: str) -> None:
    assert keep_harmless({name: "secret", "PATH": "/bin"}) == {"PATH": "/bin"}


@pytest.mark.parametrize(
    "name", ["MPE_LOG_LEVEL", "NUMBA_CACHE_DIR", "OMP_NUM_THREADS", "PYTHONPATH", "SSL_CERT_FILE"]
)
def test_what_libraries_read_is_kept(name: str) -> None:
    assert keep_harmless({name: "value"}) == {name: "value"}
