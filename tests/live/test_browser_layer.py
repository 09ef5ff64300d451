"""`layer="dom"`: the nodes of a plan are its picture, in the tree, unseen by the page, and erased again."""

import json
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest

from hijack_data import Marks, PopUps, Resolution, Subtitle, apply
from hijack_data.corruption import Corruption
from hijack_data.errors import ParameterError
from hijack_data.runs.page_layer import MAX_DIFFERENCE
from hijack_data.types import Scene
from online_env.browser.desktop import BrowserDesktop
from online_env.browser.site import FolderSite
from online_env.environment.script import Script
from online_env.errors import MissingCapabilityError
from online_env.tasks import Hand

from support import needs

SIZE = (480, 642)
CORRUPTIONS = [
    PopUps(width=300, height=200, avoid_elements=False),
    Marks(number=8),
    Marks(mark_type="circle", number=8),
    Subtitle(fit="shrink"),
]
# What a page may have against nodes of others: a policy, transforms, filters, rules for everything, a dialog on top.
HARD = """<meta http-equiv="Content-Security-Policy" content="default-src 'none'; style-src 'unsafe-inline';
 script-src 'unsafe-inline'"><style>
* { color: lime !important; margin: 7px; font-size: 40px; visibility: inherit }
html { zoom: 1.5 } body { transform: rotate(4deg); filter: invert(1); opacity: .5; display: flex; overflow: hidden;
 visibility: hidden; background: url(none), linear-gradient(45deg, red, blue) }
div, canvas, button { transform: scale(2) !important; display: none !important }
</style><p>Text <b>of</b> a page<dialog id=d>Modal</dialog><script>d.showModal()</script>"""
PLAIN = "<style>body { background: linear-gradient(45deg, red, blue) }</style><p>Text <b>of</b> a page<button>Here</button>"
STATE = """JSON.stringify([document.documentElement.outerHTML, document.querySelectorAll('*').length, document.body.innerText,
 document.body.shadowRoot, document.body.firstElementChild.assignedSlot, events,
 Object.keys(globalThis).length, document.activeElement.tagName, globalThis.changes])"""
WATCH = """<script>changes = 0; events = [];
new MutationObserver(list => changes += list.length).observe(document, {subtree: true, childList: true, attributes: true});
for (const type of ['pointerdown', 'mousedown', 'mouseup', 'mousemove', 'click', 'wheel', 'blur', 'resize', 'toggle', 'focusin'])
  addEventListener(type, event => events.push(type), true);</script>"""


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Iterator[FolderSite]:
    """A site with the pages of these tests."""
    needs.chromium()
    site = FolderSite("pages.test", tmp_path_factory.mktemp("site"))
    yield site
    site.close()


@pytest.fixture(scope="module", params=[1, 3])
def browser(site: FolderSite, request: pytest.FixtureRequest) -> Iterator[BrowserDesktop]:
    """A browser with 1 or 3 pixels for a CSS pixel."""
    with BrowserDesktop.up(SIZE, request.param, site.arguments) as desktop:
        yield desktop


@pytest.fixture
def open_html(site: FolderSite, browser: BrowserDesktop) -> Callable[..., BrowserDesktop]:
    """Opens a page with a given content."""

    def show(html: str, name: str = "page.html") -> BrowserDesktop:
        assert site.folder is not None
        (site.folder / name).write_text(html)
        browser.reset({"url": site.url(name)})
        return browser

    return show


def plan_for(corruption: Corruption) -> Any:
    return corruption.plan(Scene(SIZE), seed=3)


@pytest.mark.parametrize(
    "corruption", CORRUPTIONS, ids=lambda c: c.params().get("mark_type", c.name)
)
@pytest.mark.parametrize("html", [PLAIN, HARD], ids=["plain", "hard"])
def test_the_nodes_are_the_picture_and_the_tree_and_unseen_by_the_page(
    html: str, corruption: Corruption, open_html: Callable[..., BrowserDesktop]
) -> None:
    browser = open_html(f"<!doctype html><meta charset=utf-8><body>{WATCH}{html}")
    plan = plan_for(corruption)
    clean = browser.screenshot()
    state = browser.evaluate(STATE)
    assert browser.page_layer.draw(plan) == ""
    picture = browser.screenshot()
    probe = browser.page_layer.probe(plan, picture)
    assert probe.ok, probe
    assert probe.facts["pixels"] > 1000
    if html == PLAIN:
        browser.evaluate("getSelection().selectAllChildren(document.documentElement)")
        probe = browser.page_layer.probe(plan, browser.screenshot())
        assert probe.ok, "the text of a node can be selected"
        browser.evaluate("getSelection().empty()")
    difference = np.abs(picture.astype(int) - apply(plan, clean))
    assert difference.max() <= MAX_DIFFERENCE
    assert browser.evaluate(STATE) == state
    nodes = Hand(browser, 2).look()
    for op in plan.ops:
        boxes = {node.box for node in nodes if node.role == "dialog"}
        if op.sprite["draw"] == "window":
            (x, y), (w, h) = op.at[0], op.sprite["size"]
            # a page's own modal dialog makes all else inert, and inert nodes have no roles
            assert boxes == ({(x, y, x + w, y + h)} if html == PLAIN else set())
            assert ("OK" in {node.name for node in nodes if node.role == "push-button"}) == (
                html == PLAIN
            )
        for line in op.sprite.get("lines", []) or [
            line for panel in op.sprite.get("panels", []) for line in panel["lines"]
        ]:
            assert any(node.name.strip() == line for node in nodes), line
    assert browser.page_layer.erase().ok
    assert np.array_equal(browser.screenshot(), clean)
    assert browser.evaluate(STATE) == state


def test_a_click_on_the_nodes_never_reaches_the_page_and_its_button_closes_them(
    open_html: Callable[..., BrowserDesktop],
) -> None:
    browser = open_html(f"<!doctype html><body>{WATCH}<input autofocus><p>Text")
    plan = plan_for(CORRUPTIONS[0])
    browser.page_layer.draw(plan)
    (x, y), (w, h) = plan.ops[0].at[0], plan.ops[0].sprite["size"]
    browser.run(f"pyautogui.click({x + 20}, {y + 20})")
    browser.run(f"pyautogui.scroll(-3, {x + 20}, {y + 20})")
    events = set(browser.evaluate("events"))
    assert not events & {"pointerdown", "mousedown", "mouseup", "click", "blur", "wheel"}
    assert browser.page_layer.probe(plan, browser.screenshot()).ok
    browser.run(f"pyautogui.click({x + w // 2}, {y + h - 10})")
    assert not browser.page_layer.probe(plan, browser.screenshot()).ok
    assert "click" not in browser.evaluate("events")
    browser.run("pyautogui.click(5, 5)")
    assert "click" in browser.evaluate("events")
    browser.evaluate("events = [], 0")
    marks = plan_for(Marks())  # nothing but a dialog takes clicks
    browser.page_layer.draw(marks)
    x, y = max(marks.ops[0].at)
    browser.run(f"pyautogui.click({x + 20}, {y + 20})")
    assert "click" in browser.evaluate("events")


@pytest.mark.parametrize(
    ("name", "content", "problem"),
    [
        (
            "page.svg",
            "<svg xmlns='http://www.w3.org/2000/svg'><rect width='9' height='9'/></svg>",
            "no body of HTML",
        ),
        (
            "own.html",
            "<body><script>document.body.attachShadow({mode: 'closed'})</script>",
            "shadow root of its own",
        ),
        ("frames.html", "<frameset cols='50%,50%'><frame><frame></frameset>", "no body of HTML"),
    ],
)
def test_documents_that_cannot_hold_nodes_are_refused_with_the_reason(
    name: str, content: str, problem: str, open_html: Callable[..., BrowserDesktop]
) -> None:
    browser = open_html(content, name)
    assert problem in browser.page_layer.draw(plan_for(Marks()))
    assert not browser.page_layer.probe(plan_for(Marks()), browser.screenshot()).ok
    assert browser.page_layer.erase().ok


def test_a_page_that_covers_the_nodes_or_is_zoomed_or_left_is_noticed(
    open_html: Callable[..., BrowserDesktop],
) -> None:
    browser = open_html(
        f"<!doctype html><body>{PLAIN}<dialog id=d style='inset: 0; margin: 0; border: 0; width: 100%;"
        " max-width: none; height: 100%; max-height: none'>Modal</dialog>"
    )
    plan = plan_for(Marks())
    browser.page_layer.draw(plan)
    browser.evaluate("d.showModal()")
    assert "differ" in browser.page_layer.probe(plan, browser.screenshot()).problem
    assert browser.page_layer.draw(plan) == ""  # drawn again, they are on top
    assert browser.page_layer.probe(plan, browser.screenshot()).ok
    browser.evaluate("document.body.replaceWith(document.createElement('body'))")
    assert not browser.page_layer.probe(plan, browser.screenshot()).ok
    assert browser.page_layer.draw(plan) == ""
    assert browser.page_layer.probe(plan, browser.screenshot()).ok
    browser.call("Emulation.setPageScaleFactor", pageScaleFactor=2)
    assert "zoomed" in browser.page_layer.draw(plan)
    browser.navigate("about:blank")
    assert browser.page_layer.erase().ok


def test_what_no_node_can_be_is_refused_before_the_episode(site: FolderSite) -> None:
    class Machine:
        size = SIZE
        capabilities = frozenset()

    class Browser(Machine):
        page_layer = None

    with pytest.raises(ParameterError, match="resizes the picture"):
        Script(Resolution(), 0, "x", (), SIZE).check(3, Browser(), layer="dom")  # pyright: ignore
    with pytest.raises(MissingCapabilityError, match="not on Machine"):
        Script(Marks(), 0, "x", (), SIZE).check(3, Machine(), layer="dom")  # pyright: ignore


@pytest.mark.slow
def test_a_run_has_the_same_plans_on_both_layers_is_verified_and_built(tmp_path: Path) -> None:
    pytest.importorskip("miniwob", reason=needs.BROWSER)
    needs.chromium()
    digests = {}
    for layer in ("picture", "dom"):
        config = tmp_path / f"{layer}.yaml"
        config.write_text(
            "desktop: {provider: browser, size: [960, 720]}\nagents: [oracle]\ntasks: [miniwob/enter-text.html]\n"
            f"corruptions: [pop_ups, marks, subtitle: {{fit: shrink}}]\nseeds: [0]\nmax_steps: 6\nlayer: {layer}\n"
        )
        run = tmp_path / layer
        hijack("bench", config, "--desktops", "1", "--out", run)
        steps = [
            json.loads(line)
            for file in sorted(run.glob("episodes/*/steps.jsonl"))
            for line in file.read_text().splitlines()
        ]
        digests[layer] = [(step["plan_digest"], step["image_sha256"]) for step in steps[:1]]
        drawn = [step["layer"] for step in steps if "layer" in step]
        assert bool(drawn) == (layer == "dom")
        assert all(facts["difference"] <= MAX_DIFFERENCE for facts in drawn)
        assert "all identical" in hijack("verify", run)
    assert digests["dom"] == digests["picture"]
    built = hijack("build", tmp_path / "dom", "--out", tmp_path / "set", "--corruptions", "marks")
    assert "rows" in built
    hijack("verify", tmp_path / "set")
    head = json.loads((tmp_path / "dom" / "run.json").read_text())
    del head["config"]["layer"]
    (tmp_path / "dom" / "run.json").write_text(json.dumps(head))
    assert "the browser drew nothing in this run" in hijack("verify", tmp_path / "dom", code=1)


def hijack(*words: object, code: int = 0) -> str:
    process = subprocess.run(
        [sys.executable, "-m", "hijack_data.cli", *map(str, words)],
        capture_output=True,
        text=True,
        check=False,
    )
    assert process.returncode == code, process.stdout + process.stderr
    return process.stdout


def test_gymnasium_takes_the_layer() -> None:
    pytest.importorskip("miniwob", reason=needs.BROWSER)
    needs.chromium()
    import online_env  # noqa: F401

    env = gymnasium.make(
        "AgentHijack/Browser-v0", task="miniwob/click-test.html", corruption="pop_ups", layer="dom"
    )
    try:
        observation, _ = env.reset(seed=0)
        assert observation["screenshot"].shape == (720, 960, 3)
    finally:
        env.close()
