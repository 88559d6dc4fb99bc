"""The page's view of two clouds of 200,000 points: frames a second while it is turned."""

from __future__ import annotations

import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
import psutil
from playwright.sync_api import Browser, sync_playwright

from benchmarks.experiment import Experiment, Result, markdown
from service.clouds.preview import choose_rows, write_preview
from service.formats import DecodedCloud
from service.report.pictures import draw_before_after
from tests.factories.browser import find_chromium, launch, opened, wait_for_view
from tests.factories.clouds import knot
from tests.factories.scans import as_npy
from tests.factories.server import Server, registered, running_server

POINTS = 200_000
"""Most that the page draws of a cloud."""
WARM_UP_S, SECONDS = 4.0, 8.0
"""Seconds until the page has found how many points it can draw in time, and that are measured."""
PICTURE_POINTS = 100_000
SIZES = {"1280 x 900": 1280, "390 x 844": 390}
EVERY_POINT = "performance.now = () => 0"
"""Waits look short to the page, so that it never leaves points out; frames have their own clock."""
TURN = """seconds => new Promise(resolve => {
    const stage = document.querySelector(".stage3d");
    const canvas = stage.querySelector("canvas");
    const times = [], drawn = [];
    const step = now => {
        times.push(now);
        drawn.push(stage.dataset.drawn);
        if (now - times[0] > 1000 * seconds) return resolve({ times, drawn });
        canvas.dispatchEvent(new KeyboardEvent("keydown", { key: "ArrowLeft" }));
        requestAnimationFrame(step);
    };
    requestAnimationFrame(step);
})"""
"""Turn the view a step each frame; the times are those of the browser."""


def run() -> Result:
    """Measure, and return the figures that the page shows."""
    program = find_chromium()
    if program is None:
        raise SystemExit("there is no browser: install the Debian package chromium")
    with (
        tempfile.TemporaryDirectory() as folder,
        running_server(Path(folder) / "data") as server,
        sync_playwright() as playwright,
    ):
        cloud = as_npy(knot(3000, np.random.default_rng(1)))
        path = f"/#/registrations/{registered(server.client, cloud, cloud)['id']}"
        preview = _write_preview(Path(folder) / "preview")
        browser = launch(playwright, program)
        rows = [
            {"size": size, "every": every} | _measure(browser, server, path, preview, width, every)
            for size, width in SIZES.items()
            for every in (False, True)
        ]
        renderer = _name_renderer(browser, server)
    return {"rows": rows, "renderer": renderer, "picture_s": _time_picture()}


def _write_preview(path: Path) -> bytes:
    """Return a preview as the service makes it, without its waits."""
    cloud = DecodedCloud(knot(POINTS, np.random.default_rng(1)), "npy")
    write_preview(path, cloud, choose_rows(cloud.points, POINTS), np.zeros(POINTS))
    return path.read_bytes()


def _measure(
    browser: Browser, server: Server, path: str, preview: bytes, width: int, every: bool
) -> Result:
    with opened(browser, server, width=width) as page:
        page.route("**/preview?*", lambda route: route.fulfill(body=preview))
        if every:
            page.add_init_script(EVERY_POINT)
            page.reload()
        page.goto(server.url + path)
        wait_for_view(page)
        page.evaluate(TURN, WARM_UP_S)
        began_s = _count_cpu_s()
        turned: dict[str, list[Any]] = page.evaluate(TURN, SECONDS)
        cpu_s = _count_cpu_s() - began_s
    waits = np.diff(turned["times"])
    drawn = [2 * POINTS if each == "all" else int(each) for each in turned["drawn"]]
    return {
        "frames_per_s": 1000 / float(waits.mean()),
        "slowest_ms": float(np.percentile(waits, 95)),
        "cpu_ms": 1000 * cpu_s / len(waits),
        "points": float(np.median(drawn)),
    }


def _time_picture() -> float:
    """Return the processor seconds of the picture before and after of two clouds."""
    cloud = knot(PICTURE_POINTS, np.random.default_rng(1))
    began_s = time.process_time()
    draw_before_after(cloud + 0.5, cloud, cloud)
    return time.process_time() - began_s


def _count_cpu_s() -> float:
    """Return the processor time of the browser's processes."""
    found = psutil.Process().children(recursive=True)
    times = [each.cpu_times() for each in found if "chrom" in each.name()]
    return sum(each.user + each.system for each in times)


def _name_renderer(browser: Browser, server: Server) -> str:
    with opened(browser, server) as page:
        name: str = page.evaluate(
            """() => {
                const gl = document.createElement("canvas").getContext("webgl2");
                const { UNMASKED_RENDERER_WEBGL } = gl.getExtension("WEBGL_debug_renderer_info");
                return gl.getParameter(UNMASKED_RENDERER_WEBGL);
            }"""
        )
        return name


def table(result: Result) -> str:
    """Return the figures with what they are."""
    rows = [
        (
            row["size"],
            "every point" if row["every"] else "as many as there is time for",
            row["points"],
            row["frames_per_s"],
            row["slowest_ms"],
            row["cpu_ms"],
        )
        for row in result["rows"]
    ]
    columns = (
        *("window", "drawn while it turns", "points", "frames a second", "95 % within ms"),
        "processor ms a frame",
    )
    return (
        f"Two clouds of {POINTS:,} points, turned by the keyboard for {SECONDS:.0f} s, in headless "
        "chromium without a graphics card; times are those of the browser's frames, after "
        f"{WARM_UP_S:.0f} s of turning. The page draws fewer points where frames come late, all "
        "of them as soon as the view rests. 30 frames a second are 33 ms each. Processor time is "
        "that of all cores, of the browser alone.\n\n"
        f"{markdown(columns, rows)}\n\nRenderer: {result['renderer']}.\n\n"
        f"`preview.png` of two clouds of {PICTURE_POINTS:,} points: {result['picture_s']:.2g} s."
    )


PAGE = Experiment("page", "The page's view", run, table)
