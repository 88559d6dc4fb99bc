"""The parts of a running service."""

from __future__ import annotations

from dataclasses import dataclass, field

from service.clouds.store import CloudStore
from service.auth.authenticator import Gate
from service.jobs.idempotency import KeysInFlight
from service.jobs.notifier import Changes
from service.database.engine import Database
from service.webhooks.outbox import DeliveryStore
from service.workers.pool import Queue
from service.jobs.store import JobStore
from service.auth.rate_limit import RateLimit
from service.settings import Settings
from service.auth.quotas import Shares
from service.storage.blobs import BlobStore
from service.telemetry.recorder import Telemetry
from service.clouds.uploads import UploadStore


@dataclass(frozen=True, slots=True)
class Service:
    """What the routes work with."""

    settings: Settings
    database: Database
    blobs: BlobStore
    store: JobStore
    queue: Queue
    changes: Changes
    deliveries: DeliveryStore
    clouds: CloudStore
    uploads: UploadStore
    telemetry: Telemetry
    gate: Gate
    shares: Shares
    rate_limit: RateLimit = field(default_factory=RateLimit)
    keys_in_flight: KeysInFlight = field(default_factory=KeysInFlight)
