"""A cloud's URL, of any scheme that is fetched: what is allowed, and fetching it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

from service.outbound.client import OutboundClient
from service.outbound.deadline import TransferLimits
from service.outbound.download import Download
from service.outbound.errors import AddressRefusedError
from service.outbound.http_cache import HttpCache
from service.outbound.s3 import S3Rules, check_s3, policy_for, presign
from service.outbound.url_policy import UrlPolicy, check_url
from service.outbound.urls import parse_url
from service.settings import Settings
from service.storage.blobs import Blob, BlobStore

S3_PREFIX = "s3://"


@dataclass(frozen=True, slots=True)
class FetchRules:
    """What may be fetched, how much, and for how long."""

    enabled: bool
    web: UrlPolicy
    s3: S3Rules
    bounds: TransferLimits
    max_bytes: int

    @classmethod
    def of(cls, settings: Settings) -> Self:
        """What the settings say."""
        secret = settings.s3_secret_access_key
        return cls(
            enabled=settings.url_fetching,
            web=UrlPolicy(
                hosts=settings.url_hosts,
                ports=settings.url_ports,
                networks=settings.private_networks,
            ),
            s3=S3Rules(
                buckets=settings.s3_buckets,
                endpoint=settings.s3_endpoint,
                region=settings.s3_region,
                access_key_id=settings.s3_access_key_id,
                secret_access_key=None if secret is None else secret.get_secret_value(),
            ),
            bounds=TransferLimits(
                settings.url_timeout_s, settings.url_stall_s, settings.url_min_bytes_s
            ),
            max_bytes=settings.max_body_bytes,
        )


def callback_rules(settings: Settings) -> UrlPolicy:
    """What may be called when a registration has ended."""
    return UrlPolicy(
        hosts=settings.webhook_hosts,
        hosts_setting="MPE_WEBHOOK_HOSTS",
        ports=settings.url_ports,
        networks=settings.private_networks,
    )


def check_callback(url: str, settings: Settings) -> None:
    """AddressRefusedError unless the URL may be called, as far as that shows without calling."""
    if not settings.webhook_hosts:
        raise AddressRefusedError("This service calls nobody: MPE_WEBHOOK_HOSTS names no host.")
    check_url(parse_url(url), callback_rules(settings))


def check_source(url: str, rules: FetchRules) -> None:
    """AddressRefusedError unless the URL may be fetched, as far as that shows without calling."""
    if not rules.enabled:
        raise AddressRefusedError("This service fetches no URLs: MPE_URL_FETCHING is off.")
    if url.startswith(S3_PREFIX):
        check_s3(url, rules.s3)
    else:
        check_url(parse_url(url), rules.web)


def fetch(url: str, rules: FetchRules, blobs: BlobStore, known: HttpCache) -> Blob:
    """Store what the URL gives.

    Raises
    ------
    AddressRefusedError
        It may not be fetched.
    FetchError
        It could not be had; the subclass says why.
    """
    check_source(url, rules)
    name = None
    if url.startswith(S3_PREFIX):
        place = presign(url, rules.s3, valid_s=rules.bounds.total_s)
        web, name = policy_for(place, rules.s3), f"{rules.s3.endpoint} {url}"
    else:
        place, web = parse_url(url), rules.web
    download = Download(
        OutboundClient(web), blobs, known, bounds=rules.bounds, max_bytes=rules.max_bytes
    )
    return download.run(place, name)
