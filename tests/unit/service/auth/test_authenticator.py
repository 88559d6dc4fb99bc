"""Keys, the gate and the rate limit, where no server is needed to see what they do."""

from __future__ import annotations

from pathlib import Path

import pytest

from service.auth.authenticator import ANONYMOUS, Authenticator, Caller
from service.auth.bind_check import UnprotectedBindError, check_binding, is_loopback
from service.auth.keys import KeyStore, Limits, split_key
from service.auth.rate_limit import RateLimiter
from service.database.engine import Database, open_database
from service.problems import RateLimitedError, UnauthorizedError
from service.settings import Settings


@pytest.fixture
def settings(tmp_path: Path) -> Settings:
    return Settings(data_dir=tmp_path, key_requests_per_s=5, key_queue_limit=7, key_stored_bytes=0)


@pytest.fixture
def database(settings: Settings) -> Database:
    return open_database(settings.store_url)


@pytest.fixture
def keys(database: Database) -> KeyStore:
    return KeyStore(database)


@pytest.mark.parametrize("name", ["../etc", "", "a b", ".", "-x", "a" * 65, "\u00e9", "a\n"])
def test_a_tenant_has_a_plain_name(keys: KeyStore, name: str) -> None:
    with pytest.raises(ValueError, match="letters"):
        keys.create(name, "", Limits())
    assert keys.all() == []


def test_keys_are_long_and_never_the_same(keys: KeyStore) -> None:
    made = [keys.create("lab", "", Limits()) for _ in range(20)]
    secrets = [found[1] for key in made if (found := split_key(key))]
    assert len(set(secrets)) == 20
    assert {len(secret) for secret in secrets} == {43}  # 256 bits, six in a letter


def test_limits_of_a_key_go_before_those_of_the_settings(
    keys: KeyStore, settings: Settings
) -> None:
    gate = Authenticator(keys, settings)

    def limits(own: Limits) -> Limits:
        return gate.identified([f"Bearer {keys.create('lab', '', own)}"]).limits

    assert limits(Limits()) == Limits(5, 7, None)
    assert limits(Limits(2, 0, 10)) == Limits(2, None, 10)


def test_a_valid_key_is_remembered_and_a_wrong_secret_is_not(
    keys: KeyStore, settings: Settings
) -> None:
    gate = Authenticator(keys, settings)
    given = [f"Bearer {keys.create('lab', '', Limits())}"]
    assert gate.remembered(given) is None
    caller = gate.identified(given)
    assert gate.remembered(given) == caller
    wrong = [given[0][:-1] + ("b" if given[0].endswith("a") else "a")]
    with pytest.raises(UnauthorizedError):
        gate.remembered(wrong)
    with pytest.raises(UnauthorizedError):
        gate.identified(wrong)


def test_open_until_the_first_key_and_never_again(keys: KeyStore, settings: Settings) -> None:
    assert Authenticator(keys, settings).identified([]) == ANONYMOUS
    key = keys.create("lab", "", Limits())
    assert keys.revoke(key.split("_")[1])
    with pytest.raises(UnauthorizedError):
        Authenticator(keys, settings).identified([])


@pytest.mark.parametrize("rate", [0.5, 1, 7, 100])
def test_as_many_at_once_as_in_a_second(rate: float, monkeypatch: pytest.MonkeyPatch) -> None:
    now = 1000.0
    monkeypatch.setattr("service.auth.rate_limit.time.monotonic", lambda: now)
    limit, caller = RateLimiter(), Caller("lab", Limits(rate), "key")

    def passed(tries: int) -> int:
        return sum(_passes(limit, caller) for _ in range(tries))

    assert passed(300) == max(1, rate)
    now += 10
    assert passed(300) == max(1, rate)
    now += 1 / rate
    assert passed(300) == 1
    evenly = 0
    for _ in range(100):
        now += 1.000001 / rate
        evenly += passed(1)
    assert evenly == 100


def _passes(limit: RateLimiter, caller: Caller) -> bool:
    try:
        limit.count(caller)
    except RateLimitedError as error:
        return not error.headers["Retry-After"].isdigit()
    return True


@pytest.mark.parametrize("host", ["127.0.0.1", "::1", "localhost", "127.8.0.1"])
def test_this_machine_alone(host: str, settings: Settings) -> None:
    assert is_loopback(host)
    check_binding(host, settings)


@pytest.mark.parametrize("host", ["0.0.0.0", "::", "", "192.0.2.7", "no-such-host.invalid"])
def test_what_others_may_reach(host: str, settings: Settings, keys: KeyStore) -> None:
    assert not is_loopback(host)
    with pytest.raises(UnprotectedBindError, match=r"mpe keys create.*MPE_ALLOW_OPEN=true"):
        check_binding(host, settings)
    for told in ("allow_open", "require_keys"):
        check_binding(host, settings.model_copy(update={told: True}))
    keys.create("lab", "", Limits())
    check_binding(host, settings)
