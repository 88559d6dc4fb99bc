"""Times of /livez, measured in a process of its own; `python -m tests.e2e.probe PORT ...`.

Calls each port in turn, and prints a line for each call until its input is closed: port, when the
call began, by `time.time`, how many seconds it took, and 1 if it was answered 200, else 0.
"""

from __future__ import annotations

import http.client
import select
import sys
import time

INTERVAL_S = 0.1
TIMEOUT_S = 10.0


def main() -> None:
    ports = [int(port) for port in sys.argv[1:]]
    connections = {
        port: http.client.HTTPConnection("127.0.0.1", port, timeout=TIMEOUT_S) for port in ports
    }
    while not select.select([sys.stdin], [], [], INTERVAL_S)[0]:
        for port, connection in connections.items():
            began_at, started = time.time(), time.perf_counter()
            is_answered = _ask(connection)
            print(port, began_at, time.perf_counter() - started, int(is_answered), flush=True)


def _ask(connection: http.client.HTTPConnection) -> bool:
    try:
        connection.request("GET", "/livez")
        response = connection.getresponse()
        response.read()
    except (OSError, http.client.HTTPException):
        connection.close()
        return False
    return response.status == 200


if __name__ == "__main__":
    main()
