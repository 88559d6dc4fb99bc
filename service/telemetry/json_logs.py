"""Logs as JSON lines, each with the request and the job that it belongs to."""

from __future__ import annotations

import logging
import logging.config
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar

request_id: ContextVar[str | None] = ContextVar("request_id", default=None)
job_id: ContextVar[str | None] = ContextVar("job_id", default=None)


class ContextFilter(logging.Filter):
    """Adds request_id and job_id where they are known."""

    def filter(self, record: logging.LogRecord) -> bool:
        """Never drops a record."""
        for name, variable in (("request_id", request_id), ("job_id", job_id)):
            value = variable.get()
            if value is not None and not hasattr(record, name):
                setattr(record, name, value)
        return True


@contextmanager
def job_context(identity: str) -> Iterator[None]:
    """What is logged within belongs to the job."""
    token = job_id.set(identity)
    try:
        yield
    finally:
        job_id.reset(token)


def configure_logs(level: str) -> None:
    """Send everything to stderr as JSON; the service writes its own access lines."""
    logging.config.dictConfig(
        {
            "version": 1,
            "disable_existing_loggers": False,
            "filters": {"belonging": {"()": ContextFilter}},
            "formatters": {
                "json": {
                    "()": "pythonjsonlogger.json.JsonFormatter",
                    "fmt": "%(levelname)s %(name)s %(message)s",
                    "rename_fields": {"levelname": "level", "name": "logger"},
                    "timestamp": "time",
                }
            },
            "handlers": {
                "stderr": {
                    "class": "logging.StreamHandler",
                    "formatter": "json",
                    "filters": ["belonging"],
                }
            },
            "root": {"level": level, "handlers": ["stderr"]},
            "loggers": {
                "uvicorn.access": {"level": "WARNING"},
                "alembic.runtime.migration": {"level": "WARNING"},
                # these tell of addresses, headers and bodies
                "httpcore": {"level": "WARNING"},
                "python_multipart": {"level": "WARNING"},
            },
        }
    )
