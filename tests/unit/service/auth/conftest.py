"""A database with keys, and settings with limits."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from service.auth.keys import KeyStore
from service.database.engine import open_database
from service.settings import KeySettings, Settings


@pytest.fixture
def settings(tmp_path: Path) -> Settings:
    limits = KeySettings(requests_per_s=5, queue_limit=7, stored_bytes=0)
    return Settings(data_dir=tmp_path, key=limits)


@pytest.fixture
def keys(settings: Settings) -> Iterator[KeyStore]:
    """Keys in the database of the settings."""
    database = open_database(settings.store_url)
    yield KeyStore(database)
    database.close()
