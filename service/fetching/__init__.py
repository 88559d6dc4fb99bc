"""The one door through which the service calls what its callers name: clouds and callbacks."""

from service.fetching.door import Door
from service.fetching.known import KnownFiles, forget_removed
from service.fetching.source import (
    FetchRules,
    callback_rules,
    check_callback,
    check_source,
    fetch,
)
from service.fetching.stopwatch import Stopwatch, TimeBounds
from service.fetching.urls import parse_url

__all__ = [
    "Door",
    "FetchRules",
    "KnownFiles",
    "Stopwatch",
    "TimeBounds",
    "callback_rules",
    "check_callback",
    "check_source",
    "fetch",
    "forget_removed",
    "parse_url",
]
