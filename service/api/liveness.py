"""GET /livez as an application of its own, whose answer waits for nothing.

In the application each request is a task, which waits until all that is ready has had its turn. A
flood makes that long, and the answer says no more for it.
"""

from __future__ import annotations

from starlette.responses import JSONResponse
from starlette.types import ASGIApp, Receive, Scope, Send

from service.api.middleware.conditional import ConditionalMiddleware
from service.api.middleware.request_log import RequestLogMiddleware
from service.api.middleware.security_headers import SecurityHeadersMiddleware
from service.api.routes.health import router
from service.schemas import Health
from service.telemetry.metrics import Metrics

PATH = "/livez"


def liveness_app(metrics: Metrics) -> ASGIApp:
    """Return the application; it answers as the route does, logged and measured like it."""
    route = next(each for each in router.routes if getattr(each, "path", "") == PATH)

    async def answer(scope: Scope, receive: Receive, send: Send) -> None:
        scope["route"] = route
        await JSONResponse(Health().model_dump())(scope, receive, send)

    return RequestLogMiddleware(
        SecurityHeadersMiddleware(ConditionalMiddleware(answer)), metrics=metrics
    )
