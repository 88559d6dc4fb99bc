"""A web server of the callers: files and hooks that are good, and two that hold who calls them."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

from tests.factories.scans import arms, as_npy
from tests.factories.web import Handler, serving


@dataclass(frozen=True, slots=True)
class Traps:
    """URLs of the server."""

    dripping: str
    silent: str
    cloud: str
    hook: str


@contextmanager
def open_traps() -> Iterator[Traps]:
    """Serve at 127.0.0.1 while the context lasts."""
    cloud = as_npy(arms(1))
    with serving() as web:
        web.behaviours = {
            "/drip": _drip,
            "/silent": _stay_silent,
            "/cloud": lambda handler: handler.give(cloud),
            "/hook": lambda handler: handler.head(204, Content_Length="0"),
        }
        yield Traps(*(web.url(path, "127.0.0.1") for path in web.behaviours))


def _drip(handler: Handler) -> None:
    handler.head(200, Content_Length="1000000")
    handler.drip(every_s=0.2)


def _stay_silent(handler: Handler) -> None:
    handler.server.is_closing.wait(60)
