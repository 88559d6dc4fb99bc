"""One HTTP call to a URL that a caller gave."""

from __future__ import annotations

import ssl
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from importlib.metadata import version

import httpcore

from service.outbound.deadline import TransferDeadline
from service.outbound.errors import (
    FetchCutError,
    FetchError,
    FetchTooSlowError,
    FetchUnreachableError,
)
from service.outbound.transport import GuardedBackend, Resolver, system_resolver
from service.outbound.url_policy import UrlPolicy, check_url
from service.outbound.urls import Url


@dataclass(frozen=True, slots=True)
class OutboundResponse:
    """What the server says; valid until the call is left."""

    url: Url
    status: int
    headers: dict[str, str]
    """Names in lower case."""
    chunks: Iterator[bytes]
    """The body, still encoded as the server encoded it."""


class OutboundClient:
    """Calls what the rules allow: no proxies, no cookies, no credentials, no redirects."""

    def __init__(
        self,
        rules: UrlPolicy,
        *,
        resolve: Resolver = system_resolver,
        tls: ssl.SSLContext | None = None,
    ) -> None:
        self._rules = rules
        self._resolve = resolve
        self._tls = tls

    @contextmanager
    def call(
        self,
        method: str,
        url: Url,
        watch: TransferDeadline,
        *,
        headers: dict[str, str],
        content: bytes | None = None,
    ) -> Iterator[OutboundResponse]:
        """Send the request and give the answer, its body still to be read.

        Raises
        ------
        AddressRefusedError
            The rules do not allow the URL.
        FetchError
            There is no answer, or its body is cut; the subclass says why.
        """
        check_url(url, self._rules)
        place = httpcore.URL(
            scheme=url.scheme, host=url.host, port=url.port, target=url.target.encode()
        )
        plain = {"Host": url.authority, "User-Agent": f"mpe/{version('mpe')}", "Accept": "*/*"}
        with (
            _explained(),
            httpcore.ConnectionPool(
                ssl_context=(self._tls or _authorities()) if url.scheme == "https" else None,
                network_backend=GuardedBackend(self._rules, self._resolve, watch),
            ) as pool,
            pool.stream(
                method, place, headers=list((plain | headers).items()), content=content
            ) as response,
        ):
            said = {k.decode("latin-1").lower(): v.decode("latin-1") for k, v in response.headers}
            yield OutboundResponse(url, response.status, said, response.iter_stream())


@cache
def _authorities() -> ssl.SSLContext:
    """The system's certificate authorities (SSL_CERT_FILE adds others), and certifi's."""
    return httpcore.default_ssl_context()


@contextmanager
def _explained() -> Iterator[None]:
    """Say what went wrong in terms of the URL; neither addresses nor queries are named."""
    try:
        yield
    except httpcore.TimeoutException as error:
        raise FetchTooSlowError("The server did not answer, or go on, in time.") from error
    except httpcore.ConnectError as error:
        raise FetchUnreachableError("The server cannot be reached.") from error
    except (httpcore.ReadError, httpcore.WriteError, httpcore.RemoteProtocolError) as error:
        raise FetchCutError("The connection ended before the whole file was here.") from error
    except (httpcore.ProtocolError, httpcore.UnsupportedProtocol) as error:
        raise FetchError("The server does not speak HTTP as it should.") from error
