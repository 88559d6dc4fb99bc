"""Which addresses may be connected to."""

from __future__ import annotations

import socket
from ipaddress import ip_address, ip_network
from types import SimpleNamespace

import psutil
import pytest

from service.outbound import ip_policy
from service.outbound.ip_policy import METADATA, is_allowed

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


@pytest.mark.parametrize("address", NOT_PUBLIC)
def test_an_address_that_is_not_public_is_not_allowed(address: str) -> None:
    assert not is_allowed(ip_address(address), ())


@pytest.mark.parametrize("address", PUBLIC)
def test_a_public_address_is_allowed(address: str) -> None:
    assert is_allowed(ip_address(address), ())


def test_addresses_of_a_network_that_is_named_are_allowed() -> None:
    networks = (ip_network("10.1.0.0/16"), ip_network("fd00:1::/32"))
    for address, expected in {"10.1.2.3": True, "10.2.0.1": False, "fd00:1::5": True}.items():
        assert is_allowed(ip_address(address), networks) is expected


@pytest.mark.parametrize("address", sorted(map(str, METADATA)))
def test_metadata_of_the_machine_is_never_allowed(address: str) -> None:
    everything = (ip_network("0.0.0.0/0"), ip_network("::/0"))
    assert not is_allowed(ip_address(address), everything)


@pytest.mark.parametrize("own", ["203.0.114.7", "2a00:1450::7"])
def test_a_public_address_of_this_machine_is_refused(
    monkeypatch: pytest.MonkeyPatch, own: str
) -> None:
    address = ip_address(own)
    assert is_allowed(address, ())
    family = socket.AF_INET if address.version == 4 else socket.AF_INET6
    entry = SimpleNamespace(family=family, address=own)
    monkeypatch.setattr(psutil, "net_if_addrs", lambda: {"eth0": [entry]})
    assert not is_allowed(address, ())
    assert is_allowed(address, (ip_network(f"{own}/{address.max_prefixlen}"),))


def test_addresses_of_this_machine_are_known_to_routing() -> None:
    assert ip_policy._routes_to_itself(ip_address("127.0.0.1"))
    assert not ip_policy._routes_to_itself(ip_address("198.41.0.4"))
