"""Sends the deliveries that are due, signed, until each has come through or tries are used up."""

from __future__ import annotations

import base64
import hashlib
import hmac
import json
import logging
import random
import threading
import time
from typing import Any

from service.jobs.model import JobRow
from service.jobs.queries import JobQueries
from service.outbound import (
    OutboundClient,
    TransferDeadline,
    TransferLimits,
    callback_rules,
    parse_url,
)
from service.problems import ServiceError
from service.schemas.serialize_job import summarize_job
from service.settings import Settings
from service.webhooks.outbox import Delivery, Outbox

SENDERS = 4
POLL_S = 0.5
BOUNDS = TransferLimits(total_s=10, stall_s=10)
MAX_DELAY_S = 3600.0

log = logging.getLogger(__name__)


def sign(secret: bytes, delivery_id: str, timestamp: int, body: bytes) -> str:
    """Signature in the form of standardwebhooks.com: base64 of HMAC-SHA256 over id.time.body."""
    message = f"{delivery_id}.{timestamp}.".encode() + body
    digest = hmac.new(secret, message, hashlib.sha256).digest()
    return f"v1,{base64.b64encode(digest).decode()}"


class WebhookSender:
    """Threads that send what is due; nothing is lost when they are killed in the middle."""

    def __init__(self, jobs: JobQueries, deliveries: Outbox, settings: Settings) -> None:
        self._jobs = jobs
        self._deliveries = deliveries
        self._settings = settings
        self._door = OutboundClient(callback_rules(settings))
        self._stopping = threading.Event()
        self._threads = [
            threading.Thread(target=self._serve, name=f"webhooks-{i}", daemon=True)
            for i in range(SENDERS)
        ]

    def start(self) -> None:
        """Begin; nothing happens unless callbacks are allowed."""
        if self._settings.webhook_hosts:
            self._deliveries.release()
            for thread in self._threads:
                thread.start()

    def stop(self) -> None:
        """Begin nothing more; what is being sent is sent again after the next start."""
        self._stopping.set()

    def _serve(self) -> None:
        while not self._stopping.is_set():
            try:
                delivery = self._deliveries.claim()
                if delivery is None:
                    self._stopping.wait(POLL_S)
                else:
                    self._send(delivery)
            except Exception:
                log.exception("a webhook thread met an unexpected error and goes on")
                self._stopping.wait(POLL_S)

    def _send(self, delivery: Delivery) -> None:
        job = self._jobs.get_unscoped(delivery.job_id)
        if job is None:
            return  # removed meanwhile, and its deliveries with it
        tried = self._post(delivery, job)
        code = tried["status_code"]
        if code is not None and 200 <= code < 300:
            self._deliveries.tried(delivery, tried, "delivered", None)
        elif len(delivery.tries) + 1 >= self._settings.webhook_tries:
            self._deliveries.tried(delivery, tried, "failed", None)
        else:
            next_at = time.time() + self._delay(len(delivery.tries))
            self._deliveries.tried(delivery, tried, "pending", next_at)

    def _delay(self, tries: int) -> float:
        """Seconds to the next try: doubled each time, and not the same for all."""
        exact: float = min(MAX_DELAY_S, self._settings.webhook_retry_s * 2**tries)
        return exact * random.uniform(0.8, 1.2)  # noqa: S311

    def _post(self, delivery: Delivery, job: JobRow) -> dict[str, Any]:
        assert job.callback_url is not None  # noqa: S101
        assert self._settings.webhook_secret is not None  # noqa: S101
        now = time.time()
        event = {
            "type": f"registration.{job.status}",
            "data": summarize_job(job).model_dump(mode="json"),
        }
        body = json.dumps(event).encode()
        secret = self._settings.webhook_secret.get_secret_value().encode()
        headers = {
            "Content-Type": "application/json",
            "Webhook-Id": delivery.id,
            "Webhook-Timestamp": str(int(now)),
            "Webhook-Signature": sign(secret, delivery.id, int(now), body),
        }
        try:
            url, watch = parse_url(job.callback_url), TransferDeadline(BOUNDS)
            # the answer's body is of no interest, and may be endless
            with self._door.call("POST", url, watch, headers=headers, content=body) as answer:
                return {"at": now, "status_code": answer.status, "error": None}
        except ServiceError as error:
            return {"at": now, "status_code": None, "error": str(error)}
