"""Mermaid diagrams of the documents as pictures, drawn when the site is built.

In the browser Mermaid puts styles into the page, which the policy of the site forbids.
"""

from __future__ import annotations

import hashlib
import json
import re
from pathlib import Path

from tools.node import run_script

_DIAGRAM = re.compile(r"^```mermaid\n(.*?)^```$", re.M | re.S)
_HEADING = re.compile(r"^#+ (.+)$", re.M)


def draw_diagrams(text: str, folder: Path) -> str:
    """Replace the diagrams of a page by pictures in its folder, which open large when clicked.

    Raises
    ------
    SystemExit
        A diagram is not understood.
    """
    diagrams = [found[1] for found in _DIAGRAM.finditer(text)]
    if not diagrams:
        return text
    pictures = iter(json.loads(run_script("diagrams.mjs", given=json.dumps(diagrams))))

    def show(diagram: re.Match[str]) -> str:
        name = f"diagram-{hashlib.sha256(diagram[1].encode()).hexdigest()[:12]}.svg"
        (folder / name).write_text(next(pictures))
        heading = _HEADING.findall(text, 0, diagram.start())[-1]
        return f"[![Diagram: {heading}]({name})]({name})"

    return _DIAGRAM.sub(show, text)
