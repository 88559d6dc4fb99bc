"""Routes share few threads where these compute, and more where they wait for other machines."""

from __future__ import annotations

import asyncio
from pathlib import Path

import pytest
from anyio import to_thread

from service.api.threads import THREADS, WAITING_THREADS, limit_threads
from service.app import create_app
from service.settings import Settings


def test_the_threads_that_routes_share_are_few(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("service.runtime.stop_forkserver", lambda: None)  # of other tests
    app = create_app(Settings(data_dir=tmp_path), "api")

    async def look() -> None:
        async with app.router.lifespan_context(app):
            limiter = to_thread.current_default_thread_limiter()
            assert limiter.total_tokens == THREADS
            limit_threads(waits_for_others=True)
            assert limiter.total_tokens == WAITING_THREADS > THREADS

    asyncio.run(look())
