"""Search for jobs by words, the same in every script, case and database."""

from __future__ import annotations

import unicodedata
from collections.abc import Iterator

from sqlalchemy import ColumnElement, or_

from service.database.tables import jobs
from service.jobs.model import JobRow
from service.outbound.urls import redact_url

MAX_WORDS = 10
"""Most words of a search: each is looked for in every job of the tenant."""


def fold(text: str) -> str:
    """Return the text without case and without variants of the same letter.

    Neither database does that outside of ASCII, nor do the two agree; macOS decomposes the accents
    of file names.
    """
    return unicodedata.normalize("NFKC", unicodedata.normalize("NFKC", text).casefold())


def render_search_text(job: JobRow) -> str:
    """Return what a search looks at beside the ids and hashes: names that people give."""
    clouds = (job.source, job.target)
    names = (*job.labels.values(), *(name for c in clouds for name in (c.cloud, redact_url(c.url))))
    return fold("\n".join(name for name in names if name))


def split_words(search: str) -> tuple[str, ...]:
    """Return the different words of a search.

    Raises
    ------
    ValueError
        There are more than MAX_WORDS.
    """
    words = tuple(dict.fromkeys(fold(search).split()))
    if len(words) > MAX_WORDS:
        raise ValueError(f"expected at most {MAX_WORDS} words, not {len(words)}: leave some out")
    return words


def match_words(words: tuple[str, ...]) -> Iterator[ColumnElement[bool]]:
    """Yield a condition for each word: it is part of a name, or an id or a hash begins with it."""
    beginnings = (jobs.c.id, *(c["sha256"].as_string() for c in (jobs.c.source, jobs.c.target)))
    for word in words:
        yield or_(
            jobs.c.search_text.contains(word, autoescape=True),
            *(column.startswith(word, autoescape=True) for column in beginnings),
        )
