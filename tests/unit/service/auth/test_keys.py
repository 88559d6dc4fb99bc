"""API keys in each database."""

from __future__ import annotations

from service.auth.keys import KeyStore, Limits, split_key
from service.database.engine import Database


def test_a_key_is_found_until_it_is_revoked(database: Database) -> None:
    keys = KeyStore(database)
    assert not keys.exist()
    known = split_key(keys.create("lab", "bench", Limits(stored_bytes=2**40)))
    assert known is not None
    key_id, secret = known
    key = keys.find(key_id)
    assert key is not None
    assert key.admits(secret)
    assert not key.admits(secret + "x")
    assert key.limits.stored_bytes == 2**40
    assert keys.exist()
    assert keys.revoke(key_id)
    assert not keys.revoke(key_id)
    revoked = keys.find(key_id)
    assert revoked is not None
    assert not revoked.admits(secret)
