"""What a search for jobs finds, on both databases."""

from __future__ import annotations

import pytest

from service.clouds.inputs import CloudInput
from service.database.engine import Database
from service.database.tables import jobs
from service.jobs.queries import JobFilter, JobQueries
from service.jobs.search import MAX_WORDS, split_words
from service.jobs.transitions import JobTransitions
from tests.factories.jobs import CLOUD, TENANT, add

SIGNED = CloudInput(url="https://user:pa55@scans.example/Hall-3/scan.e57?signature=s3cret#top")
STORED = CloudInput(sha256="c0ffee", size=1, cloud="fan-blade")


def found(queries: JobQueries, search: str, **pages: object) -> list[str]:
    only = JobFilter(words=split_words(search))
    return [job.id for job in queries.page(TENANT, limit=9, only=only, **pages)]  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("search", "is_found"),
    [
        ("", True),
        ("TÜR 7_l", True),
        ("stra\N{LATIN SMALL LETTER SHARP S}e", True),
        ("STRASSE", True),
        ("u\N{COMBINING DIAERESIS}r", True),
        ("hall-3/scan", True),
        ("fan-blade", True),
        ("C0FF", True),
        ("0ffee", False),
        ("s3cret", False),
        ("pa55", False),
        ("tür roof", False),
        ("source", False),
        ("%", False),
        ("7%l", False),
        ("7.l", False),
        ("\\", False),
    ],
)
def test_each_word_is_found_in_a_name_or_begins_an_id(
    transitions: JobTransitions, queries: JobQueries, search: str, is_found: bool
) -> None:
    labels = {"source": "Tür_7_LINKS.ply", "place": "Hauptstraße"}
    job = add(transitions, labels=labels, source=SIGNED, target=STORED)
    assert (found(queries, search) == [job.id]) == is_found


def test_it_finds_by_id_within_the_tenant_page_by_page(
    transitions: JobTransitions, queries: JobQueries
) -> None:
    add(transitions, labels={"part": "roof"})
    doors = [add(transitions, labels={"part": "door"}, created_at=1e9 + n).id for n in range(3)]
    add(transitions, labels={"part": "door"}, tenant="other")
    assert found(queries, "door") == doors[::-1]
    assert found(queries, "door", before=(1e9 + 2, doors[2])) == doors[1::-1]
    assert found(queries, doors[1][:13].upper()) == [doors[1]]
    assert found(queries, f"door {doors[1]}") == [doors[1]]
    only = JobFilter(status="running", words=("door",))
    assert queries.page(TENANT, limit=9, only=only) == []


def test_jobs_of_the_release_before_are_found_by_id(database: Database) -> None:
    """A service of it may run beside this one, and does not fill the column."""
    row = {"id": "a1", "tenant": TENANT, "status": "queued", "queue": "register", "created_at": 1}
    row |= {"attempt": 0, "lost_attempts": 0, "interruptions": 0, "stage": "queued", "fraction": 0}
    row |= {"source": {"sha256": CLOUD.sha256}, "target": {"sha256": CLOUD.sha256}, "options": {}}
    row |= {"timing": {}, "warnings": [], "labels": {}, "priority": 0, "cached": False}
    with database.write() as connection:
        connection.execute(jobs.insert(), row)
    assert found(JobQueries(database), "a1") == found(JobQueries(database), "AB") == ["a1"]


def test_words_are_counted_once_and_not_many() -> None:
    assert split_words(" Door\tdoor  roof ") == ("door", "roof")
    many = " ".join(map(str, range(MAX_WORDS)))
    assert len(split_words(many)) == MAX_WORDS
    with pytest.raises(ValueError, match=f"at most {MAX_WORDS} words, not {MAX_WORDS + 1}"):
        split_words(f"{many} more")
