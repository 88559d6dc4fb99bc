"""The one door through which the service calls what its callers name: clouds and callbacks."""

from service.outbound.client import OutboundClient
from service.outbound.deadline import TransferDeadline, TransferLimits
from service.outbound.fetch import (
    FetchRules,
    callback_rules,
    check_callback,
    check_source,
    fetch,
)
from service.outbound.http_cache import HttpCache, prune_http_cache
from service.outbound.urls import parse_url

__all__ = [
    "FetchRules",
    "HttpCache",
    "OutboundClient",
    "TransferDeadline",
    "TransferLimits",
    "callback_rules",
    "check_callback",
    "check_source",
    "fetch",
    "parse_url",
    "prune_http_cache",
]
