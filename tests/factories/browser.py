"""Debian's chromium, driven by Playwright: pages that must not complain, and what they show."""

from __future__ import annotations

import io
import os
import shutil
from base64 import b64encode
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from playwright.sync_api import Browser, Locator, Page, Playwright, expect

from tests.factories.server import PROJECT, Server

WAIT_S = 120
"""A busy machine takes a minute for a registration."""
SCREENSHOTS = PROJECT / "build" / "screenshots"
AXE = PROJECT / "web" / "node_modules" / "axe-core" / "axe.min.js"
WITHOUT_GPU = ["--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
SERIOUS = ("serious", "critical")

expect.set_options(timeout=WAIT_S * 1000)


def find_chromium() -> Path | None:
    """The browser of the Debian package, if it is installed."""
    found = shutil.which("chromium")
    return None if found is None else Path(found)


def launch(playwright: Playwright, program: Path) -> Browser:
    sandbox = ["--no-sandbox"] if os.getuid() == 0 else []
    return playwright.chromium.launch(executable_path=program, args=[*WITHOUT_GPU, *sandbox])


@contextmanager
def opened(
    browser: Browser,
    server: Server,
    path: str = "/",
    *,
    key: str | None = None,
    width: int = 1280,
    dark: bool = False,
    lets_scripts_in: bool = False,
    moves: bool = False,
    expected: tuple[str, ...] = (),
) -> Iterator[Page]:
    """A page of the service in a tab of its own; it must log no error but the expected ones.

    `lets_scripts_in` suspends the Content-Security-Policy, for axe-core. Poses are blended where
    the page `moves`; a software renderer takes seconds for that.
    """
    complaints: list[str] = []
    context = browser.new_context(
        viewport={"width": width, "height": 844 if width < 500 else 900},
        color_scheme="dark" if dark else "light",
        bypass_csp=lets_scripts_in,
        reduced_motion="no-preference" if moves else "reduce",
    )
    page = context.new_page()
    page.set_default_timeout(WAIT_S * 1000)
    page.on("pageerror", lambda error: complaints.append(str(error)))
    page.on("console", lambda said: complaints.append(said.text) if said.type == "error" else None)
    page.on("request", lambda asked: _check_host(asked.url, server, complaints))
    if key is not None:
        page.add_init_script(f"sessionStorage.setItem('mpe-key', '{key}')")
    page.goto(server.url + path)
    yield page
    context.close()
    unexpected = [text for text in complaints if not any(part in text for part in expected)]
    assert unexpected == []


def _check_host(url: str, server: Server, complaints: list[str]) -> None:
    if not url.startswith((server.url, "data:", "blob:", "file:")):
        complaints.append(f"another host: {url}")


def choose_files(page: Page, folder: Path, source: bytes, target: bytes, ending: str) -> None:
    for role, content in (("source", source), ("target", target)):
        path = folder / f"{role}.{ending}"
        path.write_bytes(content)
        page.set_input_files(f"#{role}-file", path)


def drop_files(page: Page, place: str, *paths: Path) -> None:
    """Drop files there at once, as from a window of files."""
    files = [(path.name, b64encode(path.read_bytes()).decode()) for path in paths]
    page.locator(place).evaluate(
        """(place, files) => {
            const dataTransfer = new DataTransfer();
            for (const [name, text] of files) {
                const bytes = Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
                dataTransfer.items.add(new File([bytes], name));
            }
            place.dispatchEvent(new DragEvent("drop", { dataTransfer, bubbles: true }));
        }""",
        files,
    )


def align(page: Page) -> None:
    page.get_by_role("button", name="Align").click()


def wait_for_view(page: Page, share: int = 1) -> Locator:
    """The canvas, once it shows the source before (0) or after (1) the motion."""
    expect(page.locator(".stage3d")).to_have_attribute("data-share", str(share))
    return page.locator(".stage3d canvas")


def wait_for_frame(page: Page, act: Callable[[], object]) -> NDArray[np.uint8]:
    """What the canvas shows after an act that draws it anew."""
    stage = page.locator(".stage3d")
    drawn = stage.get_attribute("data-frames")
    act()
    expect(stage).not_to_have_attribute("data-frames", str(drawn))
    return pixels(stage.locator("canvas"))


def count_frames(page: Page) -> int:
    """How often the view was drawn."""
    return int(page.locator(".stage3d").get_attribute("data-frames") or 0)


def pixels_at_rest(page: Page) -> NDArray[np.uint8]:
    """What the canvas shows once all points are drawn, which a slow renderer leaves for later."""
    stage = page.locator(".stage3d")
    expect(stage).to_have_attribute("data-drawn", "all")
    return pixels(stage.locator("canvas"))


def pixels(place: Locator) -> NDArray[np.uint8]:
    """What is on the screen there, (H, W, 3)."""
    return np.asarray(Image.open(io.BytesIO(place.screenshot())).convert("RGB"))


def count_colors(picture: NDArray[np.uint8]) -> int:
    return len(np.unique(picture.reshape(-1, 3), axis=0))


def share_unlike(one: NDArray[np.uint8], other: NDArray[np.uint8]) -> float:
    """Share of the pixels that differ clearly."""
    unlike = np.abs(one.astype(int) - other).max(axis=2) > 40
    return float(unlike.mean())


def keep_screenshot(page: Page, name: str, *, is_whole: bool = False) -> None:
    """An artefact of the run; docs/images has two of them."""
    SCREENSHOTS.mkdir(parents=True, exist_ok=True)
    page.screenshot(path=SCREENSHOTS / f"{name}.png", full_page=is_whole)


def find_barriers(page: Page) -> list[str]:
    """What axe-core calls serious or critical."""
    page.evaluate(AXE.read_text())
    found: list[dict[str, Any]] = page.evaluate("axe.run().then(result => result.violations)")
    return [
        f"{each['id']}: {[node['target'] for node in each['nodes']]}"
        for each in found
        if each["impact"] in SERIOUS
    ]


def overflows(page: Page) -> bool:
    """Whether the page is wider than the window."""
    wide: bool = page.evaluate("document.documentElement.scrollWidth > innerWidth")
    return wide
