"""Serving the application with uvicorn."""

from __future__ import annotations

import uvicorn

from service.app import create_app


def serve(host: str = "127.0.0.1", port: int = 8000) -> None:
    """Serve until SIGTERM or SIGINT; the settings come from the MPE_ variables."""
    uvicorn.run(create_app(), host=host, port=port, server_header=False)


if __name__ == "__main__":
    serve()
