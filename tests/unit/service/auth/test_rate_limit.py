"""The rate limit of a key."""

from __future__ import annotations

import pytest

from service.auth.authenticator import ANONYMOUS, Caller
from service.auth.keys import KeyLimits
from service.auth.rate_limit import RateLimiter
from service.problems import RateLimitedError


@pytest.mark.parametrize("rate", [0.5, 1, 7, 100])
def test_as_many_at_once_as_in_a_second(rate: float, monkeypatch: pytest.MonkeyPatch) -> None:
    now = 1000.0
    monkeypatch.setattr("service.auth.rate_limit.time.monotonic", lambda: now)
    limiter, caller = RateLimiter(), Caller("lab", KeyLimits(rate), "key")

    def passed(tries: int) -> int:
        return sum(_passes(limiter, caller) for _ in range(tries))

    assert passed(300) == max(1, rate)
    now += 10
    assert passed(300) == max(1, rate)
    now += 1 / rate
    assert passed(300) == 1
    evenly = 0
    for _ in range(100):
        now += 1.000001 / rate
        evenly += passed(1)
    assert evenly == 100


def test_a_request_is_accepted_after_retry_after(monkeypatch: pytest.MonkeyPatch) -> None:
    now = 1000.0
    monkeypatch.setattr("service.auth.rate_limit.time.monotonic", lambda: now)
    limiter, caller = RateLimiter(), Caller("lab", KeyLimits(0.3), "key")
    limiter.check(caller)
    with pytest.raises(RateLimitedError) as refused:
        limiter.check(caller)
    now += int(refused.value.headers["Retry-After"])
    limiter.check(caller)


def test_keys_do_not_share_a_limit_and_callers_without_one_have_none() -> None:
    limiter = RateLimiter()
    for caller in (
        Caller("lab", KeyLimits(1), "a"),
        Caller("lab", KeyLimits(1), "b"),
        *[ANONYMOUS] * 10,
        *[Caller("lab", KeyLimits(), "c")] * 10,
    ):
        limiter.check(caller)


def _passes(limiter: RateLimiter, caller: Caller) -> bool:
    try:
        limiter.check(caller)
    except RateLimitedError:
        return False
    return True
