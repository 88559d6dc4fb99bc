"""The tables of this release; `service.database.migrations` brings older databases up to date.

The migrations repeat the columns, because they must not change with this module.
"""

from __future__ import annotations

from sqlalchemy import (
    JSON,
    BigInteger,
    Boolean,
    Column,
    Float,
    ForeignKey,
    Index,
    Integer,
    MetaData,
    String,
    Table,
)

metadata = MetaData()

# who may call; a key that was revoked stays, so that a service with keys never opens again
api_keys = Table(
    "api_keys",
    metadata,
    Column("id", String, primary_key=True),
    Column("tenant", String, nullable=False),
    Column("name", String, nullable=False),
    Column("secret_sha256", String, nullable=False),
    Column("created_at", Float, nullable=False),
    Column("revoked_at", Float),
    # limits of this key; null: those of the settings
    Column("requests_per_s", Float),
    Column("queue_limit", Integer),
    Column("stored_bytes", BigInteger),
)

jobs = Table(
    "jobs",
    metadata,
    Column("id", String, primary_key=True),
    Column("tenant", String, nullable=False),
    Column("status", String, nullable=False),
    # who works on it next: fetch (its clouds are URLs) or register
    Column("queue", String, nullable=False),
    # times: seconds since the epoch, UTC
    Column("created_at", Float, nullable=False),
    Column("started_at", Float),
    Column("finished_at", Float),
    # the attempt number is the fencing token: a worker writes only `WHERE attempt = its own`
    Column("attempt", Integer, nullable=False),
    # attempts that ended without an answer
    Column("lost_attempts", Integer, nullable=False),
    Column("lease_until", Float),
    Column("stage", String, nullable=False),
    Column("fraction", Float, nullable=False),
    Column("source", JSON, nullable=False),
    Column("target", JSON, nullable=False),
    Column("options", JSON, nullable=False),
    Column("timing", JSON, nullable=False),
    Column("warnings", JSON, nullable=False),
    Column("error", JSON),
    Column("result_sha256", String),
    Column("inliers_sha256", String),
    # of the two together
    Column("result_bytes", BigInteger),
    Column("confidence", Float),
    Column("labels", JSON, nullable=False),
    # names of labels, clouds and URLs, folded; the default is for services of the release before
    Column("search_text", String, nullable=False, server_default=""),
    # the highest of a tenant goes first
    Column("priority", Integer, nullable=False),
    Column("deadline_at", Float),
    # hash of clouds, options and release: equal keys mean equal results
    Column("work_key", String),
    Column("cached", Boolean, nullable=False),
    Column("callback_url", String),
    # when the result and the clouds are dropped, and when the job itself is
    Column("result_expires_at", Float),
    Column("expires_at", Float),
    # attempts that ended for a reason outside of the job; the queued job waits until then
    Column("interruptions", Integer, nullable=False),
    Column("paused_until", Float),
)
Index("jobs_by_age", jobs.c.tenant, jobs.c.created_at, jobs.c.id)
# of a tenant: the next job of a queue, and the jobs of a status
_OF_QUEUE = (jobs.c.tenant, jobs.c.queue, jobs.c.status)
Index("jobs_by_turn", *_OF_QUEUE, jobs.c.priority.desc(), jobs.c.created_at, jobs.c.id)
Index("jobs_by_status", jobs.c.tenant, jobs.c.status, jobs.c.created_at, jobs.c.id)
# of all tenants
Index("jobs_by_age_of_all", jobs.c.status, jobs.c.created_at)
Index("jobs_by_deadline", jobs.c.status, jobs.c.deadline_at)
Index("jobs_by_work", jobs.c.work_key)

# when each tenant was served last, in claims of all tenants from one queue of jobs or callbacks; 0:
# never. Each tenant that has had a job in a queue has a row
turns = Table(
    "turns",
    metadata,
    Column("tenant", String, primary_key=True),
    Column("queue", String, primary_key=True),
    Column("turn", BigInteger, nullable=False),
)

# every change of a job's row, in order
events = Table(
    "events",
    metadata,
    Column("job_id", String, ForeignKey(jobs.c.id, ondelete="CASCADE"), primary_key=True),
    Column("number", Integer, primary_key=True),
    Column("at", Float, nullable=False),
    Column("status", String, nullable=False),
    Column("stage", String, nullable=False),
    Column("fraction", Float, nullable=False),
)

# calls to callback_url, written in the same transaction as the end that they tell of
deliveries = Table(
    "deliveries",
    metadata,
    Column("id", String, primary_key=True),
    Column("job_id", String, ForeignKey(jobs.c.id, ondelete="CASCADE"), nullable=False),
    # of the job, and of its callback_url
    Column("tenant", String, nullable=False),
    Column("host", String, nullable=False),
    Column("status", String, nullable=False),
    Column("created_at", Float, nullable=False),
    Column("next_at", Float),
    # one object for each try: at, status_code, error
    Column("tries", JSON, nullable=False),
)
Index("deliveries_due", deliveries.c.status, deliveries.c.next_at)
Index("deliveries_by_job", deliveries.c.job_id)

idempotency_keys = Table(
    "idempotency_keys",
    metadata,
    Column("tenant", String, primary_key=True),
    Column("key", String, primary_key=True),
    # hash of the request that came with the key first
    Column("fingerprint", String, nullable=False),
    Column("job_id", String, ForeignKey(jobs.c.id, ondelete="CASCADE"), nullable=False),
)
Index("idempotency_by_job", idempotency_keys.c.job_id)

# clouds that registrations refer to by id
clouds = Table(
    "clouds",
    metadata,
    Column("tenant", String, primary_key=True),
    Column("id", String, primary_key=True),
    Column("sha256", String, nullable=False),
    Column("size", BigInteger, nullable=False),
    Column("format", String, nullable=False),
    # whether the caller said so; else the content did
    Column("declared", Boolean, nullable=False),
    Column("created_at", Float, nullable=False),
    Column("expires_at", Float, nullable=False),
)
Index("clouds_by_age", clouds.c.tenant, clouds.c.created_at, clouds.c.id)

# registrations that each service can run at once; one that is gone extends its lease no more
worker_slots = Table(
    "worker_slots",
    metadata,
    Column("service", String, primary_key=True),
    Column("number", Integer, nullable=False),
    Column("lease_until", Float, nullable=False),
    # of its workers; the default is for services of the release before, which run meanwhile
    Column("labels", JSON, nullable=False, server_default="[]"),
)

# uploads in pieces; how far one is, is the length of its file, or of its pieces in a bucket
uploads = Table(
    "uploads",
    metadata,
    Column("id", String, primary_key=True),
    Column("tenant", String, nullable=False),
    Column("length", BigInteger, nullable=False),
    Column("is_complete", Boolean, nullable=False),
    Column("expires_at", Float, nullable=False),
    # as declared by the caller
    Column("format", String),
    # of uploads whose pieces are blobs: their length together, and hash and length of each
    Column("received", BigInteger, nullable=False),
    Column("pieces", JSON, nullable=False),
    # of uploads that go to the bucket directly: hash of the file, as announced
    Column("sha256", String),
)
