"""Which hosts and ports a URL may name."""

from __future__ import annotations

import pytest

from service.outbound.errors import (
    AddressRefusedError,
)
from service.outbound.url_policy import UrlPolicy, check_url
from service.outbound.urls import parse_url


def literal(address: str) -> str:
    return f"http://[{address}]/file" if ":" in address else f"http://{address}/file"


@pytest.mark.parametrize("address", ["10.0.0.1", "127.0.0.1", "::1", "64:ff9b::8.8.8.8"])
def test_an_address_that_is_not_public_is_refused(address: str) -> None:
    with pytest.raises(AddressRefusedError, match="not on the public network"):
        check_url(parse_url(literal(address)), UrlPolicy())


@pytest.mark.parametrize("address", ["8.8.8.8", "2600::1"])
def test_a_public_address_is_not(address: str) -> None:
    check_url(parse_url(literal(address)), UrlPolicy())


def test_a_host_that_is_not_named_is_refused_and_the_setting_named() -> None:
    policy = UrlPolicy(hosts=("files.example",), hosts_setting="MPE_WEBHOOK_HOSTS")
    check_url(parse_url("https://files.example/"), policy)
    with pytest.raises(AddressRefusedError, match="MPE_WEBHOOK_HOSTS"):
        check_url(parse_url("https://other.example/"), policy)


@pytest.mark.parametrize("port", [1, 22, 25, 81, 1023])
def test_ports_of_other_services_are_refused(port: int) -> None:
    with pytest.raises(AddressRefusedError, match="port"):
        check_url(parse_url(f"http://files.example:{port}/"), UrlPolicy())


def test_ports_can_be_named() -> None:
    rules = UrlPolicy(ports=(8443,))
    check_url(parse_url("https://files.example:8443/"), rules)
    with pytest.raises(AddressRefusedError, match="port"):
        check_url(parse_url("https://files.example/"), rules)
