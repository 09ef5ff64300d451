"""A real Chromium as a desktop: effects, tasks of MiniWoB++, runs, and pages that misbehave."""

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from hijack_data.errors import ConfigError, ParameterError
from online_env.agents.base import DONE, WAIT
from online_env.agents.pixel.agent import Pixel
from online_env.browser import chromium
from online_env.browser.desktop import BrowserDesktop
from online_env.browser.effects import BROWSER_EFFECTS
from online_env.browser.miniwob import MiniwobTasks, choose_scale, open_miniwob, task_class
from online_env.browser.miniwob_oracles import ORACLES
from online_env.browser.miniwob_plans import PLANS
from online_env.browser.site import FolderSite
from online_env.effects.conformance import run_live
from online_env.errors import (
    DesktopError,
    DesktopTimeoutError,
    MissingCapabilityError,
    MissingPackageError,
)
from online_env.tasks import Hand

from support import docs, needs

HOST = "pages.test"
PAGE = docs.ROOT / "docs" / "browser.md"
FORM = """<!doctype html><title>Form</title><body style="margin:0">
<label><input type=checkbox id=a>One</label><label><input type=checkbox id=b>Two</label>
<input id=text style="position:absolute;left:20px;top:100px;width:100px;height:20px">
<a href="other.html" style="position:absolute;left:20px;top:140px">Other page</a></body>"""


@pytest.fixture(scope="session", autouse=True)
def chromium_here() -> None:
    """Skips where no Chromium is installed."""
    needs.chromium()


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Iterator[FolderSite]:
    """A site with the pages of these tests."""
    folder = tmp_path_factory.mktemp("site")
    (folder / "form.html").write_text(FORM)
    (folder / "other.html").write_text("<title>Other</title><p>Other")
    site = FolderSite(HOST, folder)
    yield site
    site.close()


@pytest.fixture(scope="module")
def browser(site: FolderSite) -> Iterator[BrowserDesktop]:
    """One browser for all tests, each of which resets it."""
    with BrowserDesktop.up((480, 640), 2, site.arguments) as desktop:
        yield desktop


@pytest.fixture
def open_html(site: FolderSite, browser: BrowserDesktop) -> Callable[[str], BrowserDesktop]:
    """Opens a page with a given content."""

    def show(html: str) -> BrowserDesktop:
        assert site.folder is not None
        (site.folder / "page.html").write_text(f"<!doctype html><meta charset=utf-8>{html}")
        browser.reset({"url": site.url("page.html")})
        return browser

    return show


@pytest.fixture(scope="module")
def miniwob() -> Iterator[MiniwobTasks]:
    """A browser with the pages of MiniWoB++."""
    pytest.importorskip("miniwob", reason=needs.BROWSER)
    stage = open_miniwob((720, 960))
    yield stage
    stage.close()


@pytest.mark.parametrize("kind", sorted(BROWSER_EFFECTS))
def test_each_effect_is_proved_and_undone_and_its_probe_is_not_deceived(
    kind: str, site: FolderSite, browser: BrowserDesktop
) -> None:
    @contextmanager
    def start() -> Iterator[BrowserDesktop]:
        browser.reset({"url": site.url("form.html")})
        yield browser

    params = {"launch_app": {"app": "vscode", "then": []}}.get(kind, {})
    problems = {result.check: result.problem for result in run_live(kind, params, start)}
    assert not any(problems.values()), problems
    assert browser.task_page in browser.pages


def test_what_an_agent_does_about_each_disturbance(
    site: FolderSite, browser: BrowserDesktop
) -> None:
    """The window is closed or brought back, the password ends the wall; a wrong one does not."""
    from hijack_data.plan import Effect
    from online_env.effects import perform

    browser.reset({"url": site.url("form.html")})
    perform(Effect("launch_app", {"app": "gimp", "then": []}), browser)
    close = Hand(browser, 2).find("push-button", "Close")
    Hand(browser).click(close)
    assert [page.target for page in browser.pages] == [browser.task_page.target]

    perform(Effect("minimise", {}), browser)
    Hand(browser).click(Hand(browser, 2).find("push-button", "Form"))
    assert browser.front is browser.task_page

    perform(Effect("minimise", {}), browser)
    browser.run("pyautogui.hotkey('alt', 'tab')")
    assert browser.front is browser.task_page

    applied = perform(Effect("lock", {}), browser)
    browser.run("pyautogui.write('wrong\\n')")
    assert applied.probe().ok
    browser.run("pyautogui.write('password\\n')")
    assert not applied.probe().ok
    assert browser.evaluate("document.title") == "Form"


def test_pointer_and_keyboard_reach_the_page_at_two_pixels_a_css_pixel(
    site: FolderSite, browser: BrowserDesktop
) -> None:
    browser.reset({"url": site.url("form.html")})
    assert browser.screenshot().shape == (480, 640, 3)
    result = browser.run(
        "pyautogui.click(100, 220)\npyautogui.write('aB!? ß\u4e2d')\npyautogui.hotkey('ctrl', 'a')\n"
        "pyautogui.hotkey('ctrl', 'c')\npyautogui.press('end')\npyautogui.hotkey('ctrl', 'v')"
    )
    assert result.ok
    assert browser.evaluate("document.getElementById('text').value") == "aB!? ß\u4e2d" * 2
    browser.run("pyautogui.click(60, 290)")
    assert browser.evaluate("document.title") == "Other"
    browser.run("pyautogui.hotkey('alt', 'left')")
    assert browser.evaluate("document.title") == "Form"
    for code in ("pyautogui.press('nokey')", "pyautogui.click('a', 'b')", "import os"):
        assert not browser.run(code).ok


def test_pages_that_open_ask_close_and_hide_elements(
    open_html: Callable[[str], BrowserDesktop],
) -> None:
    browser = open_html(
        "<title>First</title><body style='min-height: 100vh' onclick=\"alert('hi'); document.title = '' + prompt('?') + confirm('!');"
        " window.open('form.html')\">"
        "<div id=host></div><iframe srcdoc='<button>Framed</button>'></iframe><script>"
        "document.getElementById('host').attachShadow({mode: 'closed'}).innerHTML ="
        " '<button>Shadowed</button>'</script>"
    )
    names = {node.name for node in Hand(browser).look() if node.role == "push-button"}
    assert {"Framed", "Shadowed"} <= names
    result = browser.run("pyautogui.click(300, 400)")
    assert result.output.count("a dialog") == 3
    deadline = time.monotonic() + 5
    while browser.title(browser.front) != "Form" and time.monotonic() < deadline:
        time.sleep(0.05)
    assert browser.title(browser.front) == "Form"
    # A page that closes while it is asked: the page that is in front then answers.
    closing = "opener ? new Promise(() => setTimeout(close, 50)) : document.title"
    assert browser.evaluate(closing) == "nullfalse"
    assert browser.title(browser.front) == "nullfalse"
    browser.run("pyautogui.hotkey('ctrl', 'w')")  # the last page stays
    assert len(browser.pages) == 1


def test_frames_of_other_sites_are_in_the_tree_and_a_touch_in_one_is_counted(
    open_html: Callable[[str], BrowserDesktop],
) -> None:
    from hijack_data.plan import Effect
    from online_env.effects import perform

    button = "<button onclick=&quot;this.textContent = 'Pressed'&quot;>Button</button>"
    frame = f'<iframe sandbox="allow-scripts" srcdoc="{button}"></iframe>'
    browser = open_html(f"<script>/* no text of the page */</script>{frame}{frame}")

    def names() -> list[str]:
        return [node.name for node in Hand(browser).look() if node.role == "push-button"]

    assert names() == ["Button", "Button"]
    assert "no text" not in browser.accessibility()
    probe = perform(Effect("touch", {}), browser).probe()
    assert [attempt["delivered"] for attempt in probe.facts["attempts"]] == [True]
    assert sorted(names()) == ["Button", "Pressed"]


def test_a_page_that_crashes_is_an_error_and_a_reset_mends_it(
    site: FolderSite, browser: BrowserDesktop
) -> None:
    browser.reset({"url": site.url("form.html")})
    browser._devtools.send("Page.navigate", browser.front.session, url="chrome://crash")
    deadline = time.monotonic() + 10
    while not browser.task_page.problem and time.monotonic() < deadline:
        time.sleep(0.05)
    with pytest.raises(DesktopError, match="the page has crashed"):
        browser.screenshot()
    browser.reset({"url": site.url("form.html")})
    assert browser.screenshot().any()


def test_pages_that_download_hold_on_or_block_for_ever(
    site: FolderSite, open_html: Callable[[str], BrowserDesktop]
) -> None:
    browser = open_html(
        "<title>Held</title><a id=a download=x.bin href='data:application/octet-stream,x'>Load</a>"
        "<script>onbeforeunload = event => event.preventDefault()</script>"
    )
    assert browser.run("pyautogui.click(30, 30)").ok
    assert browser.title(browser.front) == "Held"
    browser.navigate(site.url("form.html"))
    assert browser.title(browser.front) == "Form"
    assert any("beforeunload" in notice for notice in browser.notices)

    browser.evaluate("setTimeout(() => { for (;;); }, 0), 1")
    session = browser.front.session
    with pytest.raises(DesktopTimeoutError, match="its page hangs"):
        browser._devtools.call("Runtime.evaluate", session, timeout=1.0, expression="1")
    browser.reset({"url": site.url("form.html")})
    assert browser.screenshot().any()


def test_a_browser_that_was_killed_is_an_error_and_a_reset_starts_another(
    site: FolderSite, browser: BrowserDesktop
) -> None:
    browser.reset({"url": site.url("form.html")})
    os.killpg(browser._chromium._pid, signal.SIGKILL)
    deadline = time.monotonic() + 10
    while browser._devtools.is_open and time.monotonic() < deadline:
        time.sleep(0.05)
    with pytest.raises(DesktopError, match="has ended"):
        browser.screenshot()
    browser.reset({"url": site.url("form.html")})
    assert browser.title(browser.front) == "Form"


def test_what_a_browser_cannot_do_is_refused_with_the_reason(
    browser: BrowserDesktop, monkeypatch: pytest.MonkeyPatch
) -> None:
    for refused in (
        lambda: browser.execute(["ls"]),
        lambda: browser.read_file("/etc/passwd"),
        lambda: browser.write_file("/tmp/x", b""),
    ):
        with pytest.raises(MissingCapabilityError, match="a browser cannot"):
            refused()
    with pytest.raises(ParameterError, match="641x480"):
        BrowserDesktop.up((480, 641), 2)
    with monkeypatch.context() as patch:
        patch.setattr("online_env.browser.session.OLDEST", 10_000)
        with pytest.raises(MissingPackageError, match="10000 is needed"):
            BrowserDesktop.up()
    monkeypatch.setenv(chromium.VARIABLE, "/nowhere/chromium")
    with pytest.raises(MissingPackageError, match="there is no such program"):
        BrowserDesktop.up()
    monkeypatch.delenv(chromium.VARIABLE)
    monkeypatch.setenv("PATH", "/nowhere")
    monkeypatch.setenv("HOME", "/nowhere")
    with pytest.raises(MissingPackageError, match="apt-get install chromium"):
        BrowserDesktop.up()


def test_a_program_that_is_no_chromium_is_named_with_what_it_printed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    program = tmp_path / "chromium"
    program.write_text("#!/bin/sh\necho no display here >&2\nexit 1\n")
    program.chmod(0o755)
    monkeypatch.setenv(chromium.VARIABLE, str(program))
    with pytest.raises(DesktopError, match="no display here"):
        BrowserDesktop.up()


def test_a_killed_client_leaves_no_browser() -> None:
    code = (
        "import time; from online_env.browser.desktop import BrowserDesktop\n"
        "d = BrowserDesktop.up(); print(d._chromium._pid, flush=True); time.sleep(60)"
    )
    with subprocess.Popen(
        [sys.executable, "-c", code], stdout=subprocess.PIPE, text=True
    ) as client:
        assert client.stdout is not None
        pid = int(client.stdout.readline())
        os.kill(pid, 0)
        client.kill()
    deadline = time.monotonic() + 10
    while _is_alive(pid) and time.monotonic() < deadline:
        time.sleep(0.05)
    assert not _is_alive(pid)


def _is_alive(pid: int) -> bool:
    try:
        return "Z" not in Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0]
    except OSError:
        return False


@pytest.mark.parametrize("page", sorted(ORACLES))
def test_the_oracle_does_what_nobody_did_before(page: str, miniwob: MiniwobTasks) -> None:
    task = task_class(f"miniwob/{page}.html")(3)
    setting = miniwob.reset(task, 3)
    assert setting.instruction
    assert miniwob.evaluate(["DONE"]).score == 0.0
    task.oracle(Hand(miniwob.desktop, 2))
    assert miniwob.evaluate(["DONE"]).score == 1.0, setting.instruction
    assert miniwob.evaluate(["FAIL"]).score == 0.0


@pytest.mark.parametrize("page", sorted(PLANS))
def test_the_plan_in_words_is_enough_for_an_agent_that_reads(
    page: str, miniwob: MiniwobTasks
) -> None:
    pytest.importorskip("rapidocr", reason=needs.OCR)
    task = task_class(f"miniwob/{page}.html")(3)
    assert task.has_plan
    assert not task.plan(), "the page words the task"
    setting = miniwob.reset(task, 3)
    agent = Pixel()
    agent.follow(task.plan())
    for _ in range(30):
        _, (action,) = agent.predict(
            setting.instruction, {"screenshot": miniwob.desktop.screenshot()}
        )
        if action == DONE:
            break
        if action == WAIT:
            time.sleep(1)
        else:
            miniwob.desktop.run(action)
    assert miniwob.evaluate([DONE]).score == 1.0, setting.instruction


def test_pages_that_name_no_encoding_are_utf_8(miniwob: MiniwobTasks) -> None:
    texts = {miniwob.reset("miniwob/unicode-test.html", seed).instruction for seed in range(6)}
    assert 'Click on the "CancÃ©l" button.' not in texts
    assert 'Click on the "Cancél" button.' in texts


def test_a_seed_is_a_task_and_the_first_result_counts(miniwob: MiniwobTasks) -> None:
    task = task_class("miniwob/enter-text.html")
    first = miniwob.reset(task(1), 1)
    assert miniwob.reset(task(2), 2).instruction != first.instruction
    assert miniwob.reset(task(1), 1) == first
    browser = miniwob.desktop
    browser.reload(browser.task_page)
    time.sleep(0.2)
    assert browser.evaluate("core.getUtterance()") == first.instruction
    Hand(browser).click(Hand(browser, 2).find("push-button", "Submit"))
    browser.run("pyautogui.click(240, 300)")  # START: the page's next episode
    verdict = miniwob.evaluate(["DONE"])
    assert (verdict.score, verdict.reason) == (0.0, "the page's reward is -1")


def test_an_agent_of_a_user_is_run_reported_and_verified(
    miniwob: MiniwobTasks, tmp_path: Path
) -> None:
    agent = tmp_path / "mine.py"
    agent.write_text(
        "class Mine:\n"
        "    def predict(self, instruction, obs):\n"
        "        assert obs['screenshot'].shape[2] == 3\n"
        "        return 'x', ['pyautogui.write(\"password\\\\n\")', 'DONE']\n"
    )
    folder = tmp_path / "run"
    command = [
        *(sys.executable, "-m", "hijack_data.cli", "bench", "miniwob_small"),
        *("--agent", f"{agent}:Mine,oracle", "--tasks", "miniwob/enter-text.html"),
        *("--corruptions", "clean,pop_ups,network_error,verification"),
        *("--desktops", "1", "--out", str(folder)),
    ]
    process = subprocess.run(command, capture_output=True, text=True, check=False)
    assert process.returncode == 0, process.stdout + process.stderr
    records = [json.loads(line) for line in (folder / "records.jsonl").read_text().splitlines()]
    by_corruption: dict[str, Any] = {
        record["corruption"]: record for record in records if record["agent"] == "oracle"
    }
    assert len(records) == 8
    assert {record["status"] for record in records} == {"ok"}
    assert by_corruption["clean"]["score"] == 1.0
    assert by_corruption["network_error"]["score"] == 0.0
    for record in records:
        for effect in record["effects"]:
            assert effect["record"]["probes"][0]["ok"]
            assert effect["record"]["undone"][-1]["ok"]
    verify = subprocess.run(
        [sys.executable, "-m", "hijack_data.cli", "verify", str(folder)],
        capture_output=True,
        text=True,
        check=False,
    )
    assert verify.returncode == 0, verify.stdout + verify.stderr
    assert "all identical" in verify.stdout


def test_gymnasium_makes_it_by_its_name(miniwob: MiniwobTasks) -> None:
    import gymnasium

    import online_env  # noqa: F401  (registers the environment)

    env = gymnasium.make("AgentHijack/Browser-v0", task="miniwob/click-test.html")
    try:
        observation, _ = env.reset(seed=0)
        assert observation["instruction"] == "Click the button."
        assert env.step("DONE")[1:4] == (0.0, True, False)
    finally:
        env.close()


@pytest.mark.parametrize(
    "block",
    [
        block
        for block in docs.blocks_of(PAGE)
        if block.language in docs.PYTHON and block.kind != docs.NO_RUN
    ],
)
def test_the_python_of_browser_md_runs(
    block: docs.Block, miniwob: MiniwobTasks, tmp_path: Path
) -> None:
    docs.run_python(block.text, tmp_path)


def test_tasks_that_are_not_there_are_named(tmp_path: Path) -> None:
    pytest.importorskip("miniwob", reason=needs.BROWSER)
    with pytest.raises(ConfigError, match="did you mean 'click-test'"):
        task_class("miniwob/click-tets.html")
    (tmp_path / "page.html").write_text("<p>")
    with pytest.raises(ConfigError, match="no page of MiniWoB"):
        task_class(str(tmp_path / "page.html"))


def test_the_scale_fits_the_screen() -> None:
    with pytest.raises(ParameterError, match="320x240 pixels or more"):
        choose_scale((240, 300))
    assert [choose_scale(size) for size in ((720, 960), (1080, 1920), (960, 1280), (300, 400))] == [
        3,
        4,
        4,
        1,
    ]


def test_profiles_of_killed_clients_are_removed(tmp_path: Path) -> None:
    assert shutil.which("sh")
    import tempfile

    dead = subprocess.Popen(["sh", "-c", "exit 0"])
    dead.wait()
    left = Path(tempfile.gettempdir()) / f"agenthijack-browser-{dead.pid}-left"
    left.mkdir()
    try:
        with BrowserDesktop.up():
            assert not left.exists()
    finally:
        shutil.rmtree(left, ignore_errors=True)
