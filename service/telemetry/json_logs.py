"""Logs as JSON lines on stderr, each with the ids of its request and its job."""

from __future__ import annotations

import logging
import logging.config
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar

request_id: ContextVar[str | None] = ContextVar("request_id", default=None)
job_id: ContextVar[str | None] = ContextVar("job_id", default=None)


class ContextFilter(logging.Filter):
    """Add request_id and job_id to each record that is logged within one."""

    def filter(self, record: logging.LogRecord) -> bool:
        """Add the ids; never drops a record."""
        for name, variable in (("request_id", request_id), ("job_id", job_id)):
            value = variable.get()
            if value is not None and not hasattr(record, name):
                setattr(record, name, value)
        return True


_LOGGED = "the service has logged this error"


@contextmanager
def job_context(identifier: str) -> Iterator[None]:
    """Log everything within the context with this job_id."""
    token = job_id.set(identifier)
    try:
        yield
    finally:
        job_id.reset(token)


def mark_logged(error: Exception) -> None:
    """Let the server, which Starlette hands the error on to, not log it again."""
    error.add_note(_LOGGED)


class UnloggedFilter(logging.Filter):
    """Drops records of exceptions that `mark_logged` has marked."""

    def filter(self, record: logging.LogRecord) -> bool:
        """Tell whether the record's exception is new, or it has none."""
        error = record.exc_info[1] if record.exc_info else None
        return _LOGGED not in getattr(error, "__notes__", ())


def configure_logs(level: str) -> None:
    """Send all logs of this level and above to stderr; the service writes its own access log."""
    logging.config.dictConfig(
        {
            "version": 1,
            "disable_existing_loggers": False,
            "filters": {"context": {"()": ContextFilter}, "unlogged": {"()": UnloggedFilter}},
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
                    "filters": ["context"],
                }
            },
            "root": {"level": level, "handlers": ["stderr"]},
            "loggers": {
                "uvicorn.access": {"level": "WARNING"},
                "uvicorn.error": {"filters": ["unlogged"]},
                "alembic.runtime.migration": {"level": "WARNING"},
                # their DEBUG messages hold URLs, headers and bodies
                "httpcore": {"level": "WARNING"},
                "python_multipart": {"level": "WARNING"},
            },
        }
    )
