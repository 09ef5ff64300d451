"""The gallery page in a real browser, driven by real mouse and key events."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import hijack_data as hj
from hijack_data.gallery import gallery

from support.chromium import Browser

PAINT = ("pop_ups", "resolution", "marks", "subtitle")
ACT = ("multi_apps", "accidental_touch", "app_minimization", "network_error", "verification")
OFFLINE, LIVE = len(PAINT), len(ACT)
HOSTILE = "<img src=x onerror=alert(1)>.png"


@pytest.fixture(scope="module")
def page_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """All nine corruptions of two pictures, one of them with a name that is markup."""
    folder = tmp_path_factory.mktemp("page")
    image = np.full((768, 1024, 3), (230, 232, 236), np.uint8)
    image[60:340, 80:440] = 255
    for x in range(100, 400, 90):
        image[80:104, x : x + 70] = (60, 110, 200)
    shots = [folder / "first.png", folder / HOSTILE]
    for shot in shots:
        Image.fromarray(image).save(shot)
    planners = {name: hj.make_corruption(name) for name in (*PAINT, *ACT)} | {
        "subtitle": hj.Subtitle(fit="shrink")
    }
    path = folder / "gallery.html"
    path.write_text(gallery(shots, seed=7, planners=planners).html, encoding="utf-8")
    return path


def test_the_page_runs_without_errors_or_requests(browser: Browser, page_file: Path) -> None:
    browser.open(page_file.as_uri())
    assert browser.js("document.documentElement.className") == "js"
    assert browser.js("document.querySelectorAll('.tile').length") == 2 * (OFFLINE + LIVE)
    assert browser.js(
        "[...document.images].filter(i => i.complete && i.naturalWidth).length"
    ) == 2 * (OFFLINE + LIVE)
    assert browser.js("document.querySelector('h2').textContent") == "first.png"
    assert browser.of("Log.entryAdded", "Runtime.exceptionThrown", "Runtime.consoleAPICalled") == []
    assert browser.of("Page.javascriptDialogOpening") == []
    urls = {request["request"]["url"] for request in browser.of("Network.requestWillBeSent")}
    assert page_file.as_uri() in urls
    assert all(url == page_file.as_uri() or url.startswith("data:") for url in urls)


def test_nothing_else_on_the_page_can_run(
    browser: Browser, page_file: Path, tmp_path: Path
) -> None:
    text = page_file.read_text(encoding="utf-8")
    evil = (
        "<script>document.title = 'owned'</script><img src='data:,' onerror=\"document.title ="
        " 'owned'\">"
    )
    path = tmp_path / "evil.html"
    path.write_text(text.replace("<main>", f"<main>{evil}"), encoding="utf-8")
    browser.open(path.as_uri())
    assert browser.js("document.title") == "AgentHijack gallery"
    assert browser.of("Log.entryAdded") != []


FRAME = "document.querySelectorAll('.frame')[{0}]"


def place(browser: Browser, index: int) -> dict[str, float]:
    frame = FRAME.format(index)
    browser.js(f"{frame}.scrollIntoView({{block: 'center'}})")
    return browser.js(
        f"(r => ({{x: r.x, y: r.y, w: r.width, h: r.height}}))({frame}.getBoundingClientRect())"
    )


def test_the_divider_follows_mouse_and_keys(browser: Browser, page_file: Path) -> None:
    browser.open(page_file.as_uri())
    index = 2  # marks on the first picture
    box = place(browser, index)
    value = f"{FRAME.format(index)}.querySelector('input').value"
    clip = f"getComputedStyle({FRAME.format(index)}.querySelector('.after')).clipPath"
    y = box["y"] + box["h"] / 2
    browser.mouse("mousePressed", box["x"] + 0.25 * box["w"], y)
    assert (browser.js(value), browser.js(clip)) == ("25", "inset(0px 0px 0px 25%)")
    browser.mouse("mouseMoved", box["x"] + 0.7 * box["w"], y)
    assert browser.js(value) == "70"
    browser.mouse("mouseReleased", box["x"] + 0.7 * box["w"], y)
    browser.mouse("mouseMoved", box["x"] + 0.1 * box["w"], y)
    assert browser.js(value) == "70"
    browser.key("ArrowRight", 39)
    browser.key("ArrowRight", 39)
    assert (browser.js(value), browser.js(clip)) == ("72", "inset(0px 0px 0px 72%)")
    browser.key("End", 35)
    assert browser.js(value) == "100"
    assert (
        browser.js(f"{FRAME.format(index)}.querySelector('input').getAttribute('aria-valuetext')")
        == "100 percent before"
    )
    assert red(browser.pixels(), box) == 0
    browser.key("Home", 36)
    assert red(browser.pixels(), box) > 500


def red(pixels: np.ndarray, box: dict[str, float]) -> int:
    x, y, w, h = (round(box[key]) for key in "xywh")
    part = pixels[y : y + h, x : x + w]
    return int(((part[..., 0] > 220) & (part[..., 1] < 40) & (part[..., 2] < 40)).sum())


def test_filters_overlays_and_enlarging(browser: Browser, page_file: Path) -> None:
    browser.open(page_file.as_uri())
    text = "[...document.querySelectorAll('.tile')].filter(t => t.offsetParent)"
    visible = f"{text}.map(t => t.querySelector('h3').textContent)"
    browser.js("document.querySelector('[data-filter=\"2\"]').click()")
    assert browser.js(visible) == ["marks", "marks"]
    browser.js("document.querySelector('[data-filter=\"8\"]').click()")
    assert browser.js(visible) == ["verification", "verification"]
    browser.js("document.querySelector('[data-filter=\"\"]').click()")
    assert len(browser.js(visible)) == 2 * (OFFLINE + LIVE)
    count = (
        "[...document.querySelectorAll('.over path')].filter(p => getComputedStyle(p).display !="
        " 'none').length"
    )
    assert browser.js(count) == 0
    browser.js("document.querySelector('.tile [data-layer=boxes]').click()")
    assert browser.js(count) == 2  # shown and covered elements of one tile
    browser.js("document.querySelector('.bar [data-layer=painted]').click()")
    assert browser.js(count) == 2 + 2 * (OFFLINE + LIVE)
    marks = browser.js(
        "document.querySelectorAll('.tile')[2].querySelector('.painted').getAttribute('d')"
    )
    assert marks.count("M") == 50
    inside = (
        "(s => { const b = s.getBBox(); return [b.x >= -40, b.y >= -40, b.x + b.width <= 1064] })"
    )
    assert (
        browser.js(f"{inside}(document.querySelectorAll('.tile')[2].querySelector('.painted'))")
        == [True] * 3
    )
    before = place(browser, 1)["w"]
    browser.js("document.querySelectorAll('.enlarge')[1].click()")
    assert place(browser, 1)["w"] > before


def test_without_scripts_both_pictures_stand_side_by_side(
    browser: Browser, page_file: Path
) -> None:
    browser.call("Emulation.setScriptExecutionDisabled", value=True)
    try:
        browser.open(page_file.as_uri())
        text = (
            "[...document.querySelectorAll('.tile:not(.card) {0}')].map(e =>"
            " e.getBoundingClientRect().toJSON())"
        )
        left, right = (browser.js(text.format(name)) for name in (".before", ".after"))
        assert len(left) == len(right) == 2 * (OFFLINE + LIVE)
        for a, b in zip(left, right, strict=True):
            assert a["width"] > 200
            assert abs(a["width"] / a["height"] - 4 / 3) < 0.02
            assert (a["y"], a["width"], a["height"]) == (b["y"], b["width"], b["height"])
            assert a["right"] <= b["left"]
        assert browser.js("getComputedStyle(document.querySelector('.after')).clipPath") == "none"
        assert browser.js("document.querySelector('.bar').offsetParent") is None
    finally:
        browser.call("Emulation.setScriptExecutionDisabled", value=False)


@pytest.mark.parametrize("width", [320, 420, 900, 2400])
def test_the_page_fits_every_width(browser: Browser, page_file: Path, width: int) -> None:
    browser.open(page_file.as_uri(), width=width)
    browser.js("for (const d of document.querySelectorAll('details')) d.open = true")
    assert browser.js("document.documentElement.scrollWidth") <= width
    columns = browser.js(
        "getComputedStyle(document.querySelector('.grid')).gridTemplateColumns.split(' ').length"
    )
    assert columns == {320: 1, 420: 1, 900: 1, 2400: 4}[width]


def test_dark_and_light(browser: Browser, page_file: Path) -> None:
    browser.open(page_file.as_uri(), scheme="light")
    light = browser.pixels()
    browser.open(page_file.as_uri(), scheme="dark")
    dark = browser.pixels()
    assert light[5, 5].min() > 230
    assert dark[5, 5].max() < 30


def test_three_real_screenshots_make_a_page_that_can_be_mailed(
    shared_data: Path, browser: Browser, tmp_path: Path
) -> None:
    names = (
        "138_UI-TARS-desktop_base_url.png",
        "183_OmniParser_excel.png",
        "022_OpenCUA_OH23HT37NP.png",
    )
    page = gallery([shared_data / "screenshots" / name for name in names], seed=7)
    assert page.problems == ()
    assert len(page.html) < 6_000_000
    path = tmp_path / "real.html"
    path.write_text(page.html, encoding="utf-8")
    browser.open(path.as_uri())
    assert browser.js("document.querySelectorAll('.frame').length") == 27
    assert browser.of("Log.entryAdded", "Runtime.exceptionThrown") == []
