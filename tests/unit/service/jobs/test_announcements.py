"""What is announced is understood; what another release announces is left alone."""

from __future__ import annotations

import pytest

from service.jobs.announcements import Announcement


@pytest.mark.parametrize("change", ["queued", "changed", "ended"])
def test_an_announcement_is_understood(change: str) -> None:
    announced = Announcement(change, "fetch", "a-job")  # type: ignore[arg-type]
    assert Announcement.decode(announced.encode()) == announced


@pytest.mark.parametrize("text", ["", "moved register a", "queued elsewhere a", "queued"])
def test_other_texts_mean_nothing(text: str) -> None:
    assert Announcement.decode(text) is None
