"""s3://bucket/key as a URL that is signed with the service's own credentials."""

from __future__ import annotations

import re
from dataclasses import dataclass
from datetime import timedelta
from importlib.util import find_spec
from ipaddress import ip_network
from typing import TYPE_CHECKING

from service.outbound.errors import AddressRefusedError, FetchError
from service.outbound.url_policy import UrlPolicy
from service.outbound.urls import Url, parse_url

if TYPE_CHECKING:
    from obstore.store import S3Config, S3Store

EVERYWHERE = (ip_network("0.0.0.0/0"), ip_network("::/0"))
_ADDRESS = re.compile(r"s3://([a-z0-9][a-z0-9.-]{1,61}[a-z0-9])/([^\x00-\x1f\x7f]+)")
CREDENTIALS_TIMEOUT_S = 5


@dataclass(frozen=True, slots=True)
class S3Rules:
    """Which buckets may be read, where, and in whose name."""

    buckets: tuple[str, ...] = ()
    endpoint: str | None = None
    """Address of a server that speaks S3; None: Amazon's."""
    region: str = "us-east-1"
    access_key_id: str | None = None
    """None: what the AWS_ variables say."""
    secret_access_key: str | None = None


def is_installed() -> bool:
    """Whether the extra `s3` is."""
    return find_spec("obstore") is not None


def check_s3(address: str, rules: S3Rules) -> tuple[str, str]:
    """Bucket and key; AddressRefusedError unless the bucket may be read."""
    found = _ADDRESS.fullmatch(address)
    if found is None:
        raise AddressRefusedError("An S3 address must have the form s3://bucket/key.")
    if found[1] not in rules.buckets:
        raise AddressRefusedError("MPE_S3_BUCKETS does not name that bucket.")
    return found[1], found[2]


def presign(address: str, rules: S3Rules, *, valid_s: float) -> Url:
    """The URL of the object, valid for so long.

    Raises
    ------
    AddressRefusedError
        The bucket may not be read.
    FetchError
        There are no credentials, or the key is not one.
    """
    import obstore

    bucket, key = check_s3(address, rules)
    try:
        url = obstore.sign(_store(bucket, rules), "GET", key, timedelta(seconds=int(valid_s) + 1))
    except (obstore.exceptions.BaseError, TypeError, ValueError) as error:
        raise FetchError(
            "The S3 address could not be signed: its key or the credentials are not valid."
        ) from error
    return parse_url(url)


def policy_for(url: Url, rules: S3Rules) -> UrlPolicy:
    """The signed URL alone; whoever configures an endpoint may have it on a private network."""
    networks = () if rules.endpoint is None else EVERYWHERE
    return UrlPolicy(hosts=(url.host,), ports=(url.port,), networks=networks)


def _store(bucket: str, rules: S3Rules) -> S3Store:
    from obstore.store import S3Store

    config: S3Config = {"region": rules.region}
    if rules.endpoint is not None:
        config["endpoint"] = rules.endpoint
    if rules.access_key_id is not None and rules.secret_access_key is not None:
        config["access_key_id"] = rules.access_key_id
        config["secret_access_key"] = rules.secret_access_key
    return S3Store(
        bucket,
        config=config,
        client_options={"timeout": f"{CREDENTIALS_TIMEOUT_S}s"},
        retry_config={"max_retries": 1},
    )
