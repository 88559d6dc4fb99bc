"""Threads that send the deliveries that are due, signed as standardwebhooks.com specifies."""

from __future__ import annotations

import base64
import hashlib
import hmac
import json
import logging
import random
import threading
import time
from collections.abc import Callable
from http import HTTPStatus
from typing import Any

from service.jobs.model import JobRow
from service.jobs.queries import JobQueries
from service.outbound import (
    OutboundClient,
    TransferDeadline,
    TransferLimits,
    callback_policy,
    parse_url,
)
from service.problems import NotReadyError, ServiceError
from service.schemas.serialize_job import summarize_job
from service.settings import Settings
from service.webhooks.outbox import DeliveryRow, Outbox

THREADS = 8
POLL_INTERVAL_S = 0.5
MAX_LOOKING_SHARE = 0.1
"""Share of the time in which the threads look for a delivery in vain: that takes long where very
many are due, to hosts that do not answer (docs/tuning.md)."""
LIMITS = TransferLimits(total_s=10, read_timeout_s=10)
MAX_BACKOFF_S = 3600.0
JITTER = (0.8, 1.2)
"""Range of the random factor of each pause, so that not all callbacks are repeated at once."""

log = logging.getLogger(__name__)


def sign(key: bytes, delivery_id: str, timestamp: int, body: bytes) -> str:
    """Return the value of the Webhook-Signature header.

    Parameters
    ----------
    key : bytes
        Key of the HMAC; of a secret `whsec_...`, what its base64 decodes to.
    delivery_id : str
        Value of the Webhook-Id header.
    timestamp : int
        Value of the Webhook-Timestamp header, in seconds since the epoch.
    body : bytes
        Body of the request.
    """
    message = f"{delivery_id}.{timestamp}.".encode() + body
    digest = hmac.new(key, message, hashlib.sha256).digest()
    return f"v1,{base64.b64encode(digest).decode()}"


class WebhookSender:
    """Send due deliveries until each succeeds or its attempts are used up.

    A process that is killed loses nothing: what it was sending is sent again. Deliveries therefore
    arrive at least once.

    Parameters
    ----------
    is_leader : callable
        Whether this process sends those of all now.
    """

    def __init__(
        self,
        jobs: JobQueries,
        outbox: Outbox,
        settings: Settings,
        *,
        is_leader: Callable[[], bool] = lambda: True,
    ) -> None:
        self._jobs = jobs
        self._outbox = outbox
        self._settings = settings.webhook
        self._client = OutboundClient(callback_policy(settings))
        self._is_leader = is_leader
        self._stopping = threading.Event()
        self._free = THREADS
        self._look_again_at = 0.0
        self._lock = threading.Lock()
        self._threads = [
            threading.Thread(target=self._run, name=f"webhooks-{i}", daemon=True)
            for i in range(THREADS)
        ]

    def start(self) -> None:
        """Start the threads, if callbacks are enabled."""
        if self._settings.hosts:
            self._outbox.requeue_interrupted()
            for thread in self._threads:
                thread.start()

    def stop(self) -> None:
        """Start no further attempt; one that is interrupted is repeated after the next start."""
        self._stopping.set()

    def _run(self) -> None:
        while not self._stopping.is_set():
            try:
                delivery = self._claim() if self._is_leader() else None
                if delivery is None:
                    self._stopping.wait(POLL_INTERVAL_S)
                    continue
                try:
                    self._send(delivery)
                finally:
                    self._count_free(+1)
            except NotReadyError as error:  # the call is made again after SENDING_TIMEOUT_S
                log.warning("a webhook thread waits: %s", error)
                self._stopping.wait(POLL_INTERVAL_S)
            except Exception:
                log.exception("unexpected error in a webhook thread; it continues")
                self._stopping.wait(POLL_INTERVAL_S)

    def _claim(self) -> DeliveryRow | None:
        with self._lock:  # for the number of free threads
            began_at = time.monotonic()
            if began_at < self._look_again_at:
                return None
            delivery = self._outbox.claim(self._free)
            self._free -= delivery is not None
            if delivery is None:
                took_s = time.monotonic() - began_at
                self._look_again_at = began_at + took_s / MAX_LOOKING_SHARE
        return delivery

    def _count_free(self, change: int) -> None:
        with self._lock:
            self._free += change
            self._look_again_at = 0.0

    def _send(self, delivery: DeliveryRow) -> None:
        job = self._jobs.get_unscoped(delivery.job_id)
        if job is None:
            return  # removed meanwhile, and its deliveries with it
        attempt = self._post(delivery, job)
        code = attempt["status_code"]
        if code is not None and HTTPStatus.OK <= code < HTTPStatus.MULTIPLE_CHOICES:
            self._outbox.record_attempt(delivery, attempt, "delivered")
        elif len(delivery.tries) + 1 >= self._settings.max_attempts:
            self._outbox.record_attempt(delivery, attempt, "failed")
        else:
            pause_s = self._backoff_s(len(delivery.tries))
            self._outbox.record_attempt(delivery, attempt, "pending", pause_s)

    def _backoff_s(self, attempts: int) -> float:
        """Return the seconds until the next attempt: doubled each time, with jitter."""
        exact: float = min(MAX_BACKOFF_S, self._settings.backoff_s * 2**attempts)
        return exact * random.uniform(*JITTER)  # noqa: S311

    def _post(self, delivery: DeliveryRow, job: JobRow) -> dict[str, Any]:
        """Send the message once; return the attempt as it is recorded."""
        assert job.callback_url is not None  # noqa: S101
        now = time.time()
        event = {
            "type": f"registration.{job.status}",
            "data": summarize_job(job).model_dump(mode="json"),
        }
        body = json.dumps(event).encode()
        headers = {
            "Content-Type": "application/json",
            "Webhook-Id": delivery.id,
            "Webhook-Timestamp": str(int(now)),
            "Webhook-Signature": sign(self._settings.signing_key, delivery.id, int(now), body),
        }
        try:
            url, deadline = parse_url(job.callback_url), TransferDeadline(LIMITS)
            # the response's body is not needed, and may be endless
            with self._client.request("POST", url, deadline, headers=headers, content=body) as got:
                return {"at": now, "status_code": got.status, "error": None}
        except ServiceError as error:
            return {"at": now, "status_code": None, "error": str(error)}
