"""The page at /, in a real browser: two clouds are dropped, and the result is seen and judged."""

from __future__ import annotations

import json
import re
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from playwright.sync_api import Browser, Page, Position, expect
from scipy.spatial.transform import Rotation

from benchmarks.demo import scan_blade
from tests.factories.browser import (
    align,
    choose_files,
    count_colors,
    count_frames,
    drop_files,
    find_barriers,
    keep_screenshot,
    opened,
    overflows,
    pixels,
    pixels_at_rest,
    share_unlike,
    wait_for_frame,
    wait_for_view,
)
from tests.factories.scans import arms, as_npy
from tests.factories.server import Server, registered, running_server
from tests.factories.slow import slow_pair
from tests.factories.tenants import caller, new_key

FAR = np.array([500_000.0, 4_000_000.0, 100.0])
TURN = Rotation.from_euler("z", 70, degrees=True).as_matrix()
SOURCE, TARGET = arms(1, 3000), arms(1, 3000) @ TURN.T
PAIR = as_npy(SOURCE), as_npy(TARGET)
MAX_CLICKS = 3
RED, BLUE, ARROWS = (200, 30, 30), (20, 40, 220), (214, 33, 154)
LABELS = json.dumps({"source": "blade-1.npy", "target": "blade-2.npy"})


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    with running_server(tmp_path_factory.mktemp("page"), require_keys=True) as running:
        yield running


@pytest.fixture(scope="module")
def key(server: Server) -> str:
    return new_key(server, "alice")


@pytest.fixture(scope="module")
def job(server: Server, key: str) -> str:
    """Id of a registration that has a result."""
    pair = as_table(SOURCE, RED), as_table(TARGET, BLUE)
    with caller(server, key) as client:
        made: str = registered(client, *pair, labels=LABELS)["id"]
        return made


def as_table(cloud: NDArray[np.float64], color: tuple[int, int, int]) -> bytes:
    """A text file whose points have one colour."""
    tail = " ".join(map(str, color))
    rows = (f"{x:.7f} {y:.7f} {z:.7f} {tail}\n" for x, y, z in cloud.tolist())
    return "".join(("x y z red green blue\n", *rows)).encode()


def test_the_walk_of_a_newcomer_from_two_files_to_a_verdict(
    browser: Browser,
    server: Server,
    key: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    record_property: Callable[[str, object], None],
) -> None:
    """The files of `make demo`; the seconds are told at the end of the run, not judged."""
    monkeypatch.chdir(tmp_path)
    Path("build/demo").mkdir(parents=True)
    source, target, _ = scan_blade()
    started = time.perf_counter()
    with opened(browser, server, key=key, moves=True) as page:
        page.evaluate("clicks = 0; addEventListener('click', () => clicks++, true)")
        drop_files(page, "form.submit", source, target)
        align(page)
        expect(page.locator(".verdict h2")).to_have_text(re.compile("Trust it|Check it"))
        wait_for_view(page)
        seconds = time.perf_counter() - started
        assert page.evaluate("clicks") <= MAX_CLICKS
        record_property("seconds from the address of the page to the result", round(seconds, 1))
        assert page.locator(".clouds").inner_text() == "source.ply onto target.ply"
        after = pixels_at_rest(page)
        assert count_colors(after) > 100
        keep_screenshot(page, "result")
        frames = count_frames(page)
        page.get_by_role("button", name="Before").click()
        before = pixels(wait_for_view(page, share=0))
        assert share_unlike(before, after) > 0.01
        assert count_frames(page) > frames + 1, "the poses are blended"
        page.get_by_role("button", name="After").click()
        wait_for_view(page)
        page.select_option("#colors", "distance")
        assert share_unlike(pixels_at_rest(page), after) > 0.01
        assert page.locator("#range").input_value()
        keep_screenshot(page, "distances")


def find_source(picture: NDArray[np.uint8]) -> Position:
    """A place where the source is drawn: it is orange."""
    red, _, blue = picture.astype(int).transpose(2, 0, 1)
    rows, columns = np.nonzero(red - blue > 80)
    middle = len(rows) // 2
    return {"x": float(columns[middle]), "y": float(rows[middle])}


def test_what_the_view_can_do(browser: Browser, server: Server, key: str, job: str) -> None:
    with opened(browser, server, f"/#/registrations/{job}", key=key, width=700) as page:
        canvas = wait_for_view(page)
        seen = pixels(canvas)

        def changes(act: Callable[[], None]) -> None:
            nonlocal seen
            before, seen = seen, wait_for_frame(page, act)
            assert share_unlike(before, seen) > 0.002

        for name in ("Top", "Front", "Side", "Reset"):
            changes(page.get_by_role("button", name=name).click)
        canvas.focus()
        changes(lambda: page.keyboard.press("ArrowLeft"))
        changes(lambda: page.keyboard.press("Home"))
        page.get_by_text("Points and section box").click()
        for control, value in (("#size", "6"), ("#cut-x-to", "0.5"), ("#cut-x-to", "1")):
            changes(lambda: page.locator(control).fill(value))  # noqa: B023
        changes(lambda: page.locator("#opacity").fill("0.2"))
        changes(lambda: page.locator("#opacity").fill("1"))
        for control in ("#show-source", "#show-target"):
            changes(page.locator(control).uncheck)
        changes(page.locator("#show-source").check)
        changes(lambda: page.select_option("#colors", "own"))
        assert has_color(seen, RED)
        assert not has_color(seen, BLUE), "the target is hidden"
        changes(lambda: page.select_option("#colors", "cloud"))
        canvas.click(position=find_source(pixels(canvas)))
        expect(page.locator(".picked")).to_contain_text("distance from the surface")


def has_color(picture: NDArray[np.uint8], color: tuple[int, int, int]) -> bool:
    """Whether some points have that hue; their brightness tells how they lie."""
    bright = picture.astype(float) / np.maximum(picture.max(axis=2, keepdims=True), 1)
    return bool((np.abs(bright - np.array(color) / max(color)).max(axis=2) < 0.06).any())


def test_open_poses_are_shown_with_their_alternatives(
    browser: Browser, server: Server, key: str, job: str
) -> None:
    with caller(server, key) as client:
        document = client.get(f"/v1/registrations/{job}").json()
    other = Rotation.from_euler("z", 180, degrees=True).as_matrix() @ TURN
    alternative = np.block([[other, np.zeros((3, 1))], [0, 0, 0, 1]]).tolist()
    about_z, along_x = [0, 0, 1, 0, 0, 0], [0, 0, 0, 1, 0, 0]
    document["result"] |= {"ambiguous": True, "alternatives": [alternative]}
    document["result"] |= {"free_directions": [about_z, along_x]}
    with opened(browser, server, key=key, width=700) as page:
        answer(page, f"/v1/registrations/{job}", 200, document)
        page.goto(f"{server.url}/#/registrations/{job}")
        best = pixels(wait_for_view(page))
        expect(page.locator(".verdict h2")).to_contain_text("Check it")
        expect(page.locator(".reasons .doubt")).to_contain_text("leave the pose open")
        assert has_color(best, ARROWS)
        shown = wait_for_frame(page, lambda: page.select_option("#alternatives", "1"))
        assert share_unlike(best, shown) > 0.01
        expect(page.locator("#colors option[value=distance]")).to_be_disabled()


def test_the_pose_in_other_forms_and_files(
    browser: Browser, server: Server, key: str, job: str, tmp_path: Path
) -> None:
    with opened(browser, server, f"/#/registrations/{job}", key=key) as page:
        with caller(server, key) as client:
            T = client.get(f"/v1/registrations/{job}").json()["result"]["transform"]
        pose = page.locator("section", has=page.get_by_role("heading", name="Pose")).locator("pre")
        assert json.loads(pose.inner_text()) == T
        page.select_option("#pose-form", label="4×4, column-major")
        assert json.loads(pose.inner_text()) == np.transpose(T).ravel().tolist()
        page.select_option("#pose-form", index=3)
        yaw = float(pose.inner_text().split("°")[0].split()[-1])
        assert yaw == pytest.approx(70, abs=0.5)
        with page.expect_download() as saved:
            page.get_by_role("button", name="Download").click()
        assert saved.value.suggested_filename == f"aligned-{job[:8]}.ply"
        assert Path(saved.value.path()).read_bytes().startswith(b"ply")
        page.fill("#unit", "mm")
        page.locator("#unit").blur()
        expect(page.locator(".numbers").first).to_contain_text(" mm")
        expect(page.locator(".verdict")).to_contain_text(" mm")
        with page.expect_download() as saved:
            page.get_by_role("button", name="Report").click()
        report = Path(saved.value.path()).read_text()
        assert "<html" in report
        assert " mm" in report
        paper = tmp_path / "report.html"
        paper.write_text(report)
        page.goto(paper.as_uri())
        keep_screenshot(page, "report", is_whole=True)
        assert page.locator("img").count() >= 5
        broken = "[...document.images].filter(image => !image.naturalWidth).length"
        assert page.evaluate(broken) == 0
        assert not overflows(page)


def test_georeferenced_clouds_are_drawn_as_exactly_as_others(
    browser: Browser, server: Server, key: str
) -> None:
    source = "\n".join(f"{x!r} {y!r} {z!r}" for x, y, z in (SOURCE + FAR).tolist()).encode()
    with caller(server, key) as client:
        far = registered(client, source, PAIR[1])["id"]
    with opened(browser, server, f"/#/registrations/{far}", key=key) as page:
        assert count_colors(pixels(wait_for_view(page))) > 100
        expect(page.locator(".notes")).to_contain_text("far apart")
        expect(page.locator(".verdict h2")).to_contain_text("Trust it")


def test_a_bad_file_is_named(browser: Browser, server: Server, key: str, tmp_path: Path) -> None:
    with opened(browser, server, key=key, expected=("415", "422")) as page:
        choose_files(page, tmp_path, b"%PDF-1.4 no cloud", PAIR[1], "npy")
        align(page)
        expect(page.locator(".face.problem")).to_contain_text("source")
        choose_files(page, tmp_path, b"1 2 3\n4 5 6\n", PAIR[1], "xyz")
        align(page)
        expect(page.locator(".card .face.problem")).to_contain_text("points")


def test_a_link_may_be_dropped(browser: Browser, server: Server, key: str) -> None:
    with opened(browser, server, key=key) as page:
        page.locator("label.zone.target").evaluate(
            """zone => {
                const dataTransfer = new DataTransfer();
                dataTransfer.setData("text/uri-list", "https://example.org/scan.ply");
                zone.dispatchEvent(new DragEvent("drop", { dataTransfer, bubbles: true }));
            }"""
        )
        expect(page.locator("#target-text")).to_have_value("https://example.org/scan.ply")


def test_options_are_sent_and_a_running_registration_is_cancelled(
    browser: Browser, server: Server, key: str, tmp_path: Path
) -> None:
    with opened(browser, server, key=key) as page:
        choose_files(page, tmp_path, *slow_pair(), "npy")
        page.get_by_text("Options", exact=True).click()
        page.get_by_text("Method", exact=True).first.click()
        page.select_option("#option-method", "mpe")
        page.select_option("#option-field", "exact")
        page.fill("#option-max_iterations", "10000")
        align(page)
        expect(page.locator(".running progress")).to_be_visible()
        page.get_by_role("button", name="Cancel").click()
        expect(page.locator(".face h3")).to_have_text("Cancelled")
        job = page.url.rpartition("/")[2]
    with caller(server, key) as client:
        options = client.get(f"/v1/registrations/{job}").json()["options"]
    assert (options["field"], options["max_iterations"]) == ("exact", 10000)


def test_a_key_is_asked_for_and_kept_in_the_tab(
    browser: Browser, server: Server, key: str, job: str
) -> None:
    with opened(browser, server, "/#/registrations", expected=("401",)) as page:
        expect(page.locator(".face.key h3")).to_have_text("A key is needed")
        page.fill("#face-key", "mpe_wrong")
        page.keyboard.press("Enter")
        expect(page.locator(".face.key h3")).to_have_text("This key is not valid")
        page.fill("#face-key", key)
        page.keyboard.press("Enter")
        expect(page.get_by_role("link", name="blade-1.npy onto blade-2.npy").first).to_be_visible()
        assert page.evaluate("[localStorage.length, document.cookie]") == [0, ""]
        page.fill("#search", "nothing of that name")
        expect(page.locator(".face h3")).to_have_text("None found")
        page.fill("#search", f"BLADE-2 {job[:6]}")
        page.get_by_role("link", name="blade-1.npy onto blade-2.npy").click()
        expect(page.locator(".verdict h2")).to_be_visible()


def answer(page: Page, path: str, status: int, document: dict[str, object]) -> None:
    """Let the service answer so."""
    page.route(
        f"**{path}",
        lambda route: route.fulfill(status=status, json=document),
    )


def test_what_is_not_there_has_a_face(browser: Browser, server: Server, key: str, job: str) -> None:
    with caller(server, key) as client:
        document = client.get(f"/v1/registrations/{job}").json() | {"result": None}
    with opened(browser, server, key=key, expected=("404", "503", "ERR_")) as page:
        answer(page, f"/v1/registrations/{job}", 200, document)
        page.goto(f"{server.url}/#/registrations/{job}")
        expect(page.locator(".face h3")).to_have_text("The result has expired")
        page.goto(f"{server.url}/#/registrations/none")
        expect(page.locator(".face h3")).to_have_text("There is no such registration")
        page.route("**/v1/registrations?*", lambda route: route.abort())
        page.goto(f"{server.url}/#/registrations")
        expect(page.locator(".face h3")).to_have_text("The service does not answer")
        page.unroute("**/v1/registrations?*")
        answer(page, "/v1/registrations?*", 200, {"items": [], "next_cursor": None})
        page.get_by_role("button", name="Try again").click()
        expect(page.locator(".face h3")).to_have_text("No registrations yet")


@pytest.mark.parametrize(("width", "dark"), [(1280, True), (390, False)])
def test_widths_themes_and_barriers(
    browser: Browser, server: Server, key: str, job: str, width: int, dark: bool
) -> None:
    with opened(browser, server, key=key, width=width, dark=dark, lets_scripts_in=True) as page:
        for name, path in (
            ("start", "/"),
            ("list", "/#/registrations"),
            ("job", f"/#/registrations/{job}"),
        ):
            page.goto(server.url + path)
            page.locator("main h1").wait_for()
            if name == "start":
                page.locator("details.options > summary").click()
            if name == "job":
                wait_for_view(page)
            keep_screenshot(page, f"{name}-{width}-{'dark' if dark else 'light'}")
            assert not overflows(page), name
            assert find_barriers(page) == [], name


def test_the_keyboard_is_enough(
    browser: Browser, server: Server, key: str, job: str, tmp_path: Path
) -> None:
    with opened(browser, server, key=key) as page:
        choose_files(page, tmp_path, *PAIR, "npy")
        reached = set()
        for _ in range(20):
            page.keyboard.press("Tab")
            reached.add(
                page.evaluate("document.activeElement.id || document.activeElement.textContent")
            )
            if page.evaluate("document.activeElement.textContent") == "Align":
                break
        assert {"source-file", "target-file", "source-kind", "Options", "Align"} <= reached
        page.keyboard.press("Enter")
        expect(page.locator(".verdict h2")).to_be_visible()


def test_the_page_is_bound_to_its_own_host_and_its_files_are_cached(server: Server) -> None:
    page = server.client.get("/")
    policy = page.headers["Content-Security-Policy"]
    assert "default-src 'none'" in policy
    assert "unsafe" not in policy
    assert page.headers["Cache-Control"] == "no-cache"
    script = page.text.split('src="')[1].split('"')[0]
    asset = server.client.get(f"/{script}")
    assert "immutable" in asset.headers["Cache-Control"]
    known = server.client.get(f"/{script}", headers={"If-None-Match": asset.headers["ETag"]})
    assert (known.status_code, known.content) == (304, b"")
    for name in ("none.js", "..%2Findex.html", "%2e%2e%2findex.html", ".", "main.ts"):
        assert server.client.get(f"/assets/{name}").status_code == 404


def test_the_documents_are_there_without_another_host(browser: Browser, server: Server) -> None:
    with opened(browser, server) as page:
        page.get_by_role("link", name="Documents").click()
        expect(page.locator("h1").first).to_contain_text("mpe")
        page.get_by_role("link", name="API reference").click()
        expect(page.locator("h3", has_text="Align a source cloud")).to_be_visible()
        page.goto(f"{server.url}/docs/architecture.html")
        diagrams = page.get_by_role("img", name="Diagram")
        assert diagrams.count() == 3
        for diagram in diagrams.all():
            assert diagram.evaluate("image => image.decode().then(() => image.naturalWidth)") > 300
    policy = server.client.get("/docs/").headers["Content-Security-Policy"]
    assert "unsafe" not in policy
    assert server.client.get("/docs").headers["Location"] == "docs/"
    for path in ("none.html", "..%2Fpage/index.html", "%2e%2e/page/index.html", "assets"):
        assert server.client.get(f"/docs/{path}").status_code == 404
