"""The page of `hijack view` in a real browser, driven by real mouse and key events."""

import json
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

import hijack_data as hj
from pipelines import build, open_dataset

from support.chromium import Browser
from support.viewing import edit, served

ROOT = Path(__file__).resolve().parents[3]
ERRORS = ("Log.entryAdded", "Runtime.exceptionThrown", "Runtime.consoleAPICalled")
PICTURES = "[...document.images].filter(i => i.offsetParent && i.getAttribute('src'))"
STANDS = "!document.getElementById('grid').hidden || !document.getElementById('trouble').hidden"
SHOWN = "!document.getElementById('detail').hidden && !document.querySelector('.frame.loading')"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """One trajectory of the recorded examples, 8 steps: 32 lazy rows."""
    home = tmp_path_factory.mktemp("view")
    source = home / "source"
    shutil.copytree(ROOT / "examples" / "recordings", source)
    lines = (source / "trajectories.jsonl").read_text().splitlines(keepends=True)
    (source / "trajectories.jsonl").write_text(
        "".join(x for x in lines if json.loads(x)["trajectory_id"] == "notes")
    )
    planners = {"marks": hj.Marks(), "subtitle": hj.Subtitle(), "resolution": hj.Resolution()}
    build(source, home / "rows", corruptions=planners, seed=7, output="lazy")
    return home / "rows"


@pytest.fixture(scope="module")
def url(folder: Path) -> Iterator[str]:
    with served(folder) as server:
        yield server.url


def visit(
    browser: Browser, url: str, width: int = 1280, height: int = 900, scheme: str = "light"
) -> None:
    """Open an address, and wait until what it is about stands there."""
    browser.open(url, width, height, scheme)
    browser.until(f"{STANDS} || {SHOWN}")
    browser.until(
        f"{PICTURES}.filter(i => i.getBoundingClientRect().top < innerHeight).every(i =>"
        " i.complete)"
    )


def text(browser: Browser, selector: str) -> str:
    return browser.js(f"document.querySelector({selector!r}).textContent")


def box(browser: Browser, selector: str) -> dict[str, float]:
    return browser.js(f"document.querySelector({selector!r}).getBoundingClientRect().toJSON()")


def choose(browser: Browser, name: str, value: str) -> None:
    field = f"document.querySelector('[name={name}]')"
    browser.js(
        f"{field}.value = {value!r}; {field}.dispatchEvent(new Event('input', {{bubbles: true}}))"
    )


def test_the_page_loads_without_errors_or_outside_requests(browser: Browser, url: str) -> None:
    visit(browser, url)
    assert browser.js("document.querySelectorAll('.tile').length") == 32
    assert browser.js(f"{PICTURES}.slice(0, 8).every(i => i.naturalWidth === 480)")
    assert text(browser, "#count") == "32 of 32 rows"
    assert text(browser, "#facts") == "32 rows, lazy dataset, 1 file"
    assert browser.of(*ERRORS) == []
    addresses = {request["request"]["url"] for request in browser.of("Network.requestWillBeSent")}
    assert all(
        address.startswith((url.partition("?")[0], "data:", "about:")) for address in addresses
    )
    fields = (
        "[...document.querySelectorAll('input, select, button, a')].filter(e => e.offsetParent)"
    )
    unnamed = (
        f"{fields}.filter(e => !(e.labels?.length || e.textContent.trim() || e.ariaLabel)).length"
    )
    assert browser.js(unnamed) == 0


def test_filters_and_search_change_the_count_and_the_address(browser: Browser, url: str) -> None:
    visit(browser, url)
    assert browser.js(
        "[...document.querySelector('[name=corruption]').options].map(o => o.textContent)"
    ) == ["all", "clean (8)", "marks (8)", "subtitle (8)", "resolution (8)"]
    choose(browser, "corruption", "marks")
    browser.until("document.getElementById('count').textContent", "8 of 32 rows")
    assert browser.js("location.hash") == "#corruption=marks"
    assert browser.js(
        "[...document.querySelectorAll('.chip.first')].every(c => c.textContent === 'marks')"
    )
    choose(browser, "q", "0003")
    browser.until("document.getElementById('count').textContent", "1 of 32 rows")
    assert text(browser, ".tile .title") == "notes · step 3"
    choose(browser, "q", "no such+text")
    browser.until("document.getElementById('count').textContent", "No row matches")
    assert browser.js("location.hash") == "#corruption=marks&q=no%20such%2Btext"
    browser.js("document.getElementById('clear').click()")
    browser.until("document.getElementById('count').textContent", "32 of 32 rows")
    assert browser.js("document.querySelector('[name=corruption]').value") == ""
    browser.js("history.back()")
    browser.until("document.getElementById('count').textContent", "No row matches")
    visit(browser, f"{url}#q=packing list&corruption=subtitle")
    assert (text(browser, "#count"), browser.js("document.querySelector('[name=q]').value")) == (
        "8 of 32 rows",
        "packing list",
    )
    visit(browser, f"{url}#q=a+b")
    assert browser.js("document.querySelector('[name=q]').value") == "a+b"
    assert browser.of(*ERRORS) == []


def test_the_divider_moves_between_before_and_after(browser: Browser, url: str) -> None:
    visit(browser, f"{url}#row=notes%2F0001%2Fmarks")
    browser.until("document.getElementById('before').complete")
    frame = box(browser, "#frame")
    y = frame["y"] + frame["height"] / 2

    def drag(start: float, end: float) -> None:
        browser.mouse("mousePressed", frame["x"] + start * frame["width"], y)
        browser.mouse("mouseMoved", frame["x"] + end * frame["width"], y)
        browser.mouse("mouseReleased", frame["x"] + end * frame["width"], y)

    drag(0.5, 0.25)
    value = "document.querySelector('#frame input').value"
    assert browser.js(value) == "25"
    assert (
        browser.js("getComputedStyle(document.getElementById('after')).clipPath")
        == "inset(0px 0px 0px 25%)"
    )
    browser.key("ArrowRight", 39)
    assert browser.js(value) == "26"
    # the key was the divider's, not the rows'
    assert text(browser, "#name") == "notes · step 1 · marks"
    drag(0.26, 1.0)
    assert red(browser, frame) == 0
    drag(0.99, 0.0)
    assert red(browser, frame) > 500


def red(browser: Browser, frame: dict[str, float]) -> int:
    x, y, w, h = (round(frame[key]) for key in ("x", "y", "width", "height"))
    part = browser.pixels()[y : y + h, x : x + w]
    return int(((part[..., 0] > 220) & (part[..., 1] < 40) & (part[..., 2] < 40)).sum())


@pytest.mark.parametrize("row", ["notes/0000/marks", "notes/0000/resolution"])
@pytest.mark.parametrize("width", [1280, 600])
def test_the_overlay_lies_on_the_target(
    browser: Browser, url: str, folder: Path, row: str, width: int
) -> None:
    stored = next(array for array in open_dataset(folder) if array["id"] == row)
    visit(browser, f"{url}#row={row}", width=width)
    frame, drawn, point = (
        box(browser, selector) for selector in ("#frame", "rect.target", "circle.action")
    )
    scale = frame["width"] / stored["width"]
    x1, y1, x2, y2 = stored["target_box"]
    expected = np.array([x1 * scale, y1 * scale, (x2 - x1) * scale, (y2 - y1) * scale])
    array = np.array(
        [drawn["x"] - frame["x"], drawn["y"] - frame["y"], drawn["width"], drawn["height"]]
    )
    assert np.abs(array - expected).max() < 1.5
    middle = (
        point["x"] + point["width"] / 2 - frame["x"],
        point["y"] + point["height"] / 2 - frame["y"],
    )
    assert (
        np.abs(
            np.array(middle) - [stored["action"]["x"] * scale, stored["action"]["y"] * scale]
        ).max()
        < 1.5
    )
    visible = (
        "[...document.querySelectorAll('#over > *')].filter(e => getComputedStyle(e).display !=="
        " 'none').length"
    )
    both = browser.js(visible)
    browser.js("document.querySelector('[data-layer=target]').click()")
    assert browser.js(visible) == both - 2
    browser.js("document.querySelector('[data-layer=action]').click()")
    assert browser.js(visible) == 0


def test_keys_go_through_rows_and_steps(browser: Browser, url: str) -> None:
    visit(browser, f"{url}#corruption=marks")
    browser.js("document.querySelectorAll('.tile a')[2].click()")
    name = "document.getElementById('name').textContent"
    browser.until(name, "notes · step 2 · marks")
    browser.until("document.activeElement.id", "name")
    assert text(browser, "#position") == "3 of 8"
    browser.key("ArrowRight", 39)
    browser.until(name, "notes · step 3 · marks")
    browser.key("ArrowLeft", 37)
    browser.until(name, "notes · step 2 · marks")
    browser.js(
        "[...document.querySelectorAll('#same a')].find(a => a.textContent === 'subtitle').click()"
    )
    browser.until(name, "notes · step 2 · subtitle")
    assert text(browser, "#position") == "not in the filter"
    browser.key("ArrowRight", 39, shift=True)
    browser.until(name, "notes · step 3 · subtitle")
    browser.key("ArrowLeft", 37, shift=True)
    browser.until(name, "notes · step 2 · subtitle")
    browser.key("Escape", 27)
    browser.until("document.getElementById('grid').hidden", False)
    assert browser.js("location.hash") == "#corruption=marks"
    assert browser.of(*ERRORS) == []


def test_a_clean_row_says_why_there_is_nothing_before(browser: Browser, url: str) -> None:
    visit(browser, f"{url}#row=0")
    assert text(browser, "#size") == "1920×1080  No picture before: this is the clean picture."
    assert browser.js("document.querySelector('#frame input').offsetParent") is None
    assert browser.js("getComputedStyle(document.getElementById('after')).clipPath") == "none"
    assert browser.of(*ERRORS) == []


def test_all_columns_and_the_plan_are_there(browser: Browser, url: str, folder: Path) -> None:
    visit(browser, f"{url}#row=1")
    row = open_dataset(folder)[1]
    cells = (
        "[...document.querySelectorAll('#fields div')].map(d => [...d.children].map(e =>"
        " e.textContent))"
    )
    entries = dict(browser.js(cells))
    assert set(row) - set(entries) == {"plan", "screenshot"}
    assert (entries["id"], entries["image_sha256"]) == (row["id"], row["image_sha256"])
    plan = text(browser, "#plan code")
    assert "\n" in plan
    assert json.loads(plan) == json.loads(row["plan"])


def test_what_is_broken_shows_its_message(browser: Browser, folder: Path, tmp_path: Path) -> None:
    shutil.copytree(folder, tmp_path / "rows")
    file = next((tmp_path / "rows" / "data").iterdir())
    edit(
        file,
        plan_digest=lambda old: [old[0], "0" * 64, *old[2:]],
        instruction=lambda old: ["<img src=x onerror=alert(1)>", *old[1:]],
    )
    manifest = json.loads((tmp_path / "rows" / "manifest.json").read_text())
    manifest["shards"].append({**manifest["shards"][0], "file": "data/<b>gone</b>.parquet"})
    (tmp_path / "rows" / "manifest.json").write_text(json.dumps(manifest))
    with served(tmp_path / "rows") as server:
        url = server.url
        visit(browser, url)
        browser.until(
            "document.querySelectorAll('.tile')[1].textContent.includes('gives another plan here')"
        )
        assert browser.js(f"{PICTURES}.slice(0, 6).every(i => i.naturalWidth)")
        assert text(browser, "#problems li").startswith(
            "data/<b>gone</b>.parquet: its 32 rows are left out"
        )
        visit(browser, f"{url}#row=0")
        assert text(browser, "#instruction") == "<img src=x onerror=alert(1)>"
        browser.js("document.getElementById('next').click()")
        browser.until("document.getElementById('frame').hidden")
        browser.until(
            "document.getElementById('problem').textContent.includes('gives another plan here')"
        )
        assert text(browser, "#instruction").startswith("Write a short packing list")
        browser.key("ArrowRight", 39)
        browser.until(f"!document.getElementById('frame').hidden && {SHOWN}")
        assert browser.js("document.getElementById('problem').hidden")
        visit(browser, f"{url}#row=77")
        assert text(browser, "#trouble").startswith("there is no row '77' here")
        assert browser.of("Page.javascriptDialogOpening", "Runtime.exceptionThrown") == []


def test_a_server_that_has_ended_is_said(browser: Browser, url: str) -> None:
    visit(browser, url)
    network = {"latency": 0, "downloadThroughput": -1, "uploadThroughput": -1}
    browser.call("Network.emulateNetworkConditions", offline=True, **network)
    try:
        choose(browser, "corruption", "marks")
        browser.until("document.getElementById('trouble').textContent.startsWith('No answer')")
    finally:
        browser.call("Network.emulateNetworkConditions", offline=False, **network)
    choose(browser, "corruption", "subtitle")
    browser.until("document.getElementById('count').textContent", "8 of 32 rows")
    assert browser.js("document.getElementById('trouble').hidden")


def test_help_and_search_have_keys(browser: Browser, url: str) -> None:
    visit(browser, f"{url}#row=1")
    browser.key("?", 191, shift=True)
    browser.until("document.querySelector('dialog').open")
    browser.js("document.querySelector('dialog button').click()")
    browser.key("/", 191)
    browser.until("document.activeElement.name", "q")
    assert not browser.js("document.getElementById('grid').hidden")
    assert browser.of(*ERRORS) == []


@pytest.mark.parametrize("width", [360, 600, 1280, 2400])
def test_the_page_fits_every_width(browser: Browser, url: str, width: int) -> None:
    for place in ("", "#row=1"):
        visit(browser, url + place, width=width)
        browser.js("for (const d of document.querySelectorAll('details')) d.open = true")
        assert browser.js("document.documentElement.scrollWidth") <= width
        assert browser.js("window.scrollY") == 0


def test_dark_and_light(browser: Browser, url: str) -> None:
    visit(browser, url, scheme="light")
    assert browser.pixels()[3, 3].min() > 230
    visit(browser, url, scheme="dark")
    assert browser.pixels()[3, 3].max() < 30


@pytest.mark.parametrize("size", [(400, 300), (320, 180), (240, 500), (900, 200)])
def test_tiles_show_the_whole_picture_and_what_was_done(
    size: tuple[int, int], browser: Browser, recording: Any, tmp_path: Path
) -> None:
    """A cell that grows with the picture would cut its lower part off."""
    source = recording(trajectories=1, steps=1)
    Image.fromarray(np.full((size[1], size[0], 3), 90, np.uint8)).save(
        source / "images" / "t0-0.png"
    )
    build(source, tmp_path / "out", corruptions={"half": hj.Resolution(scale=0.5)})
    with served(tmp_path / "out") as server:
        visit(browser, server.url)
        cell, picture = box(browser, ".thumb"), box(browser, ".thumb img")
        assert all(
            abs(picture[side] - cell[side]) < 1 for side in ("left", "top", "right", "bottom")
        )
        assert box(browser, ".thumb svg") == picture
        assert (
            browser.js("getComputedStyle(document.querySelector('.thumb img')).objectFit")
            == "contain"
        )
        assert browser.js("document.querySelector('.thumb svg').viewBox.baseVal.width") == size[0]
        assert text(browser, ".tile .task") == "do t0"
        assert text(browser, ".tile .done") == "click at (100, 50)"
        assert text(browser, ".tile .size") == f"{size[0]}×{size[1]}"
        assert browser.js("document.querySelectorAll('.thumb .target').length") == 2
        drawn = browser.js(
            "(r => [r.x, r.y, r.width, r.height].map(v => v.baseVal.value))"
            "(document.querySelectorAll('.tile')[1].querySelector('rect.target'))"
        )
        assert drawn == [45, 20, 20, 10]
        assert browser.of(*ERRORS) == []
