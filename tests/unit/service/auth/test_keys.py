"""API keys in the database."""

from __future__ import annotations

import pytest

from service.auth.keys import KeyLimits, KeyStore, split_key
from service.database.engine import Database


@pytest.mark.parametrize("name", ["../etc", "", "a b", ".", "-x", "a" * 65, "\u00e9", "a\n"])
def test_a_tenant_has_a_plain_name(keys: KeyStore, name: str) -> None:
    with pytest.raises(ValueError, match="letters"):
        keys.create(name, "", KeyLimits())
    assert keys.all() == []


def test_keys_are_long_and_never_the_same(keys: KeyStore) -> None:
    made = [keys.create("lab", "", KeyLimits()) for _ in range(20)]
    secrets = [parts[1] for key in made if (parts := split_key(key))]
    assert len(set(secrets)) == 20
    assert {len(secret) for secret in secrets} == {43}  # 256 bits, six in a letter


@pytest.mark.parametrize(
    "text", ["", "mpe_", "mpe_0_x", "mpe_" + "G" * 16 + "_" + "a" * 43, " mpe_x", "mpe_x\n"]
)
def test_other_text_is_no_key(text: str) -> None:
    assert split_key(text) is None


def test_a_key_is_verified_by_its_secret_until_it_is_revoked(database: Database) -> None:
    keys = KeyStore(database)
    assert not keys.any_exist()
    limits = KeyLimits(2.5, 0, 2**40)
    parts = split_key(keys.create("lab", "bench", limits))
    assert parts is not None
    key_id, secret = parts
    (key,) = keys.all()
    assert keys.find(key_id) == key
    assert (key.tenant, key.name, key.limits) == ("lab", "bench", limits)
    assert secret not in repr(key)
    assert key.verify_secret(secret)
    assert not key.verify_secret(secret[:-1])
    assert keys.revoke(key_id)
    assert not keys.revoke(key_id)
    revoked = keys.find(key_id)
    assert revoked is not None
    assert not revoked.verify_secret(secret)
    assert keys.any_exist()
