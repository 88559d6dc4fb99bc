"""Callbacks are signed as standardwebhooks.com specifies: the official library verifies them."""

from __future__ import annotations

import base64
import json
import time
from typing import Any
from unittest.mock import Mock

import pytest
from pydantic import SecretStr

from service.settings import Settings, WebhookSettings
from service.webhooks.sender import WebhookSender, sign

BODY = json.dumps({"type": "registration.succeeded", "data": {"labels": {"part": "Tür"}}}).encode()
KEY = bytes(range(32))
RAW = "spring tide"


def verify(secret: str, signature: str, *, body: bytes = BODY, delivery_id: str = "msg-1") -> Any:
    from standardwebhooks import Webhook

    headers = {
        "webhook-id": delivery_id,
        "webhook-timestamp": str(int(time.time())),
        "webhook-signature": signature,
    }
    return Webhook(secret).verify(body, headers)


def signature(secret: str) -> str:
    key = WebhookSettings(secret=SecretStr(secret)).signing_key
    return sign(key, "msg-1", int(time.time()), BODY)


@pytest.mark.parametrize(
    ("secret", "given_to_the_library"),
    [
        (f"whsec_{base64.b64encode(KEY).decode()}",) * 2,
        (RAW, base64.b64encode(RAW.encode()).decode()),
    ],
)
def test_the_official_library_verifies_the_signature(
    secret: str, given_to_the_library: str
) -> None:
    assert verify(given_to_the_library, signature(secret)) == json.loads(BODY)


def test_another_message_secret_or_id_does_not_verify() -> None:
    from standardwebhooks import WebhookVerificationError

    secret = f"whsec_{base64.b64encode(KEY).decode()}"
    other = f"whsec_{base64.b64encode(KEY[::-1]).decode()}"
    for changed in ({"body": BODY + b" "}, {"delivery_id": "msg-2"}, {"secret": other}):
        with pytest.raises(WebhookVerificationError):
            verify(**{"secret": secret, "signature": signature(secret)} | changed)  # type: ignore[arg-type]


class SlowOutbox:
    """One in which so many calls wait that it takes long to see that none may be sent."""

    looks = 0

    def claim(self, free: int) -> None:
        self.looks += 1
        time.sleep(0.05)


def test_a_long_look_in_vain_is_not_repeated_at_once() -> None:
    outbox: Any = SlowOutbox()
    sender = WebhookSender(Mock(), outbox, Settings())
    assert [sender._claim(), sender._claim()] == [None, None]
    assert outbox.looks == 1
    sender._count_free(+1)  # it may send now
    sender._claim()
    assert outbox.looks == 2
