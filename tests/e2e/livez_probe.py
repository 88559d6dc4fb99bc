"""Times of /livez, measured in a process of its own; `python -m tests.e2e.livez_probe PORT`.

Prints a line for each call, until its input is closed: when it began, by `time.time`, and how many
seconds it took. Calls without an answer are left out.
"""

from __future__ import annotations

import http.client
import select
import sys
import time

INTERVAL_S = 0.1


def main() -> None:
    connection = http.client.HTTPConnection("127.0.0.1", int(sys.argv[1]), timeout=10)
    while not select.select([sys.stdin], [], [], INTERVAL_S)[0]:
        began_at, started = time.time(), time.perf_counter()
        try:
            connection.request("GET", "/livez")
            connection.getresponse().read()
        except (OSError, http.client.HTTPException):
            connection.close()
            continue
        print(began_at, time.perf_counter() - started, flush=True)


if __name__ == "__main__":
    main()
