"""One server for all end-to-end tests of a process that do not count what is in it.

Who needs it alone, or with other settings, has a fixture of the same name.
"""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from tests.factories.server import Server, running_server


@pytest.fixture(scope="session")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    with running_server(tmp_path_factory.mktemp("server")) as running:
        yield running
