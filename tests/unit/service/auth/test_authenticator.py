"""Who the caller of a request is."""

from __future__ import annotations

import pytest

from service.auth.authenticator import ANONYMOUS, Authenticator, limits_in_force
from service.auth.keys import KeyLimits, KeyStore
from service.problems import UnauthorizedError
from service.settings import KeySettings, Settings
from service.storage.store_mark import StoreMark


@pytest.mark.parametrize(
    ("own", "in_force"),
    [
        (KeyLimits(), KeyLimits(5, 7, None)),
        (KeyLimits(2, 0, 10), KeyLimits(2, None, 10)),
        (KeyLimits(0, None, 0), KeyLimits(None, 7, None)),
    ],
)
def test_limits_of_a_key_precede_the_defaults_and_0_is_unlimited(
    own: KeyLimits, in_force: KeyLimits
) -> None:
    defaults = KeySettings(requests_per_s=5, queue_limit=7, stored_bytes=0)
    assert limits_in_force(own, defaults) == in_force


def test_a_key_names_its_tenant(keys: KeyStore, settings: Settings) -> None:
    key = keys.create("lab", "", KeyLimits(2, 0, 10))
    caller = Authenticator(keys, settings).authenticate([f"bearer {key}"])
    assert (caller.tenant, caller.limits) == ("lab", KeyLimits(2, None, 10))


def test_a_valid_key_is_cached_and_a_wrong_secret_is_not(
    keys: KeyStore, settings: Settings
) -> None:
    authenticator = Authenticator(keys, settings)
    given = [f"Bearer {keys.create('lab', '', KeyLimits())}"]
    assert authenticator.from_cache(given) is None
    caller = authenticator.authenticate(given)
    assert authenticator.from_cache(given) == caller
    wrong = [given[0][:-1] + ("b" if given[0].endswith("a") else "a")]
    with pytest.raises(UnauthorizedError):
        authenticator.from_cache(wrong)
    with pytest.raises(UnauthorizedError):
        authenticator.authenticate(wrong)


def test_a_revoked_key_is_refused_once_the_cache_has_expired(
    keys: KeyStore, settings: Settings, monkeypatch: pytest.MonkeyPatch
) -> None:
    now = 1000.0
    monkeypatch.setattr("service.auth.authenticator.time.monotonic", lambda: now)
    authenticator = Authenticator(keys, settings)
    key = keys.create("lab", "", KeyLimits())
    authenticator.authenticate([f"Bearer {key}"])
    keys.revoke(key.split("_")[1])
    assert authenticator.from_cache([f"Bearer {key}"]) is not None
    now += 1
    assert authenticator.from_cache([f"Bearer {key}"]) is None
    with pytest.raises(UnauthorizedError):
        authenticator.authenticate([f"Bearer {key}"])


def test_anonymous_until_the_first_key_and_never_again(keys: KeyStore, settings: Settings) -> None:
    assert Authenticator(keys, settings).authenticate([]) == ANONYMOUS
    key = keys.create("lab", "", KeyLimits())
    assert keys.revoke(key.split("_")[1])
    with pytest.raises(UnauthorizedError) as refused:
        Authenticator(keys, settings).authenticate([])
    assert refused.value.headers == {"WWW-Authenticate": 'Bearer realm="mpe"'}


@pytest.mark.parametrize(
    "headers", [["Bearer"], ["Basic {key}"], ["Bearer {key}", "Bearer {key}"], ["{key}"], [""]]
)
def test_another_form_of_the_header_is_refused(
    headers: list[str], keys: KeyStore, settings: Settings
) -> None:
    key = keys.create("lab", "", KeyLimits())
    with pytest.raises(UnauthorizedError) as refused:
        Authenticator(keys, settings).authenticate([text.format(key=key) for text in headers])
    assert "invalid_token" in refused.value.headers["WWW-Authenticate"]


def test_a_directory_that_had_keys_never_opens_without_them(
    settings: Settings, keys: KeyStore
) -> None:
    assert Authenticator(keys, settings).authenticate([]) == ANONYMOUS
    StoreMark(settings.data_dir).record_keys()
    with pytest.raises(UnauthorizedError):
        Authenticator(keys, settings).authenticate([])
