"""HTTP client for URLs that callers gave."""

from __future__ import annotations

import ssl
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from importlib.metadata import version
from urllib.parse import urljoin

import httpcore

from service.outbound.deadline import TransferDeadline
from service.outbound.errors import (
    AddressRefusedError,
    FetchCutError,
    FetchError,
    FetchTooSlowError,
    FetchUnreachableError,
)
from service.outbound.transport import GuardedBackend, Resolver, system_resolver
from service.outbound.url_policy import UrlPolicy, check_url
from service.outbound.urls import Url, parse_url

MAX_REDIRECTS = 5
REDIRECT_STATUSES = (301, 302, 303, 307, 308)


@dataclass(frozen=True, slots=True)
class OutboundResponse:
    """A response whose body is still to be read; valid within the context of the request."""

    url: Url
    status: int
    headers: dict[str, str]
    """Names in lower case."""
    chunks: Iterator[bytes]
    """The body, in the encoding that the server chose."""


class OutboundClient:
    """Send requests that a policy allows, without proxies, cookies, credentials and redirects."""

    def __init__(
        self,
        policy: UrlPolicy,
        *,
        resolve: Resolver = system_resolver,
        tls: ssl.SSLContext | None = None,
    ) -> None:
        self._policy = policy
        self._resolve = resolve
        self._tls = tls

    @contextmanager
    def request(
        self,
        method: str,
        url: Url,
        deadline: TransferDeadline,
        *,
        headers: dict[str, str],
        content: bytes | None = None,
    ) -> Iterator[OutboundResponse]:
        """Send a request and yield the response.

        Raises
        ------
        AddressRefusedError
            The policy does not allow the URL, or an address of its host.
        FetchError
            There is no complete response; the subclass tells in which phase it failed.
        """
        check_url(url, self._policy)
        target = httpcore.URL(
            scheme=url.scheme, host=url.host, port=url.port, target=url.target.encode()
        )
        common = {"Host": url.authority, "User-Agent": f"mpe/{version('mpe')}", "Accept": "*/*"}
        with (
            _translate_errors(),
            httpcore.ConnectionPool(
                ssl_context=self._ssl_context() if url.scheme == "https" else None,
                network_backend=GuardedBackend(self._policy, self._resolve, deadline),
            ) as pool,
            pool.stream(
                method, target, headers=list((common | headers).items()), content=content
            ) as response,
        ):
            fields = {k.decode("latin-1").lower(): v.decode("latin-1") for k, v in response.headers}
            yield OutboundResponse(url, response.status, fields, response.iter_stream())

    @contextmanager
    def get(
        self,
        url: Url,
        deadline: TransferDeadline,
        headers_for: Callable[[Url], dict[str, str]],
    ) -> Iterator[OutboundResponse]:
        """GET a URL and follow its redirects, each checked like the first URL.

        Parameters
        ----------
        url : Url
            Where to begin.
        deadline : TransferDeadline
            Time limits of the whole chain.
        headers_for : callable
            Headers for the server of one URL; those for one server are not sent to the next.

        Raises
        ------
        AddressRefusedError
            The policy does not allow a URL of the chain, or one leads from https to http.
        FetchError
            There is no complete response, or the chain has more than MAX_REDIRECTS redirects.
        """
        for _ in range(MAX_REDIRECTS + 1):
            with self.request("GET", url, deadline, headers=headers_for(url)) as response:
                location = response.headers.get("location")
                if response.status not in REDIRECT_STATUSES or location is None:
                    yield response
                    return
            url = _redirect_target(url, location)
        raise FetchError(f"The URL leads to more than {MAX_REDIRECTS} redirects.")

    def _ssl_context(self) -> ssl.SSLContext:
        return self._tls or _default_ssl_context()


def _redirect_target(url: Url, location: str) -> Url:
    try:
        target = parse_url(urljoin(str(url), location))
    except ValueError:
        raise AddressRefusedError("The URL redirects to an address that is no URL.") from None
    if url.scheme == "https" and target.scheme == "http":
        raise AddressRefusedError("The URL is redirected from https to http.")
    return target


@cache
def _default_ssl_context() -> ssl.SSLContext:
    """Trust the system's certificate authorities (SSL_CERT_FILE adds others) and certifi's."""
    return httpcore.default_ssl_context()


@contextmanager
def _translate_errors() -> Iterator[None]:
    """Turn errors of httpcore into FetchErrors, which name neither addresses nor queries."""
    try:
        yield
    except httpcore.TimeoutException as error:
        raise FetchTooSlowError("The URL's server did not answer or send on in time.") from error
    except httpcore.ConnectError as error:
        raise FetchUnreachableError("The URL's server cannot be reached.") from error
    except (httpcore.ReadError, httpcore.WriteError, httpcore.RemoteProtocolError) as error:
        raise FetchCutError("The connection ended before the whole file had arrived.") from error
    except (httpcore.ProtocolError, httpcore.UnsupportedProtocol) as error:
        raise FetchError("The URL's server does not send valid HTTP.") from error
