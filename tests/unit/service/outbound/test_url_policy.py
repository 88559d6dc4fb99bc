"""What the door does not open to, whatever the spelling, the name or the way there."""

from __future__ import annotations

from ipaddress import ip_network

import pytest

from service.outbound.errors import AddressRefusedError
from service.outbound.ip_policy import METADATA
from service.outbound.url_policy import UrlPolicy, check_url
from service.outbound.urls import parse_url
from tests.factories.web import OPEN, Fetch, Names, Web, serving

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
NOT_PUBLIC = [
    "0.0.0.0",
    "0.1.2.3",
    "10.0.0.1",
    "100.64.0.1",
    "100.100.100.200",
    "127.0.0.1",
    "127.255.255.254",
    "168.63.129.16",
    "169.254.0.1",
    "169.254.169.254",
    "172.16.0.1",
    "172.31.255.255",
    "192.0.0.192",
    "192.0.2.1",
    "192.88.99.1",
    "192.168.0.1",
    "198.18.0.1",
    "198.51.100.1",
    "203.0.113.1",
    "224.0.0.1",
    "239.255.255.250",
    "240.0.0.1",
    "255.255.255.255",
    "::",
    "::1",
    "::127.0.0.1",
    "::8.8.8.8",
    "::ffff:127.0.0.1",
    "::ffff:8.8.8.8",
    "::ffff:0:127.0.0.1",
    "64:ff9b::127.0.0.1",
    "64:ff9b::8.8.8.8",
    "64:ff9b:1::1",
    "100::1",
    "2001::1",
    "2001:0:4136:e378:8000:63bf:80ff:fffe",
    "2001:2::1",
    "2001:10::1",
    "2001:20::1",
    "2001:db8::1",
    "2002:7f00:1::1",
    "2002:808:808::1",
    "2600::5efe:7f00:1",
    "2600::200:5efe:808:808",
    "3fff::1",
    "4000::1",
    "5f00::1",
    "fc00::1",
    "fd00:ec2::254",
    "fe80::1",
    "fec0::1",
    "ff02::1",
    "ff0e::1",
]
PUBLIC = ["8.8.8.8", "93.184.215.14", "192.0.1.1", "2600::1", "2a00:1450:4001:80b::200e"]


def literal(address: str) -> str:
    return f"http://[{address}]/file" if ":" in address else f"http://{address}/file"


@pytest.mark.parametrize("url", MISSPELT)
def test_what_programs_read_differently_is_not_read(url: str) -> None:
    with pytest.raises(AddressRefusedError):
        parse_url(url)


@pytest.mark.parametrize("address", NOT_PUBLIC)
def test_an_address_that_is_not_public_is_refused(address: str) -> None:
    with pytest.raises(AddressRefusedError, match="not on the public network"):
        check_url(parse_url(literal(address)), UrlPolicy())


@pytest.mark.parametrize("address", NOT_PUBLIC)
def test_a_name_of_such_an_address_is_refused(address: str, fetch: Fetch, names: Names) -> None:
    names.answers["files.example"] = [address]
    with pytest.raises(AddressRefusedError, match="not on the public network") as refused:
        fetch("http://files.example/file", UrlPolicy())
    assert address not in str(refused.value)
    assert names.asked == ["files.example"]


@pytest.mark.parametrize("address", PUBLIC)
def test_public_addresses_are_not(address: str) -> None:
    check_url(parse_url(literal(address)), UrlPolicy())


@pytest.mark.parametrize("address", sorted(map(str, METADATA)))
def test_secrets_of_the_machine_are_refused_whatever_is_opened(address: str) -> None:
    everything = UrlPolicy(networks=(ip_network("0.0.0.0/0"), ip_network("::/0")))
    with pytest.raises(AddressRefusedError):
        check_url(parse_url(literal(address)), everything)


def test_a_server_on_this_machine_is_not_even_connected_to(
    web: Web, fetch: Fetch, names: Names
) -> None:
    names.answers["localhost.example"] = ["127.0.0.1"]
    for url in (web.url(host="127.0.0.1"), web.url(host="localhost.example")):
        with pytest.raises(AddressRefusedError):
            fetch(url, UrlPolicy())
    assert web.connections == 0


def test_one_address_of_many_that_is_not_public_is_enough(
    web: Web, fetch: Fetch, names: Names
) -> None:
    names.answers["files.example"] = ["127.0.0.1", "10.0.0.1"]
    with pytest.raises(AddressRefusedError):
        fetch(web.url())
    assert web.connections == 0


def test_the_address_that_was_checked_is_dialled_though_the_name_has_moved(
    fetch: Fetch, names: Names
) -> None:
    with serving("127.0.0.2") as good, serving("127.0.0.3") as other:
        names.turns["files.example"] = [["127.0.0.2"], ["127.0.0.3"], ["10.0.0.1"]]
        assert fetch(good.url()).size > 0
        assert (good.connections, other.connections) == (1, 0)
    assert names.asked == ["files.example"]


def test_a_name_that_moves_between_redirects_is_checked_again(
    web: Web, fetch: Fetch, names: Names
) -> None:
    web.behaviours["/moved"] = lambda handler: handler.give(b"", 302, Location="/file")
    names.turns["files.example"] = [["127.0.0.1"], ["169.254.169.254"]]
    with pytest.raises(AddressRefusedError):
        fetch(web.url("/moved"))
    assert [path for path, _ in web.requests] == ["/moved"]


def test_a_name_that_moves_before_a_further_try_is_checked_again(
    web: Web, fetch: Fetch, names: Names
) -> None:
    web.behaviours["/cut"] = lambda handler: handler.give_part(0, 10, ETag='"1"')
    names.turns["files.example"] = [["127.0.0.1"], ["10.0.0.1"]]
    with pytest.raises(AddressRefusedError):
        fetch(web.url("/cut"))
    assert web.connections == 1


REDIRECTS = [
    "http://127.0.0.2:{port}/file",
    "http://[::1]:{port}/file",
    "http://[::ffff:127.0.0.1]:{port}/file",
    "http://169.254.169.254/latest/meta-data/",
    "http://intern.example:{port}/file",
    "//intern.example:{port}/file",
    "http://user@files.example:{port}/file",
    "http://2130706433:{port}/file",
    "http://files.example:22/",
    "file:///etc/passwd",
    "gopher://files.example/",
    "ftp://files.example/",
    "http://[",
    "http://files.example:{port}\\file",
    "http://fi\u00e9.example/",
]


@pytest.mark.parametrize("location", REDIRECTS)
def test_a_redirect_is_checked_like_any_url(
    location: str, web: Web, fetch: Fetch, names: Names
) -> None:
    names.answers["intern.example"] = ["10.0.0.1"]
    place = location.format(port=web.server_port)
    web.behaviours["/moved"] = lambda handler: handler.give(b"", 302, Location=place)
    with pytest.raises(AddressRefusedError):
        fetch(web.url("/moved"), UrlPolicy(networks=(ip_network("127.0.0.1/32"),)))
    assert [path for path, _ in web.requests] == ["/moved"]


def test_a_redirect_to_a_host_that_is_not_named_is_refused(
    web: Web, fetch: Fetch, names: Names
) -> None:
    names.answers["other.example"] = ["127.0.0.1"]
    web.behaviours["/moved"] = lambda handler: handler.give(
        b"", 302, Location=web.url(host="other.example")
    )
    rules = UrlPolicy(hosts=("files.example",), networks=OPEN.networks)
    with pytest.raises(AddressRefusedError, match="MPE_URL_HOSTS"):
        fetch(web.url("/moved"), rules)


@pytest.mark.parametrize("port", [1, 22, 25, 81, 1023])
def test_ports_of_other_services_are_refused(port: int) -> None:
    with pytest.raises(AddressRefusedError, match="port"):
        check_url(parse_url(f"http://files.example:{port}/"), UrlPolicy())


def test_ports_can_be_named() -> None:
    rules = UrlPolicy(ports=(8443,))
    check_url(parse_url("https://files.example:8443/"), rules)
    with pytest.raises(AddressRefusedError, match="port"):
        check_url(parse_url("https://files.example/"), rules)


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
