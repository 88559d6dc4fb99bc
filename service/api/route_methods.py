"""Methods that the routes of a path have."""

from __future__ import annotations

from fastapi import FastAPI
from fastapi.routing import iter_route_contexts


def route_methods(app: FastAPI, path: str) -> set[str]:
    """Return the methods of all routes of the path; Starlette lists those of one route only."""
    return {
        method
        for route in iter_route_contexts(app.routes)
        if route.path_regex.fullmatch(path)
        for method in route.methods or ()
    }
