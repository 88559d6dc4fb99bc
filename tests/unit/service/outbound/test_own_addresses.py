"""An address of this machine is refused, whatever interface or route has it: shown with real ones.

The addresses are given to the loopback interface of a network namespace of its own.
"""

from __future__ import annotations

import shutil
import subprocess
import sys

import pytest

from tests.factories.server import PROJECT

SETUP = (
    "ip link set lo up && ip address add 198.41.0.200/32 dev lo && "
    "ip -6 address add 2a00:1450::7/128 dev lo && ip route add local 198.41.1.0/24 dev lo"
)
ADDRESSES = {
    "198.41.0.200": False,  # of an interface
    "2a00:1450::7": False,
    "198.41.1.5": False,  # of a local route
    "198.41.2.1": True,  # of somebody else
}
LOOK = """
import sys
from ipaddress import ip_address
from service.outbound.ip_policy import is_allowed
print(*(is_allowed(ip_address(text), ()) for text in sys.argv[1:]))
"""
IN_NAMESPACE = ["unshare", "--map-root-user", "--net", "sh", "-c"]


def _run(command: str, *arguments: str) -> subprocess.CompletedProcess[str]:
    call = [*IN_NAMESPACE, command, "sh", *arguments]
    return subprocess.run(call, cwd=PROJECT, capture_output=True, text=True, check=False)


def _lacks_namespaces() -> bool:
    return not (shutil.which("unshare") and shutil.which("ip")) or bool(_run(SETUP).returncode)


@pytest.mark.skipif(_lacks_namespaces(), reason="no network namespace can be made here")
def test_own_addresses_of_a_machine() -> None:
    done = _run(f'{SETUP} && exec "$@"', sys.executable, "-c", LOOK, *ADDRESSES)
    assert done.returncode == 0, done.stderr
    assert done.stdout.split() == [str(allowed) for allowed in ADDRESSES.values()]
