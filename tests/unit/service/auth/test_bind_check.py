"""Where the service may listen."""

from __future__ import annotations

import pytest

from service.auth.bind_check import (
    UnprotectedBindError,
    check_binding,
    is_loopback_address,
    resolves_to_loopback,
)
from service.auth.keys import KeyLimits, KeyStore
from service.settings import Settings


@pytest.mark.parametrize("host", ["127.0.0.1", "::1", "localhost", "127.8.0.1"])
def test_only_this_machine_reaches_it(host: str, settings: Settings) -> None:
    assert resolves_to_loopback(host)
    check_binding(host, settings)


@pytest.mark.parametrize("host", ["0.0.0.0", "::", "", "192.0.2.7", "no-such-host.invalid"])
def test_other_machines_reach_it(host: str, settings: Settings, keys: KeyStore) -> None:
    assert not resolves_to_loopback(host)
    told = r"mpe keys create.*MPE_ALLOW_ANONYMOUS_REMOTE=true"
    with pytest.raises(UnprotectedBindError, match=told):
        check_binding(host, settings)
    for switch in ("allow_anonymous_remote", "require_keys"):
        check_binding(host, settings.model_copy(update={switch: True}))
    keys.create("lab", "", KeyLimits())
    check_binding(host, settings)


@pytest.mark.parametrize(
    ("text", "expected"),
    [("127.0.0.1", True), ("::1", True), ("10.0.0.1", False), ("localhost", False), ("", False)],
)
def test_a_name_is_not_resolved(text: str, expected: bool) -> None:
    assert is_loopback_address(text) is expected
