"""Calls to hosts that callers named: fetching clouds, sending callbacks.

No other package opens such connections. Each call checks the URL, resolves the host once, checks
all of its addresses and connects to one of these.
"""

from service.outbound.client import OutboundClient
from service.outbound.deadline import TransferDeadline, TransferLimits
from service.outbound.fetch import (
    S3_SCHEME,
    FetchPolicy,
    callback_policy,
    check_callback,
    check_source,
    fetch,
)
from service.outbound.http_cache import CachedFile, HttpCache, Validators
from service.outbound.urls import parse_url, redact_url

__all__ = [
    "S3_SCHEME",
    "CachedFile",
    "FetchPolicy",
    "HttpCache",
    "OutboundClient",
    "TransferDeadline",
    "TransferLimits",
    "Validators",
    "callback_policy",
    "check_callback",
    "check_source",
    "fetch",
    "parse_url",
    "redact_url",
]
