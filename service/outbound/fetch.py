"""Fetching a cloud from an http, https or s3 URL."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Self

from service.outbound.client import OutboundClient
from service.outbound.deadline import TransferLimits
from service.outbound.download import Download, download
from service.outbound.errors import AddressRefusedError
from service.outbound.http_cache import HttpCache
from service.outbound.ip_policy import Network
from service.outbound.s3 import check_s3, policy_for, presign
from service.outbound.url_policy import UrlPolicy, check_url
from service.outbound.urls import parse_url
from service.settings import S3Settings, Settings, UrlSettings

S3_SCHEME = "s3://"


@dataclass(frozen=True, slots=True)
class FetchPolicy:
    """What may be fetched, how much, and for how long."""

    url: UrlSettings
    s3: S3Settings
    private_networks: tuple[Network, ...]
    max_bytes: int

    @classmethod
    def of(cls, settings: Settings) -> Self:
        """Select the settings that matter."""
        return cls(settings.url, settings.s3, settings.private_networks, settings.max_body_bytes)

    @property
    def web(self) -> UrlPolicy:
        """Policy of http and https URLs."""
        return UrlPolicy(self.url.hosts, ports=self.url.ports, networks=self.private_networks)

    @property
    def limits(self) -> TransferLimits:
        """Time limits of one cloud."""
        return TransferLimits(self.url.timeout_s, self.url.read_timeout_s, self.url.min_bytes_per_s)


def callback_policy(settings: Settings) -> UrlPolicy:
    """Return the policy of callbacks at the end of registrations."""
    return UrlPolicy(
        settings.webhook.hosts,
        hosts_setting="MPE_WEBHOOK_HOSTS",
        ports=settings.url.ports,
        networks=settings.private_networks,
    )


def check_callback(url: str, settings: Settings) -> None:
    """Check a callback URL without resolving its host.

    Raises
    ------
    AddressRefusedError
        The URL may not be called.
    """
    if not settings.webhook.hosts:
        raise AddressRefusedError(
            "Callbacks are disabled: MPE_WEBHOOK_HOSTS names no host. Omit callback_url."
        )
    check_url(parse_url(url), callback_policy(settings))


def check_source(url: str, policy: FetchPolicy) -> None:
    """Check the URL of a cloud without resolving its host.

    Raises
    ------
    AddressRefusedError
        The URL may not be fetched.
    """
    if not policy.url.fetching:
        raise AddressRefusedError(
            "Fetching from URLs is disabled: MPE_URL_FETCHING is off. Upload the cloud instead."
        )
    if url.startswith(S3_SCHEME):
        check_s3(url, policy.s3)
    else:
        check_url(parse_url(url), policy.web)


def fetch(url: str, policy: FetchPolicy, output: Path, cache: HttpCache) -> Download:
    """Write the file at the URL of a cloud to `output`, unless the cached one is still current.

    Raises
    ------
    AddressRefusedError
        The URL may not be fetched.
    FetchError
        It could not be fetched; the subclass tells why.
    """
    check_source(url, policy)
    cache_key = None
    if url.startswith(S3_SCHEME):
        location = presign(url, policy.s3, valid_s=policy.limits.total_s)
        web, cache_key = policy_for(location, policy.s3), f"{policy.s3.endpoint} {url}"
    else:
        location, web = parse_url(url), policy.web
    return download(
        OutboundClient(web),
        location,
        output,
        cache,
        limits=policy.limits,
        max_bytes=policy.max_bytes,
        cache_key=cache_key,
    )
