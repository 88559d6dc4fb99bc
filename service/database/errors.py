"""Errors of SQLAlchemy as errors of the service."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from contextlib import contextmanager

from sqlalchemy.exc import DatabaseError, DataError, OperationalError, TimeoutError

from service.problems import InvalidRequestError, NotReadyError

log = logging.getLogger(__name__)


@contextmanager
def translate_errors() -> Iterator[None]:
    """Raise what the service understands for errors of the database.

    Raises
    ------
    NotReadyError
        The database does not answer, or is damaged.
    InvalidRequestError
        A value cannot be stored: PostgreSQL refuses NUL characters.
    """
    try:
        yield
    except (OperationalError, TimeoutError) as error:
        log.error("the job store does not answer: %s", error)
        raise NotReadyError("The job store does not answer; retry later.") from error
    except DataError as error:
        raise InvalidRequestError(
            "A text contains a character that cannot be stored (NUL); remove it."
        ) from error
    except DatabaseError as error:
        if error.connection_invalidated:
            log.error("the job store ended a connection: %s", error)
            raise NotReadyError("The job store does not answer; retry later.") from error
        if type(error) is not DatabaseError:  # a subclass is a mistake of this program
            raise
        log.critical("the job store is damaged: %s", error)
        raise NotReadyError("The job store is damaged; tell the operator.") from error
