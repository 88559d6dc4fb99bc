"""Connections to addresses that were checked: resolved once, and that very address dialled."""

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
"""Addresses of a name, as text; OSError when there are none."""


def system_resolver(name: str) -> list[str]:
    """What the system says, without order or doubles lost."""
    found = socket.getaddrinfo(name, None, type=socket.SOCK_STREAM)
    return list(dict.fromkeys(str(item[4][0]) for item in found))


class GuardedBackend(httpcore.NetworkBackend):
    """Connects to the names that httpcore asks for; TLS names and Host stay the name."""

    def __init__(self, rules: UrlPolicy, resolve: Resolver, watch: TransferDeadline) -> None:
        self._rules = rules
        self._resolve = resolve
        self._watch = watch
        self._sockets = httpcore.SyncBackend()

    def connect_tcp(
        self,
        host: str,
        port: int,
        timeout: float | None = None,
        local_address: str | None = None,
        socket_options: Iterable[Any] | None = None,
    ) -> httpcore.NetworkStream:
        """A connection to the first address that answers; none is made unless all may be dialled.

        Raises
        ------
        AddressRefusedError
            One of the addresses may not be dialled.
        FetchNameError
            The host has no address.
        httpcore.ConnectError, httpcore.ConnectTimeout
            None answers.
        """
        addresses = self._addresses(host)
        if not all(is_allowed(address, self._rules.networks) for address in addresses):
            raise refused_address()
        failure: Exception = httpcore.ConnectError()
        for address in addresses:
            try:
                stream = self._sockets.connect_tcp(str(address), port, self._watch.wait())
            except (httpcore.ConnectError, httpcore.ConnectTimeout) as error:
                failure = error
            else:
                self._watch.begin()
                return TimedStream(stream, self._watch)
        raise failure

    def _addresses(self, host: str) -> list[Address]:
        try:
            return [ip_address(host)]
        except ValueError:
            pass
        found = [ip_address(text) for text in self._resolved(host)]
        if not found:
            raise FetchNameError("The URL's host has no address.")
        return found

    def _resolved(self, host: str) -> list[str]:
        """What the resolver says in time: it cannot be interrupted."""
        answers: list[list[str] | OSError] = []

        def ask() -> None:
            try:
                answers.append(list(self._resolve(host)))
            except (OSError, UnicodeError) as error:
                answers.append(OSError(str(error)))

        asking = threading.Thread(target=ask, daemon=True)
        asking.start()
        asking.join(self._watch.wait())
        if not answers:
            raise FetchTooSlowError("The URL's host was not resolved in time.")
        if isinstance(answers[0], OSError):
            raise FetchNameError("The URL's host could not be resolved.") from answers[0]
        return answers[0]


class TimedStream(httpcore.NetworkStream):
    """A connection whose every step keeps to the stopwatch."""

    def __init__(self, stream: httpcore.NetworkStream, watch: TransferDeadline) -> None:
        self._stream = stream
        self._watch = watch

    def read(self, max_bytes: int, timeout: float | None = None) -> bytes:
        """The next bytes."""
        received = self._stream.read(max_bytes, self._watch.wait())
        self._watch.came(len(received))
        return received

    def write(self, buffer: bytes, timeout: float | None = None) -> None:
        """Send the bytes."""
        self._stream.write(buffer, self._watch.wait())

    def close(self) -> None:
        """Close the connection."""
        self._stream.close()

    def start_tls(
        self,
        ssl_context: ssl.SSLContext,
        server_hostname: str | None = None,
        timeout: float | None = None,
    ) -> httpcore.NetworkStream:
        """The connection within TLS, to the server of this name; FetchTlsError if it is not."""
        try:
            inner = self._stream.start_tls(ssl_context, server_hostname, self._watch.wait())
        except httpcore.ConnectError as error:
            raise FetchTlsError(f"TLS failed: {_reason(error.__cause__)}.") from error
        return TimedStream(inner, self._watch)

    def get_extra_info(self, info: str) -> Any:
        """What is known of the connection."""
        return self._stream.get_extra_info(info)


def _reason(error: BaseException | None) -> str:
    if isinstance(error, ssl.SSLCertVerificationError):
        return f"the certificate is not valid ({error.verify_message.rstrip('.')})"
    if isinstance(error, ssl.SSLError) and error.reason:
        return error.reason.lower().replace("_", " ")
    return "the server ended the handshake"
