"""`make cluster`: a cluster on one machine without containers, and the demo against it."""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
import threading
from pathlib import Path

from tests.factories.cluster import running_cluster
from tests.factories.postgres import find_programs
from tests.factories.tcp_proxy import Balancer, running_proxy

APIS, WORKERS = 2, 2


def main() -> int:
    """Start everything, run the demo, and serve until Ctrl-C; return the exit status."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--port", type=int, default=8000, help="of the proxy (%(default)s)")
    parser.add_argument("--once", action="store_true", help="end after the demo")
    given = parser.parse_args()
    programs = find_programs()
    if programs is None:
        print("There is no PostgreSQL server: install the Debian package postgresql.")
        return 1
    print(f"Starting PostgreSQL, an S3 store, {APIS} services for the API, {WORKERS} workers ...")
    with (
        tempfile.TemporaryDirectory(prefix="mpe-cluster-") as directory,
        running_cluster(Path(directory), programs, apis=APIS, workers=WORKERS) as cluster,
        running_proxy(Balancer([api.url for api in cluster.apis]).dial, given.port) as proxy,
    ):
        url = f"http://127.0.0.1:{proxy.port}"
        for name, services in (("API", cluster.apis), ("worker", cluster.workers)):
            print(f"{name:7}", ", ".join(service.url for service in services))
        print(f"All of them share database and bucket and no directory. The proxy: {url}")
        demo = subprocess.run([sys.executable, "-m", "benchmarks.demo", "--url", url], check=False)
        if given.once or demo.returncode:
            return demo.returncode
        print(f"\nServing at {url} until Ctrl-C.")
        try:
            threading.Event().wait()
        except KeyboardInterrupt:
            print()
        return 0


if __name__ == "__main__":
    sys.exit(main())
