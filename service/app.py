"""The ASGI application: wiring only."""

from __future__ import annotations

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

from fastapi import FastAPI
from starlette.middleware.cors import CORSMiddleware

from service.api.error_handlers import register_error_handlers
from service.api.middleware.drain_body import DrainBodyMiddleware
from service.api.middleware.request_log import RequestLogMiddleware
from service.api.middleware.security_headers import CORS, SecurityHeadersMiddleware
from service.api.openapi import describe
from service.api.routes import (
    aligned,
    clouds,
    deliveries,
    events,
    formats,
    health,
    inliers,
    registrations,
    uploads,
)
from service.runtime import open_runtime
from service.settings import Settings
from service.telemetry.metrics import Metrics


def create_app(settings: Settings | None = None) -> FastAPI:
    """The application; its service runs from the start of its lifespan to the end."""

    settings, metrics = settings or Settings(), Metrics()

    @asynccontextmanager
    async def lifespan(app: FastAPI) -> AsyncIterator[None]:
        with open_runtime(settings, metrics) as app.state.service:
            yield

    app = FastAPI(title="mpe", lifespan=lifespan, openapi_url=None, docs_url=None, redoc_url=None)
    app.add_middleware(DrainBodyMiddleware)
    if settings.cors_origins:
        app.add_middleware(CORSMiddleware, allow_origins=settings.cors_origins, **CORS)
    app.add_middleware(SecurityHeadersMiddleware)
    app.add_middleware(RequestLogMiddleware, metrics=metrics)
    register_error_handlers(app, metrics)
    for module in (
        registrations,
        inliers,
        aligned,
        events,
        deliveries,
        clouds,
        uploads,
        formats,
        health,
    ):
        app.include_router(module.router)
    describe(app)
    return app
