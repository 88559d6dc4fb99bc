"""One log line and one latency measurement per request, and its X-Request-ID."""

from __future__ import annotations

import logging
import re
import time
from uuid import uuid4

from starlette.datastructures import Headers, MutableHeaders
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from service.api.disconnect import is_disconnect
from service.auth.authenticator import Caller
from service.problems import ConnectionClosedError
from service.telemetry.json_logs import request_id
from service.telemetry.metrics import Metrics

_REQUEST_ID = re.compile(r"[A-Za-z0-9._-]{1,64}")

KNOWN_METHODS = frozenset({"GET", "HEAD", "POST", "PUT", "PATCH", "DELETE", "OPTIONS"})
OTHER_METHOD = "other"
"""Label of all methods that are not in KNOWN_METHODS."""
FAILED = 500
"""Status of a request whose application fails; what answers it is outside of this middleware."""
NO_RESPONSE = ConnectionClosedError.problem.status
"""Status of a request that ends without a response: its caller is gone, or the service stops."""

log = logging.getLogger(__name__)


class RequestLogMiddleware:
    """ASGI middleware that logs, measures and names each request.

    The id is the caller's X-Request-ID if that is 1 to 64 letters, digits, `.`, `_` or `-`, and a
    new UUID otherwise.

    Parameters
    ----------
    app : ASGIApp
        The application inside.
    metrics : Metrics
        Receives the duration of each request.
    """

    def __init__(self, app: ASGIApp, *, metrics: Metrics) -> None:
        self._app = app
        self._metrics = metrics

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass the request on and add the id to its response."""
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        given = Headers(scope=scope).get("x-request-id", "")
        current_id = given if _REQUEST_ID.fullmatch(given) else str(uuid4())
        token = request_id.set(current_id)
        status, started = NO_RESPONSE, time.perf_counter()

        async def send_with_id(message: Message) -> None:
            nonlocal status
            if message["type"] == "http.response.start":
                status = message["status"]
                MutableHeaders(scope=message)["X-Request-ID"] = current_id
            await send(message)

        try:
            await self._app(scope, receive, send_with_id)
        except Exception as error:
            if status == NO_RESPONSE and not is_disconnect(error):
                status = FAILED
            raise
        finally:
            self._record(scope, status, time.perf_counter() - started)
            request_id.reset(token)

    def _record(self, scope: Scope, status: int, seconds: float) -> None:
        route = getattr(scope.get("route"), "path_format", "unmatched")
        # any token is a method to HTTP, and each label is kept for ever
        method = scope["method"] if scope["method"] in KNOWN_METHODS else OTHER_METHOD
        self._metrics.requests.labels(method, route, str(status)).observe(seconds)
        facts = {
            "method": scope["method"],
            "path": scope["path"],
            "status": status,
            "duration_ms": round(1000 * seconds, 1),
        }
        caller: Caller | None = scope.get("caller")
        if caller is not None and caller.key_id is not None:
            facts |= {"tenant": caller.tenant, "key": caller.key_id}
        log.info("request", extra=facts)
