"""s3://bucket/key as a URL presigned with the service's credentials."""

from __future__ import annotations

import re
from datetime import timedelta
from ipaddress import ip_network
from typing import TYPE_CHECKING

from service.outbound.errors import AddressRefusedError, FetchError
from service.outbound.url_policy import UrlPolicy
from service.outbound.urls import Url, parse_url
from service.settings import S3Settings

if TYPE_CHECKING:
    from obstore.store import S3Config, S3Store

ALL_NETWORKS = (ip_network("0.0.0.0/0"), ip_network("::/0"))
CREDENTIALS_TIMEOUT_S = 5
"""Time limit of asking the machine's metadata service for credentials, in seconds."""
_ADDRESS = re.compile(r"s3://([a-z0-9][a-z0-9.-]{1,61}[a-z0-9])/([^\x00-\x1f\x7f]+)")


def check_s3(address: str, settings: S3Settings) -> tuple[str, str]:
    """Split an S3 address into bucket and key.

    Raises
    ------
    AddressRefusedError
        It is not of the form s3://bucket/key, or the bucket is not allowed.
    """
    match = _ADDRESS.fullmatch(address)
    if match is None:
        raise AddressRefusedError("An S3 address must have the form s3://bucket/key.")
    if match[1] not in settings.buckets:
        raise AddressRefusedError("MPE_S3_BUCKETS does not name that bucket.")
    return match[1], match[2]


def presign(address: str, settings: S3Settings, *, valid_s: float) -> Url:
    """Return a URL that gives the object without further credentials for `valid_s` seconds.

    Raises
    ------
    AddressRefusedError
        The address is not valid, or its bucket is not allowed.
    FetchError
        There are no valid credentials, or the object's key is not valid.
    """
    import obstore

    bucket, key = check_s3(address, settings)
    validity = timedelta(seconds=int(valid_s) + 1)
    try:
        url = obstore.sign(_store(bucket, settings), "GET", key, validity)
    except (obstore.exceptions.BaseError, TypeError, ValueError) as error:
        raise FetchError(
            "The S3 address could not be signed: its key or the service's credentials are not "
            "valid."
        ) from error
    return parse_url(url)


def policy_for(url: Url, settings: S3Settings) -> UrlPolicy:
    """Return a policy that allows the host of a presigned URL only.

    An endpoint that the operator configured may be on a private network.
    """
    networks = () if settings.endpoint is None else ALL_NETWORKS
    return UrlPolicy(hosts=(url.host,), ports=(url.port,), networks=networks)


def _store(bucket: str, settings: S3Settings) -> S3Store:
    from obstore.store import S3Store

    config: S3Config = {"region": settings.region}
    if settings.endpoint is not None:
        config["endpoint"] = settings.endpoint
    if settings.access_key_id is not None and settings.secret_access_key is not None:
        config["access_key_id"] = settings.access_key_id
        config["secret_access_key"] = settings.secret_access_key.get_secret_value()
    return S3Store(
        bucket,
        config=config,
        client_options={"timeout": f"{CREDENTIALS_TIMEOUT_S}s"},
        retry_config={"max_retries": 1},
    )
