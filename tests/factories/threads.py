"""Which threads call a function."""

from __future__ import annotations

import threading
from typing import Any

import pytest


def note_threads(monkeypatch: pytest.MonkeyPatch, owner: object, name: str) -> set[int]:
    """Return the ids of the threads that call the function or method from now on."""
    callers: set[int] = set()
    call = getattr(owner, name)

    def noted(*given: Any) -> Any:
        callers.add(threading.get_ident())
        return call(*given)

    monkeypatch.setattr(owner, name, noted)
    return callers
