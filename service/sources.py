"""Fetching a cloud from a URL, in the worker, from the hosts that the settings name."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Self
from urllib.parse import urlsplit

import httpx

from service.problems import AddressRefusedError, FetchError
from service.settings import Settings
from service.storage import Blob, BlobStore

CHUNK_BYTES = 1 << 16


@dataclass(frozen=True, slots=True)
class FetchRules:
    """Where from, how much and for how long may be fetched."""

    hosts: tuple[str, ...]
    max_bytes: int
    timeout_s: float

    @classmethod
    def of(cls, settings: Settings) -> Self:
        """What the settings say about fetching."""
        return cls(settings.url_hosts, settings.max_body_bytes, settings.url_timeout_s)


def check_address(url: str, hosts: tuple[str, ...], variable: str) -> None:
    """AddressRefusedError unless the URL is http(s), without userinfo, on one of the hosts.

    `variable` is the setting that names the hosts.
    """
    parts = urlsplit(url)
    if not hosts:
        raise AddressRefusedError(f"This service calls no URLs: {variable} names no host.")
    if parts.scheme not in ("http", "https") or parts.username is not None:
        raise AddressRefusedError("A URL must be http or https and name no user.")
    if (parts.hostname or "").lower() not in hosts:
        raise AddressRefusedError(f"{variable} does not name that host.")


def fetch(url: str, rules: FetchRules, blobs: BlobStore) -> Blob:
    """Store what the URL answers; FetchError says why it could not be had."""
    check_address(url, rules.hosts, "MPE_URL_HOSTS")
    try:
        return _stream(url, rules, blobs)
    except httpx.TimeoutException as error:
        raise FetchError(f"The URL did not answer within {rules.timeout_s:g} s.") from error
    except httpx.HTTPError as error:
        raise FetchError(f"The URL could not be fetched: {type(error).__name__}.") from error


def _stream(url: str, rules: FetchRules, blobs: BlobStore) -> Blob:
    deadline = time.monotonic() + rules.timeout_s
    client = httpx.Client(trust_env=False, follow_redirects=False, timeout=rules.timeout_s)
    plain = {"Accept-Encoding": "identity"}
    with client, client.stream("GET", url, headers=plain) as response, blobs.writer() as writer:
        if response.status_code != httpx.codes.OK:
            raise FetchError(f"The URL answered {response.status_code} instead of 200.")
        for chunk in response.iter_raw(CHUNK_BYTES):
            writer.write(chunk)
            if writer.size > rules.max_bytes:
                raise FetchError(f"The URL gives more than the allowed {rules.max_bytes} bytes.")
            if time.monotonic() > deadline:
                raise FetchError(f"The URL was not read within {rules.timeout_s:g} s.")
        return writer.commit()
