"""The page of a run in a real browser, driven by real mouse and key events."""

import json
import shutil
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from hijack_data.runs.run_log import sha256_hex
from pipelines.viewer.opening import open_source
from pipelines.viewer.runs import RunSource
from pipelines.viewer.runs.export import export_file

from support.chromium import Browser
from support.edited_runs import read_lines, write_lines
from support.recorded import Straw
from support.viewed_runs import HOSTILE, Cast, episode_id, play_run
from support.viewing import served

ERRORS = ("Log.entryAdded", "Runtime.exceptionThrown", "Runtime.consoleAPICalled")
DIALOGS = ("Page.javascriptDialogOpening",)
MARKS = episode_id("write_note", "marks", "gpt-9")
PEER = episode_id("write_note", "marks", "pixel")
CLEAN = episode_id("write_note", "clean", "gpt-9")
MINIMISED = episode_id("write_note", "app_minimization", "gpt-9")
READY = (
    "(!document.getElementById('overview').hidden || !document.getElementById('trouble').hidden ||"
    " !document.getElementById('episode').hidden) && !document.querySelector('.frame.loading')"
)
COUNT = "document.getElementById('count').textContent"
STEP = "document.getElementById('step').textContent"
ROWS = "[...document.querySelectorAll('#list li')].sort((a, b) => a.ariaPosInSet - b.ariaPosInSet)"
VALUE = "document.querySelector('.frame input').value"


@pytest.fixture(scope="module")
def url(played: Path) -> Iterator[str]:
    with served(played) as server:
        yield server.url


def visit(
    browser: Browser, url: str, width: int = 1280, height: int = 900, scheme: str = "light"
) -> None:
    """Open an address, and wait until what it is about stands there."""
    browser.open(url, width, height, scheme)
    browser.until(READY)


def text(browser: Browser, selector: str) -> str:
    return browser.js(f"document.querySelector({selector!r}).textContent")


def click(browser: Browser, selector: str) -> None:
    browser.js(f"document.querySelector({selector!r}).click()")


def choose(browser: Browser, name: str, value: str) -> None:
    field = f"document.querySelector('#filters [name={name}]')"
    browser.js(
        f"{field}.value = {value!r}; {field}.dispatchEvent(new Event('input', {{bubbles: true}}))"
    )


def test_what_an_agent_was_given_stands_below_its_name(browser: Browser, harmed: Path) -> None:
    lines = read_lines(harmed / "records.jsonl")
    message = [row | {"given": ["plan"]} if row["agent"] == "pixel" else row for row in lines]
    write_lines(harmed / "records.jsonl", message)
    with served(harmed) as server:
        visit(browser, server.url)
        notes = "[...document.querySelectorAll('#table .given')].map(n => n.textContent)"
        assert browser.js(notes) == ["given the task's plan in words"]
        visit(browser, f"{server.url}#episode={PEER}")
        assert text(browser, ".view .who") == "pixel · given the task's plan in words"


def test_the_table_leads_to_its_episodes(browser: Browser, url: str) -> None:
    visit(browser, url)
    cells = "[...document.querySelectorAll('#table td')].map(c => c.textContent)"
    assert browser.js(cells) == ["100 %2", "0 %2", "50 %2", "50 %2", "0 %2", "25 %2"]
    assert browser.js("[...document.querySelectorAll('#table th')].map(c => c.textContent)") == [
        "success, %",
        "clean",
        "marks",
        "app_minimization",
        "pixel",
        "gpt-9",
    ]
    assert browser.js(COUNT) == "12 of 12 episodes"
    browser.js("document.querySelectorAll('#table td a')[5].click()")
    browser.until(COUNT, "2 of 12 episodes")
    assert browser.js("location.hash") == "#agent=gpt-9&corruption=app_minimization"
    rows = browser.js(f"{ROWS}.map(r => r.querySelector('.outcome').textContent)")
    assert rows == ["partial 0.5", "agent error"]
    assert browser.js("document.querySelectorAll('#table a[aria-current]').length") == 1
    assert browser.of(*ERRORS, *DIALOGS) == []
    addresses = {request["request"]["url"] for request in browser.of("Network.requestWillBeSent")}
    assert all(
        address.startswith((url.partition("?")[0], "data:", "about:")) for address in addresses
    )


def test_filters_search_and_order_are_in_the_address(browser: Browser, url: str) -> None:
    visit(browser, url)
    choose(browser, "outcome", "success")
    browser.until(COUNT, "3 of 12 episodes")
    choose(browser, "agent", "pixel")
    browser.until(COUNT, "2 of 12 episodes")
    options = "[...document.querySelector('#filters [name=agent]').options].map(o => o.textContent)"
    assert browser.js(options) == ["all", "pixel (2)", "gpt-9 (1)"]
    choose(browser, "q", "PACKING")
    browser.until(COUNT, "1 of 12 episodes")
    assert browser.js("location.hash") == "#outcome=success&agent=pixel&q=PACKING"
    choose(browser, "q", "nowhere")
    browser.until(COUNT, "No episode matches")
    click(browser, "#clear")
    browser.until(COUNT, "12 of 12 episodes")
    visit(browser, f"{url}#q=endpoint is gone&sort=-corruption")
    assert browser.js(COUNT) == "3 of 12 episodes"
    labels = f"{ROWS}.map(r => r.querySelector('.label').textContent)"
    assert browser.js(labels) == ["app_minimization", "marks", "clean"]
    heads = "[...document.querySelectorAll('#heads button')]"
    browser.js(f"{heads}[2].click()")
    browser.until(f"{labels}.join()", "clean,marks,app_minimization")
    assert "sort" not in browser.js("location.hash")
    browser.js(f"{heads}[3].click()")
    browser.until("location.hash", "#q=endpoint%20is%20gone&sort=agent")
    assert browser.of(*ERRORS) == []


def test_an_episode_is_stepped_through_by_keys(browser: Browser, url: str) -> None:
    visit(browser, f"{url}#agent=gpt-9&episode={MARKS}")
    assert text(browser, "#name") == "write_note-7 · marks · seed 7"
    assert (text(browser, "#position"), browser.js(STEP)) == ("2 of 6", "step 0 of 6")
    assert text(browser, ".action-words") == "click at (101, 50)"
    assert "Checked the screen" in text(browser, ".talk")
    assert text(browser, ".figures").startswith("tokens in1,200tokens out40")
    browser.key("ArrowRight", 39)
    browser.until(STEP, "step 1 of 6")
    assert browser.js("location.hash").endswith("&step=1")
    assert text(browser, ".words") == HOSTILE
    assert "<i>nothing</i>" in text(browser, ".talk")
    browser.key("End", 35)
    browser.until(STEP, "step 6 of 6")
    assert text(browser, ".action-words") == "None: this is the last screen"
    browser.key("ArrowLeft", 37)
    browser.until(STEP, "step 5 of 6")
    browser.key("ArrowLeft", 37)
    browser.until(STEP, "step 4 of 6")
    assert text(browser, ".refused").startswith("Refused: line 1")
    browser.key("ArrowRight", 39, shift=True)
    browser.until(
        "document.getElementById('name').textContent", "write_note-7 · app_minimization · seed 7"
    )
    assert browser.js(STEP) == "step 0 of 6"
    browser.key("ArrowLeft", 37, shift=True)
    browser.until("document.getElementById('name').textContent", "write_note-7 · marks · seed 7")
    browser.key("Escape", 27)
    browser.until("document.getElementById('overview').hidden", False)
    assert browser.js("location.hash") == "#agent=gpt-9"
    browser.until(f"document.activeElement.title === {MARKS!r}")
    browser.key("ArrowDown", 40)
    browser.until(f"document.activeElement.title === {MINIMISED!r}")
    assert browser.of(*ERRORS, *DIALOGS) == []


def test_help_and_search_have_keys(browser: Browser, url: str) -> None:
    visit(browser, f"{url}#episode={MARKS}")
    browser.key("?", 191, shift=True)
    browser.until("document.querySelector('dialog').open")
    browser.key("ArrowRight", 39)
    assert browser.js(STEP) == "step 0 of 6"
    click(browser, "dialog button")
    browser.until("document.querySelector('dialog').open", False)
    browser.key("/", 191)
    browser.until("document.activeElement.name", "q")
    assert browser.js("location.hash") == ""


def test_the_divider_stands_between_the_clean_screen_and_the_corrupted(
    browser: Browser, url: str
) -> None:
    visit(browser, f"{url}#episode={MARKS}&step=1")
    browser.until("document.querySelector('.before').complete")
    sides = [browser.js(f"document.querySelector('.{name}').src") for name in ("before", "after")]
    place = browser.js("document.querySelector('.view').dataset.place")
    base = url.partition("?")[0]
    assert sides == [f"{base}clean/{place}", f"{base}seen/{place}"]
    browser.key("b", 66)
    assert browser.js(VALUE) == "100"
    assert red(browser) == 0
    browser.key("b", 66)
    assert browser.js(VALUE) == "0"
    assert red(browser) > 300


def red(browser: Browser) -> int:
    frame = browser.js("document.querySelector('.frame').getBoundingClientRect().toJSON()")
    x, y, w, h = (round(frame[key]) for key in ("x", "y", "width", "height"))
    part = browser.pixels()[y : y + h, x : x + w]
    return int(((part[..., 0] > 200) & (part[..., 1] < 60) & (part[..., 2] < 60)).sum())


def test_beside_an_effect_stands_the_step_before_it(browser: Browser, url: str) -> None:
    visit(browser, f"{url}#episode={MINIMISED}&step=1")
    assert text(browser, ".tag.left") == "step 0"
    assert browser.js("document.querySelector('.before').src").endswith("/0")
    assert "minimise" in text(browser, ".happened")
    assert browser.js("document.querySelectorAll('.happened .probe:not(.no)').length") == 2
    visit(browser, f"{url}#episode={MINIMISED}&step=2")
    assert "the agent saw the clean screen" in text(browser, ".size")
    assert browser.js("document.querySelector('.frame input').offsetParent") is None


@pytest.mark.parametrize("width", [1280, 420])
def test_actions_are_drawn_where_they_were(browser: Browser, url: str, width: int) -> None:
    visit(browser, f"{url}#episode={MARKS}&step=0", width=width)
    frame, circle = (
        browser.js(f"document.querySelector({name!r}).getBoundingClientRect().toJSON()")
        for name in (".frame", "circle.action")
    )
    scale = frame["width"] / 320
    middle = np.array([circle["x"] + circle["width"] / 2, circle["y"] + circle["height"] / 2])
    assert np.abs(middle - [frame["x"] + 101 * scale, frame["y"] + 50 * scale]).max() < 2
    browser.key("ArrowRight", 39)
    browser.until(STEP, "step 1 of 6")
    paths = browser.js(
        "[...document.querySelectorAll('path.action')].map(p => p.getAttribute('d'))"
    )
    assert paths[0] == "M20 30L200 120"
    browser.key("ArrowRight", 39)
    browser.key("ArrowRight", 39)
    browser.until(STEP, "step 3 of 6")
    assert text(browser, ".typed") == "types Hello <b>you</b>"
    assert text(browser, ".over .number") == "double"
    click(browser, "[data-layer=action]")
    assert browser.js("getComputedStyle(document.querySelector('.typed')).display") == "none"
    assert browser.js("getComputedStyle(document.querySelector('circle.action')).display") == "none"


def test_two_agents_stand_beside_each_other_on_the_same_episode(browser: Browser, url: str) -> None:
    visit(browser, f"{url}#episode={MARKS}&step=2")
    assert browser.js("[...document.getElementById('beside').options].map(o => o.textContent)") == [
        "nothing",
        "pixel (failure)",
        "gpt-9, clean (success)",
    ]
    browser.key("c", 67)
    browser.until("document.querySelectorAll('.view:not([hidden])').length", 2)
    assert browser.js("location.hash").endswith(f"beside={PEER}")
    browser.until(
        "[...document.querySelectorAll('.after')].every(i => i.complete && i.naturalWidth)"
    )
    who = "[...document.querySelectorAll('.view .who')].map(e => e.textContent)"
    assert browser.js(who) == ["gpt-9", "pixel"]
    browser.key("ArrowRight", 39)
    browser.until(STEP, "step 3 of 6")
    assert browser.js(
        "[...document.querySelectorAll('.strip a[aria-current]')].map(a => a.dataset.step)"
    ) == ["3", "3"]
    tops = "[...document.querySelectorAll('.frame')].map(f => f.getBoundingClientRect().top)"
    assert len(set(browser.js(tops))) == 1
    browser.key("c", 67)
    browser.until("document.querySelectorAll('.view:not([hidden])').length", 1)
    assert browser.of(*ERRORS, *DIALOGS) == []


class LastFirst(Cast):
    """Plays its episodes in the opposite order, as desktops side by side may end them."""

    @property
    def jobs(self) -> list[Straw]:
        return super().jobs[::-1]


def test_conditions_and_agents_stand_in_the_order_of_the_run(
    browser: Browser, tmp_path: Path
) -> None:
    with served(play_run(tmp_path / "run", LastFirst())) as server:
        visit(browser, f"{server.url}#episode={MARKS}")
        groups = "[...document.querySelectorAll('#kin div')]"
        names = browser.js(
            f"{groups}.map(g => [...g.querySelectorAll('a')].map(a => a.textContent))"
        )
    assert names == [["clean", "marks", "app_minimization"], ["pixel", "gpt-9"]]


def test_only_the_rows_in_view_are_in_the_page(
    browser: Browser, played: Path, tmp_path: Path
) -> None:
    folder = many(played, tmp_path / "many", 1200)
    with served(folder) as server:
        visit(browser, server.url, height=700)
        assert browser.js(COUNT) == "1,200 of 1,200 episodes"
        assert browser.js("document.querySelectorAll('#list li').length") < 60
        browser.js("window.scrollTo(0, document.body.scrollHeight)")
        browser.until(f"{ROWS}.at(-1).ariaPosInSet", "1200")
        assert browser.js("document.querySelectorAll('#list li').length") < 60
        last = browser.js(f"{ROWS}.at(-1).getBoundingClientRect().bottom")
        assert last <= 700
        browser.js(f"{ROWS}.at(-1).querySelector('a').click()")
        browser.until("document.getElementById('position').textContent", "1,200 of 1,200")
        browser.key("Escape", 27)
        browser.until("document.activeElement.closest('li')?.ariaPosInSet", "1200")
        assert browser.js("window.scrollY") > 10000
        assert browser.of(*ERRORS) == []


def many(played: Path, folder: Path, count: int) -> Path:
    """A journal of so many episodes, whose folders are gone."""
    folder.mkdir()
    content = (played / "run.json").read_bytes()
    (folder / "run.json").write_bytes(content)
    record = read_lines(played / "records.jsonl")[1]
    lines: list[dict[str, object]] = []
    for number in range(count):
        lines.append(record | {"id": f"e{number}", "seed": number, "previous": sha256_hex(content)})
        content = json.dumps(lines[-1], ensure_ascii=False).encode()
    write_lines(folder / "records.jsonl", lines)
    return folder


def test_chosen_episodes_open_without_a_server(
    browser: Browser, played: Path, tmp_path: Path
) -> None:
    source = open_source(played)
    assert isinstance(source, RunSource)
    file = tmp_path / "chosen.html"
    assert export_file(source, ["write_note*__gpt-9", PEER], file) == 4
    visit(browser, file.as_uri())
    assert browser.js(COUNT) == "4 of 4 episodes"
    assert browser.js("document.querySelectorAll('#list input').length") == 0
    browser.js("location.hash = '#agent=gpt-9&corruption=marks'")
    browser.until(COUNT, "1 of 4 episodes")
    click(browser, "#list a")
    browser.until(READY)
    browser.until("document.querySelector('.after').naturalWidth", 320)
    browser.until("document.querySelector('.before').naturalWidth", 320)
    browser.key("ArrowRight", 39)
    browser.until(STEP, "step 1 of 6")
    assert text(browser, ".words") == HOSTILE
    browser.key("c", 67)
    browser.until("document.querySelectorAll('.view:not([hidden])').length", 2)
    browser.until("document.querySelectorAll('.after')[1].naturalWidth", 320)
    browser.until(
        "document.getElementById('checked').textContent.startsWith('hijack verify finds no')"
    )
    assert browser.of(*ERRORS, *DIALOGS) == []
    addresses = {request["request"]["url"] for request in browser.of("Network.requestWillBeSent")}
    assert all(address.startswith(("file:", "data:", "about:")) for address in addresses)


def test_the_page_exports_what_was_chosen(browser: Browser, url: str) -> None:
    visit(browser, f"{url}#agent=gpt-9")
    export = "document.getElementById('export')"
    assert browser.js(f"{export}.getAttribute('aria-disabled')") == "true"
    browser.js(f"{ROWS}[1].querySelector('input').click()")
    assert browser.js(f"{export}.textContent") == "Export 1"
    browser.js(f"{ROWS}[0].querySelector('a').focus()")
    browser.key("x", 88)
    assert browser.js(f"{export}.getAttribute('href')") == "export?episodes=6,7"
    page = browser.js(
        f"(r => (r.open('GET', {export}.href, false), r.send(), r.responseText))(new XMLHttpRequest())"
    )
    assert (MARKS in page, PEER in page) == (True, False)
    assert "</script><script>alert" not in page


def test_damage_is_a_message_and_never_a_blank_page(browser: Browser, harmed: Path) -> None:
    home = harmed / "episodes" / MARKS
    (home / "frames" / "0001.seen.png").write_bytes(b"\x89PNG\r\n\x1a\n rubbish")
    (home / "frames" / "0002.png").unlink()
    rows = read_lines(home / "steps.jsonl")
    rows[3]["said"] = HOSTILE * 3
    write_lines(home / "steps.jsonl", rows)
    shutil.rmtree(harmed / "episodes" / MINIMISED)
    with served(harmed) as server:
        visit(browser, f"{server.url}#episode={MARKS}&step=0")
        browser.until("document.querySelector('.damage').textContent.includes('does not follow')")
        assert text(browser, ".words").startswith("The title bar")
        browser.key("ArrowRight", 39)
        browser.until(
            "document.querySelector('.stage > .trouble').textContent.includes('0001.seen.png')"
        )
        browser.key("ArrowRight", 39)
        browser.until(
            "document.querySelector('.stage > .trouble').textContent.includes('The clean screen')"
        )
        browser.key("ArrowRight", 39)
        browser.until(STEP, "step 3 of 6")
        assert text(browser, ".words") == HOSTILE * 3
        browser.until("!document.querySelector('.frame').hidden")
        visit(browser, f"{server.url}#episode={MINIMISED}")
        assert "its steps are lost" in text(browser, ".damage")
        assert "app_minimization" in text(browser, ".record-fields")
        visit(browser, f"{server.url}#episode=nobody")
        assert text(browser, "#trouble").startswith("There is no episode nobody here.")
        assert browser.of("Runtime.exceptionThrown", *DIALOGS) == []


@pytest.mark.parametrize("width", [360, 1280])
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_the_page_fits_every_width(browser: Browser, url: str, width: int, scheme: str) -> None:
    for place in ("", f"#episode={MARKS}&step=3", f"#episode={MARKS}&beside={CLEAN}"):
        visit(browser, url + place, width=width, scheme=scheme)
        browser.js("for (const d of document.querySelectorAll('details')) d.open = true")
        assert browser.js("document.documentElement.scrollWidth") <= width
        bright = browser.pixels()[3, 3]
        assert bright.min() > 230 if scheme == "light" else bright.max() < 30
    fields = (
        "[...document.querySelectorAll('input, select, button, a')].filter(e => e.offsetParent)"
    )
    unnamed = (
        f"{fields}.filter(e => !(e.labels?.length || e.textContent.trim() || e.ariaLabel)).length"
    )
    assert browser.js(unnamed) == 0
