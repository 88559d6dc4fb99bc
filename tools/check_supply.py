"""What ships: no GPL, and no known vulnerability that a newer release has put right.

Both are asked of requirements.lock, the runtime set. Vulnerabilities need the network: without it
the question is left open, loudly.
"""

from __future__ import annotations

import json
import re
import subprocess
import sys
from importlib.metadata import PackageNotFoundError, metadata
from pathlib import Path

LOCK = Path(__file__).parent.parent / "requirements.lock"
COPYLEFT = re.compile(r"(?<!L)GPL|Affero|(?<!Lesser )General Public License")
AUDIT_TIMEOUT_S = 60


def main() -> int:
    """Print the problems of what ships; 1 if there is one."""
    names = sorted(set(re.findall(r"^([\w.-]+)==", LOCK.read_text(), re.M)))
    problems = [text for name in names if (text := licence_problem(name))]
    problems += _vulnerabilities()
    for text in problems:
        print(text, file=sys.stderr)
    print(f"supply: {len(names)} packages, {len(problems)} problems")
    return 1 if problems else 0


def licence_problem(name: str) -> str | None:
    """Say why the package must not ship; None if it may, or is not installed here."""
    try:
        found = metadata(name)
    except PackageNotFoundError:
        return None
    words = found.get("License-Expression") or "; ".join(
        [item for item in found.get_all("Classifier") or () if item.startswith("License ::")]
    )
    words = words or (found.get("License") or "").split("\n")[0]
    if not words:
        return f"{name}: its metadata names no licence"
    return f"{name}: {words}" if COPYLEFT.search(words) else None


def _vulnerabilities() -> list[str]:
    """List packages with a known vulnerability and a release without it."""
    command = [sys.executable, "-m", "pip_audit", "--requirement", str(LOCK), "--disable-pip"]
    command += ["--require-hashes", "--format=json", "--progress-spinner=off"]
    try:
        done = subprocess.run(
            command, capture_output=True, text=True, check=False, timeout=AUDIT_TIMEOUT_S
        )
        report = json.loads(done.stdout)
        packages = report["dependencies"]
    except (subprocess.TimeoutExpired, ValueError, KeyError):
        packages = [{"name": "all packages", "skip_reason": "the advisory service gave no answer"}]
    skipped = [package for package in packages if "skip_reason" in package]
    if skipped:
        names = ", ".join(package["name"] for package in skipped)
        print(f"!!! NOT CHECKED FOR VULNERABILITIES: {names}", file=sys.stderr)
        print(f"!!! because: {skipped[0]['skip_reason']}", file=sys.stderr)
    return [
        f"{package['name']} {package['version']}: {hole['id']}, fixed in {hole['fix_versions']}"
        for package in packages
        for hole in package.get("vulns", ())
        if hole["fix_versions"]
    ]


if __name__ == "__main__":
    sys.exit(main())
