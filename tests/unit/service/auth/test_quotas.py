"""The storage quota of a tenant."""

from __future__ import annotations

import time
from typing import cast

import pytest

from service.auth.authenticator import Caller
from service.auth.keys import KeyLimits
from service.auth.quotas import CACHE_TTL_S, MAX_COUNTING_FRACTION, StorageQuota
from service.database.engine import Database
from service.problems import QuotaExceededError


class Stored:
    """Stands for the count in the database."""

    def __init__(self) -> None:
        self.bytes = {"lab": 0, "other": 0}
        self.counted = 0
        self.takes_s = 0.0

    def __call__(self, _database: Database, tenant: str) -> int:
        self.counted += 1
        time.sleep(self.takes_s)
        return self.bytes[tenant]


@pytest.fixture
def stored(monkeypatch: pytest.MonkeyPatch) -> Stored:
    count = Stored()
    monkeypatch.setattr("service.auth.quotas.count_stored_bytes", count)
    return count


@pytest.fixture
def quota(stored: Stored) -> StorageQuota:
    return StorageQuota(cast(Database, None))


def caller(limit: int | None, tenant: str = "lab") -> Caller:
    return Caller(tenant, KeyLimits(stored_bytes=limit), "key")


def test_what_is_reserved_counts_until_the_limit(quota: StorageQuota, stored: Stored) -> None:
    stored.bytes["lab"] = 40
    quota.reserve(caller(100), 50)
    assert quota.used("lab") == 90
    with pytest.raises(QuotaExceededError) as refused:
        quota.reserve(caller(100), 11)
    assert refused.value.members == {"limit": "stored_bytes", "used": 90, "allowed": 100}
    assert "needs 11 more" in str(refused.value)
    quota.reserve(caller(100), 10)


def test_at_the_limit_not_even_an_empty_body_is_accepted(
    quota: StorageQuota, stored: Stored
) -> None:
    stored.bytes["lab"] = 100
    with pytest.raises(QuotaExceededError):
        quota.reserve(caller(100), 0)


def test_a_refused_reservation_reserves_nothing(quota: StorageQuota) -> None:
    with pytest.raises(QuotaExceededError):
        quota.reserve(caller(100), 101)
    assert quota.used("lab") == 0


def test_what_is_released_counts_as_stored_until_the_next_count(
    quota: StorageQuota, stored: Stored, monkeypatch: pytest.MonkeyPatch
) -> None:
    now = 1000.0
    monkeypatch.setattr("service.auth.quotas.time.monotonic", lambda: now)
    quota.reserve(caller(100), 60)
    quota.release(caller(100), 60)
    with pytest.raises(QuotaExceededError):
        quota.reserve(caller(100), 50)
    stored.bytes["lab"] = 20  # the body was smaller than announced
    now += CACHE_TTL_S
    quota.reserve(caller(100), 50)
    assert quota.used("lab") == 70


def test_tenants_do_not_share_a_quota(quota: StorageQuota, stored: Stored) -> None:
    stored.bytes["other"] = 100
    quota.reserve(caller(100), 100)
    assert quota.used("other") == 100
    assert quota.used("lab") == 100


def test_callers_without_a_limit_are_counted_but_never_refused(quota: StorageQuota) -> None:
    quota.reserve(caller(None), 10**15)
    assert quota.used("lab") == 10**15
    with pytest.raises(QuotaExceededError):
        quota.reserve(caller(100), 1)
    quota.release(caller(None), 10**15)


def test_the_database_is_counted_at_most_once_in_the_time_to_live(
    quota: StorageQuota, stored: Stored, monkeypatch: pytest.MonkeyPatch
) -> None:
    now = 1000.0
    monkeypatch.setattr("service.auth.quotas.time.monotonic", lambda: now)
    for _ in range(10):
        quota.used("lab")
        now += CACHE_TTL_S / 20
    assert stored.counted == 1
    now += CACHE_TTL_S
    quota.used("lab")
    assert stored.counted == 2


def test_a_slow_count_is_used_longer(quota: StorageQuota, stored: Stored) -> None:
    stored.takes_s = 2 * CACHE_TTL_S * MAX_COUNTING_FRACTION
    quota.used("lab")
    time.sleep(1.2 * CACHE_TTL_S)
    quota.used("lab")
    assert stored.counted == 1
