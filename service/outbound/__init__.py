"""The one door through which the service calls what its callers name: clouds and callbacks."""

from service.outbound.client import Door
from service.outbound.deadline import Stopwatch, TimeBounds
from service.outbound.fetch import (
    FetchRules,
    callback_rules,
    check_callback,
    check_source,
    fetch,
)
from service.outbound.http_cache import KnownFiles, forget_removed
from service.outbound.urls import parse_url

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
