"""python -m benchmarks.pictures: one picture for each step of the method, for docs/method.md."""

from __future__ import annotations

from pathlib import Path

from benchmarks.pictures import PICTURES, draw, tell

FOLDER = Path(__file__).parent.parent.parent / "docs" / "pictures"

if __name__ == "__main__":
    story = tell()
    FOLDER.mkdir(exist_ok=True)
    for picture in PICTURES:
        path = draw(picture, story, FOLDER)
        print(f"{path.stat().st_size / 1000:4.0f} kB  {path}")
