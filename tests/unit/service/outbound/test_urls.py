"""URLs in one spelling."""

from __future__ import annotations

import pytest

from service.outbound.errors import (
    AddressRefusedError,
)
from service.outbound.urls import parse_url, redact_url

MISSPELT = [
    "",
    "scan.ply",
    "//files.example/scan.ply",
    "/etc/passwd",
    "file:///etc/passwd",
    "ftp://files.example/scan.ply",
    "gopher://127.0.0.1:6379/_INFO",
    "dict://127.0.0.1:11211/stats",
    "data:text/plain,1%202%203",
    "javascript:alert(1)",
    "jar:http://files.example/a!/b",
    "s3://bucket/key",
    "http:scan.ply",
    "http:///scan.ply",
    "http://",
    "http://user@files.example/",
    "http://user:word@files.example/",
    "http://files.example@127.0.0.1/",
    "http://files.example:80@127.0.0.1/",
    "http://127.0.0.1\\@files.example/",
    "http://files.example\\.evil.example/",
    "http://files.example /",
    "http://files.example/a b",
    "http://files.example/a\tb",
    "http://files.example/\r\nHost: intern",
    "http://files.example\x00.evil.example/",
    "http://files.exampl\u00e9/",
    "http://\uff11\uff12\uff17.0.0.1/",
    "http://\u2460\u2461\u2466.0.0.1/",
    "http://127\u30020\u30020\u30021/",
    "http://loc\u00adalhost/",
    "http://files.example./",
    "http://127.0.0.1./",
    "http://files..example/",
    "http://.example/",
    "http://-files.example/",
    f"http://{'a' * 64}.example/",
    f"http://{'a.' * 127}example/",
    "http://%31%32%37.0.0.1/",
    "http://127.0.0.1%2f@files.example/",
    "http://2130706433/",
    "http://0x7f000001/",
    "http://0x7f.0x0.0x0.0x1/",
    "http://0177.0.0.1/",
    "http://017700000001/",
    "http://127.1/",
    "http://127.0.1/",
    "http://127.0.0.0x1/",
    "http://127.0.0.01/",
    "http://127.0.0.256/",
    "http://1.2.3.4.5/",
    "http://0/",
    "http://[::1/",
    "http://::1/",
    "http://[::1%25eth0]/",
    "http://[fe80::1%eth0]/",
    "http://[v1.fe80]/",
    "http://[127.0.0.1]/",
    "http://files.example:/",
    "http://files.example:0/",
    "http://files.example:65536/",
    "http://files.example:http/",
    "http://files.example:-80/",
]


@pytest.mark.parametrize("url", MISSPELT)
def test_what_programs_read_differently_is_not_read(url: str) -> None:
    with pytest.raises(AddressRefusedError):
        parse_url(url)


@pytest.mark.parametrize(
    ("text", "read"),
    [
        ("HTTP://Files.Example", "http://files.example/"),
        ("https://files.example:443/a%20b?c=%2F&d#e", "https://files.example/a%20b?c=%2F&d"),
        ("http://[2600:0:0::0001]:8080?q", "http://[2600::1]:8080/?q"),
        ("http://xn--fils-9oa.example/", "http://xn--fils-9oa.example/"),
        ("http://8.8.8.8/", "http://8.8.8.8/"),
    ],
)
def test_what_is_clear_is_read_in_one_spelling(text: str, read: str) -> None:
    assert str(parse_url(text)) == read
    assert str(parse_url(read)) == read


@pytest.mark.parametrize(
    ("url", "redacted"),
    [
        (None, None),
        ("https://files.example/a/scan.ply", "https://files.example/a/scan.ply"),
        (
            "https://me:word@files.example:8443/scan.ply?sig=1#x",
            "https://files.example:8443/scan.ply",
        ),
        ("s3://bucket/key?versionId=1", "s3://bucket/key"),
    ],
)
def test_what_may_hold_credentials_is_redacted(url: str | None, redacted: str | None) -> None:
    assert redact_url(url) == redacted
