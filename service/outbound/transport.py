"""Network backend of httpcore that connects only to addresses it has checked.

A host is resolved once and the connection goes to one of the addresses that were checked. A second
look-up (DNS rebinding) cannot lead elsewhere.
"""

from __future__ import annotations

import socket
import ssl
import threading
from collections.abc import Callable, Iterable
from ipaddress import ip_address
from typing import Any

import httpcore

from service.outbound.deadline import TransferDeadline
from service.outbound.errors import FetchNameError, FetchTlsError, FetchTooSlowError
from service.outbound.ip_policy import Address, is_allowed
from service.outbound.url_policy import UrlPolicy, refused_address

Resolver = Callable[[str], Iterable[str]]
"""Function from a host name to its addresses; raises OSError when there are none."""


def system_resolver(name: str) -> list[str]:
    """Resolve a name with the system; keeps the order, drops duplicates."""
    found = socket.getaddrinfo(name, None, type=socket.SOCK_STREAM)
    return list(dict.fromkeys(str(item[4][0]) for item in found))


class GuardedBackend(httpcore.NetworkBackend):
    """Connect to checked addresses of a host; TLS and the Host header keep its name."""

    def __init__(self, policy: UrlPolicy, resolve: Resolver, deadline: TransferDeadline) -> None:
        self._policy = policy
        self._resolve = resolve
        self._deadline = deadline
        self._sockets = httpcore.SyncBackend()

    def connect_tcp(
        self,
        host: str,
        port: int,
        timeout: float | None = None,
        local_address: str | None = None,
        socket_options: Iterable[Any] | None = None,
    ) -> httpcore.NetworkStream:
        """Connect to the first address that answers, once all addresses of the host are allowed.

        Raises
        ------
        AddressRefusedError
            One of the addresses is not allowed.
        FetchNameError
            The host has no address.
        httpcore.ConnectError, httpcore.ConnectTimeout
            No address answers.
        """
        addresses = self._resolve_host(host)
        if not all(is_allowed(address, self._policy.networks) for address in addresses):
            raise refused_address()
        failure: Exception = httpcore.ConnectError()
        for address in addresses:
            try:
                stream = self._sockets.connect_tcp(str(address), port, self._deadline.remaining())
            except (httpcore.ConnectError, httpcore.ConnectTimeout) as error:
                failure = error
            else:
                self._deadline.start()
                return TimedStream(stream, self._deadline)
        raise failure

    def _resolve_host(self, host: str) -> list[Address]:
        try:
            return [ip_address(host)]
        except ValueError:
            pass
        addresses = [ip_address(text) for text in self._ask_resolver(host)]
        if not addresses:
            raise FetchNameError("The URL's host has no address.")
        return addresses

    def _ask_resolver(self, host: str) -> list[str]:
        """Run the resolver in a thread, since it cannot be interrupted, and wait within limits."""
        answers: list[list[str] | OSError] = []

        def ask() -> None:
            try:
                answers.append(list(self._resolve(host)))
            except (OSError, UnicodeError) as error:
                answers.append(OSError(str(error)))

        asking = threading.Thread(target=ask, daemon=True)
        asking.start()
        asking.join(self._deadline.remaining())
        if not answers:
            raise FetchTooSlowError("The URL's host was not resolved in time.")
        if isinstance(answers[0], OSError):
            raise FetchNameError("The URL's host could not be resolved.") from answers[0]
        return answers[0]


class TimedStream(httpcore.NetworkStream):
    """Connection whose reads and writes keep to the deadline."""

    def __init__(self, stream: httpcore.NetworkStream, deadline: TransferDeadline) -> None:
        self._stream = stream
        self._deadline = deadline

    def read(self, max_bytes: int, timeout: float | None = None) -> bytes:
        """Read the next bytes."""
        received = self._stream.read(max_bytes, self._deadline.remaining())
        self._deadline.received(len(received))
        return received

    def write(self, buffer: bytes, timeout: float | None = None) -> None:
        """Send the bytes."""
        self._stream.write(buffer, self._deadline.remaining())

    def close(self) -> None:
        """Close the connection."""
        self._stream.close()

    def start_tls(
        self,
        ssl_context: ssl.SSLContext,
        server_hostname: str | None = None,
        timeout: float | None = None,
    ) -> httpcore.NetworkStream:
        """Start TLS with the server of this name.

        Raises
        ------
        FetchTlsError
            The certificate is not valid for the name, or the handshake failed.
        """
        try:
            inner = self._stream.start_tls(ssl_context, server_hostname, self._deadline.remaining())
        except httpcore.ConnectError as error:
            raise FetchTlsError(f"TLS failed: {_tls_reason(error.__cause__)}.") from error
        return TimedStream(inner, self._deadline)

    def get_extra_info(self, info: str) -> Any:
        """Return what httpcore tells of the connection."""
        return self._stream.get_extra_info(info)


def _tls_reason(error: BaseException | None) -> str:
    if isinstance(error, ssl.SSLCertVerificationError):
        return f"the certificate is not valid ({error.verify_message.rstrip('.')})"
    if isinstance(error, ssl.SSLError) and error.reason:
        return error.reason.lower().replace("_", " ")
    return "the server ended the handshake"
