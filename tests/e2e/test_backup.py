"""A backup of a service that runs becomes another service with the same contents."""

from __future__ import annotations

import shutil
from pathlib import Path

from tests.factories.commands import mpe
from tests.factories.scans import arms, as_npy
from tests.factories.server import finished, registered, running_server

CLOUD = as_npy(arms(1))


def test_a_running_service_is_backed_up_and_restored(tmp_path: Path) -> None:
    copy = tmp_path / "copy"
    with running_server(tmp_path) as server:
        job = registered(server.client, CLOUD, CLOUD)
        server.client.put("/v1/clouds/door", content=CLOUD).raise_for_status()
        done = mpe(server.data_dir, "backup", str(copy))
        assert done.returncode == 0, done.stderr
        result = server.client.get(f"/v1/registrations/{job['id']}").json()["result"]
        assert mpe(server.data_dir, "check").returncode == 0
        refused = mpe(server.data_dir, "restore", str(copy))
        assert (refused.returncode, "not empty" in refused.stderr) == (1, True)
        server.stop()
        shutil.rmtree(server.data_dir)
        assert mpe(server.data_dir, "check", str(copy)).returncode == 0
        restored = mpe(server.data_dir, "restore", str(copy))
        assert restored.returncode == 0, restored.stderr
        server.start()
        again = server.client.get(f"/v1/registrations/{job['id']}").json()
        assert again["result"] == result
        pair = {"source": {"cloud": "door"}, "target": {"cloud": "door"}}
        new = server.client.post("/v1/registrations", json=pair).json()
        assert finished(server.client, new["id"])["status"] == "succeeded"
