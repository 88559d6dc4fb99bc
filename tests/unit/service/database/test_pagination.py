"""Cursors name the place where a page ends."""

from __future__ import annotations

import re
import time

import pytest

from service.database.pagination import CURSOR, decode_cursor, encode_cursor
from tests.factories.jobs import new_job


def test_a_cursor_is_decoded_to_the_place_of_its_item() -> None:
    job = new_job(created_at=1767603600.123456789)
    cursor = encode_cursor(job)
    assert re.fullmatch(CURSOR, cursor)
    assert decode_cursor(cursor) == (pytest.approx(job.created_at, abs=1e-9), job.id)


def test_times_of_today_survive_a_cursor_exactly() -> None:
    for step in range(1000):
        job = new_job(created_at=time.time() + step * 1e-6)
        assert decode_cursor(encode_cursor(job))[0] == job.created_at


def test_an_id_may_hold_the_separator() -> None:
    place = decode_cursor("1767603600.000000000_a_b")
    assert place == (1767603600.0, "a_b")


@pytest.mark.parametrize("cursor", ["", "1_a", "1.5_a", "1767603600.000000000_", "x.000000000_a"])
def test_what_is_no_cursor_does_not_match(cursor: str) -> None:
    assert not re.fullmatch(CURSOR, cursor)
