"""Whether worker processes start on this system, as `mpe doctor` tells."""

from __future__ import annotations

from service.workers.child import Child, NoProcessError, prepare_forkserver, stop_forkserver


def find_start_failure() -> str | None:
    """Start a process as the service does; return why it does not start, None where it does."""
    prepare_forkserver(1)
    child = Child()
    try:
        child.wait_until_ready()
    except NoProcessError as error:
        return str(error)
    finally:
        child.kill()
        child.close()
        stop_forkserver()
    return None
