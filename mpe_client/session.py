"""Requests that are sent again where that is safe, and whose problems are raised."""

from __future__ import annotations

from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from dataclasses import dataclass
from typing import Any

import httpx

from mpe_client.errors import InvalidResponseError, ProblemError, UnreachableError
from mpe_client.models import Problem
from mpe_client.parse import parse_json
from mpe_client.retry import Patience, Tries, asked_pause
from mpe_client.transport import Transport

_MAX_QUOTED = 200
"""Characters of a response that is not the service's which an exception repeats."""


@dataclass(frozen=True, slots=True)
class Session:
    """A transport with the patience of its caller."""

    transport: Transport
    patience: Patience

    async def call(
        self, method: str, path: str, prepare: Callable[[], dict[str, Any]] = dict, **given: Any
    ) -> httpx.Response:
        """Send a request until it is answered, and return its whole response.

        Parameters
        ----------
        method, path
            Method, and path below the address of the service. The request is repeated: a POST needs
            an Idempotency-Key.
        prepare
            Returns further arguments of `httpx.Client.build_request`, once for each try.
        **given
            Such arguments.

        Raises
        ------
        ProblemError
            The service refuses it.
        UnreachableError
            It did not answer within the patience.
        """
        async with self.stream(method, path, prepare, **given) as response:
            await self._read(response)
        return response

    @asynccontextmanager
    async def stream(
        self, method: str, path: str, prepare: Callable[[], dict[str, Any]] = dict, **given: Any
    ) -> AsyncIterator[httpx.Response]:
        """Like `call`; the body of the response is still to be read."""
        tries = Tries(self.patience)
        while True:
            outcome = await self._try(method, path, **given, **prepare())
            if isinstance(outcome, httpx.Response):
                asked_s = asked_pause(outcome)
                if asked_s is None:
                    break
                await self._read(outcome)
            pause = tries.next_pause(0.0 if isinstance(outcome, Exception) else asked_s or 0.0)
            if pause is None:
                break
            await self.transport.sleep(pause)
        if isinstance(outcome, Exception):
            raise _unreachable(outcome, self.transport) from outcome
        try:
            if outcome.is_error:
                await self._read(outcome)
                raise ProblemError(read_problem(outcome))
            yield outcome
        finally:
            await self.transport.close(outcome)

    async def try_once(self, method: str, path: str, **given: Any) -> httpx.Response:
        """Send a request once.

        Raises
        ------
        ProblemError
            The service refuses it.
        httpx.TransportError
            It does not answer.
        """
        outcome = await self._try(method, path, **given)
        if isinstance(outcome, Exception):
            raise outcome
        await self._read(outcome)
        if outcome.is_error:
            raise ProblemError(read_problem(outcome))
        return outcome

    async def _try(
        self, method: str, path: str, **given: Any
    ) -> httpx.Response | httpx.TransportError:
        request = self.transport.client.build_request(method, path, **given)
        try:
            return await self.transport.send(request, stream=True)
        except httpx.UnsupportedProtocol:
            raise
        except httpx.TransportError as error:
            return error

    async def _read(self, response: httpx.Response) -> None:
        try:
            await self.transport.read(response)
        except httpx.TransportError as error:
            raise _unreachable(error, self.transport) from error
        finally:
            await self.transport.close(response)


def read_problem(response: httpx.Response) -> Problem:
    """Return the problem document of a response, or one made of its status."""
    try:
        return parse_json(Problem, response.content)
    except InvalidResponseError:
        text = " ".join(response.text[:_MAX_QUOTED].split())
        return Problem("about:blank", response.reason_phrase, response.status_code, text)


def _unreachable(error: Exception, transport: Transport) -> UnreachableError:
    return UnreachableError(
        f"{transport.client.base_url} does not answer ({type(error).__name__}: {error}); is the "
        "service running, and is this its address?"
    )
