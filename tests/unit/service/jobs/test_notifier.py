"""Coroutines are woken by what they watch, from whatever thread it comes."""

from __future__ import annotations

import asyncio
from collections.abc import Coroutine
from typing import Any

from service.jobs.notifier import JobNotifier
from tests.factories.jobs import new_job

PATIENCE_S = 60.0


def run(test: Coroutine[Any, Any, None]) -> None:
    asyncio.run(asyncio.wait_for(test, PATIENCE_S))


def test_a_change_wakes_those_who_watch_changes_and_an_end_all_who_watch_the_job() -> None:
    async def wake() -> None:
        notifier, job = JobNotifier(), new_job()
        with (
            notifier.watch(job.id, only_end=False) as every_change,
            notifier.watch(job.id, only_end=True) as end,
            notifier.watch("another", only_end=False) as another,
        ):
            await asyncio.to_thread(notifier.changed, job.id)
            await every_change.wait()
            assert not end.is_set()
            every_change.clear()
            await asyncio.to_thread(notifier.ended, job)
            await every_change.wait()
            await end.wait()
            assert not another.is_set()

    run(wake())


def test_all_are_woken_when_nothing_will_change_any_more() -> None:
    async def wake() -> None:
        notifier = JobNotifier()
        with (
            notifier.watch("a", only_end=False) as first,
            notifier.watch("b", only_end=True) as second,
        ):
            await asyncio.to_thread(notifier.wake_all)
            await first.wait()
            await second.wait()

    run(wake())


def test_who_no_longer_watches_is_not_woken() -> None:
    async def wake() -> None:
        notifier = JobNotifier()
        with notifier.watch("a", only_end=False) as first:
            pass
        with notifier.watch("a", only_end=False) as second:
            notifier.changed("a")
            await second.wait()
        assert not first.is_set()

    run(wake())


def test_changes_after_the_end_of_the_loop_are_ignored() -> None:
    async def make() -> JobNotifier:
        return JobNotifier()

    notifier = asyncio.run(make())
    notifier.changed("a")
    notifier.ended(new_job())
    notifier.wake_all()
