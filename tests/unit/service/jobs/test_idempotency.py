"""Keys of requests that have not been answered yet."""

from __future__ import annotations

import pytest

from service.jobs.idempotency import InFlightKeys
from service.problems import IdempotencyInFlightError


def test_a_key_is_locked_while_its_request_is_under_way() -> None:
    keys = InFlightKeys()
    with keys.lock("lab", "k"):
        with pytest.raises(IdempotencyInFlightError) as caught, keys.lock("lab", "k"):
            pass
        assert int(caught.value.headers["Retry-After"]) > 0
        with keys.lock("lab", "other"), keys.lock("other", "k"):
            pass
    with keys.lock("lab", "k"):
        pass


def test_a_request_that_fails_frees_its_key() -> None:
    keys = InFlightKeys()
    with pytest.raises(OSError, match="cut"), keys.lock("lab", "k"):
        raise OSError("cut")
    with keys.lock("lab", "k"):
        pass


def test_a_refused_request_does_not_free_the_key() -> None:
    keys = InFlightKeys()
    with keys.lock("lab", "k"):
        for _ in range(2):
            with pytest.raises(IdempotencyInFlightError), keys.lock("lab", "k"):
                pass


def test_requests_without_a_key_do_not_exclude_each_other() -> None:
    keys = InFlightKeys()
    with keys.lock("lab", None), keys.lock("lab", None):
        pass


def test_a_key_is_free_once_its_request_is_stored() -> None:
    keys = InFlightKeys()
    with keys.lock("lab", "k"):
        keys.release("lab", "k")
        with keys.lock("lab", "k"):
            pass


def test_a_request_frees_no_key_that_another_one_has_taken_since() -> None:
    keys = InFlightKeys()
    first = keys.lock("lab", "k")
    first.__enter__()
    keys.release("lab", "k")
    with keys.lock("lab", "k"):
        first.__exit__(None, None, None)
        with pytest.raises(IdempotencyInFlightError), keys.lock("lab", "k"):
            pass
