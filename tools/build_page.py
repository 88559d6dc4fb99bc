"""Build the page of the service from web/, with the node of the virtual environment.

python -m tools.build_page             the packages of web/package-lock.json, types, bundle
python -m tools.build_page --packages  the packages alone
"""

from __future__ import annotations

import sys
from pathlib import Path

from tools.node import install_packages, run_script

OUTPUT = Path(__file__).parent.parent / "service" / "api" / "static" / "page"

if __name__ == "__main__":
    install_packages()
    if "--packages" not in sys.argv:
        run_script("node_modules/typescript/bin/tsc")
        run_script("build.mjs", str(OUTPUT))
