"""The ASGI application: middleware, error handlers and routes, put together."""

from __future__ import annotations

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

from fastapi import FastAPI
from starlette.middleware.cors import CORSMiddleware

from service.api.error_handlers import register_error_handlers
from service.api.liveness import liveness_app
from service.api.middleware.conditional import ConditionalMiddleware
from service.api.middleware.cors import CORS_OPTIONS
from service.api.middleware.drain_body import DrainBodyMiddleware
from service.api.middleware.head import HeadMiddleware
from service.api.middleware.request_log import RequestLogMiddleware
from service.api.middleware.security_headers import SecurityHeadersMiddleware
from service.api.openapi import add_description
from service.api.route_methods import route_methods
from service.api.routes import (
    aligned,
    clouds,
    deliveries,
    deviation,
    direct,
    events,
    formats,
    health,
    inliers,
    page,
    previews,
    registrations,
    reports,
    site,
    uploads,
)
from service.api.threads import limit_threads
from service.runtime import Role, open_runtime
from service.settings import Settings
from service.telemetry.metrics import Metrics

ROUTE_MODULES = (
    registrations,
    inliers,
    aligned,
    deviation,
    previews,
    reports,
    events,
    deliveries,
    direct,
    clouds,
    uploads,
    formats,
    health,
    page,
    site,
)
"""Modules with a `router`, in the order of the OpenAPI description."""


def create_app(settings: Settings | None = None, role: Role = "all") -> FastAPI:
    """Create the application; its lifespan opens and closes the runtime.

    Parameters
    ----------
    settings : Settings, optional
        Default: from the environment.
    role
        What the service does; a worker answers probes and measurements alone.
    """
    settings, metrics = settings or Settings(), Metrics()

    @asynccontextmanager
    async def lifespan(app: FastAPI) -> AsyncIterator[None]:
        limit_threads(waits_for_others=bool(settings.database_url or settings.blob.url))
        with open_runtime(settings, metrics, role) as app.state.runtime:
            yield

    app = FastAPI(
        title="mpe",
        lifespan=lifespan,
        openapi_url=None,
        docs_url=None,
        redoc_url=None,
        redirect_slashes=False,  # a redirect would repeat a Host that was not checked
    )
    app.add_middleware(DrainBodyMiddleware)
    app.add_middleware(ConditionalMiddleware)
    app.add_middleware(HeadMiddleware)
    if settings.cors_origins:
        app.add_middleware(CORSMiddleware, allow_origins=settings.cors_origins, **CORS_OPTIONS)
    app.add_middleware(SecurityHeadersMiddleware)
    app.add_middleware(RequestLogMiddleware, metrics=metrics)
    register_error_handlers(app, metrics)
    app.state.liveness = liveness_app(metrics)
    for module in (health,) if role == "worker" else ROUTE_MODULES:
        app.include_router(module.router)
    add_description(app)
    route_methods(app, "/")  # builds the routes: the first request would wait 0.1 s for that
    return app
