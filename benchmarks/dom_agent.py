"""An agent that reads the page's DOM and acts on its elements by Playwright: it sees no picture.

    hijack bench miniwob_dom --agent benchmarks/dom_agent.py:DomAgent --out runs/miniwob_dom

It plays the scripts of `miniwob_oracles`, one action a step, in the tab with the task's address,
wherever that tab is, as scripts of Playwright do. It reacts to nothing; a click waits three seconds
for what is in its way. Its clicks are those of Playwright, which refuses elements that others cover.
"""

import queue
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import PurePosixPath
from urllib.parse import urlsplit

from playwright.sync_api import sync_playwright

from online_env.browser.miniwob import FOLDER
from online_env.browser.miniwob_oracles import ORACLES, ShownPage

CLICK_TIMEOUT_MS = 3000
TURN_TIMEOUT_S = 120
ELEMENTS = "body *"
READ = """nodes => nodes.map((node, index) => {
  const box = node.getBoundingClientRect();
  return {index, tag: node.localName, name: node.innerText ?? node.textContent,
    shown: box.width > 0 && box.height > 0 && node.checkVisibility({visibilityProperty: true}),
    attributes: Object.fromEntries(['id', 'class', 'type'].map(key => [key, node.getAttribute(key) ?? '']))};
}).filter(node => node.shown)"""
KEYS = {"ctrl": "Control", "esc": "Escape", "enter": "Enter", "left": "ArrowLeft", "space": "Space"}


@dataclass
class Element:
    """A visible element, by its place among all elements."""

    index: int
    name: str


class EpisodeOverError(Exception):
    """The runner has ended the episode."""


class DomPage(ShownPage):
    """The elements of the task's tab; each action takes one turn of the agent."""

    def __init__(self, page, end_turn):
        self._page = page
        self._end_turn = end_turn

    def nodes(self, tag="", name=None, **attributes):
        return [
            Element(element["index"], element["name"])
            for element in self._page.locator(ELEMENTS).evaluate_all(READ)
            if (not tag or element["tag"] == tag)
            and (name is None or " ".join(element["name"].split()) == name)
            and all(
                value in element["attributes"][key].split() for key, value in attributes.items()
            )
        ]

    def _locate(self, element):
        return self._page.locator(ELEMENTS).nth(element.index)

    def click(self, node):
        self._locate(node).click(timeout=CLICK_TIMEOUT_MS)
        self._end_turn()

    def fill(self, node, text):
        self._locate(node).fill(text, timeout=CLICK_TIMEOUT_MS)
        self._end_turn()

    def type(self, text):
        self._page.keyboard.type(text)
        self._end_turn()

    def press(self, *keys):
        self._page.keyboard.press("+".join(KEYS.get(key, key) for key in keys))
        self._end_turn()


class DomAgent:
    """Plays the script of the page that is open."""

    uses_devtools = True
    # Objects of Playwright are bound to a thread, and its driver takes seconds to start.
    thread = ThreadPoolExecutor(1)
    playwright = None

    def __init__(self):
        self._turns = queue.SimpleQueue()
        self._answers = queue.SimpleQueue()
        self._episode = None

    def reset(self):
        if self._episode is not None:
            self._turns.put(False)
            self._episode.result(TURN_TIMEOUT_S)
            self._episode = None

    def connect(self, address):
        self._episode = self.thread.submit(self._play, address)

    def predict(self, instruction, obs):
        self._turns.put(True)
        return self._answers.get(timeout=TURN_TIMEOUT_S)

    def _wait_for_turn(self):
        if not self._turns.get():
            raise EpisodeOverError

    def _end_turn(self):
        self._answers.put(("", []))
        self._wait_for_turn()

    def _play(self, address):
        browser = None
        try:
            self._wait_for_turn()
            if DomAgent.playwright is None:
                DomAgent.playwright = sync_playwright().start()
            browser = DomAgent.playwright.chromium.connect_over_cdp(address)
            page = find_task(browser)
            ORACLES[PurePosixPath(urlsplit(page.url).path).stem](DomPage(page, self._end_turn))
            self._answers.put(("The script is done.", ["DONE"]))
        except EpisodeOverError:
            pass
        except Exception as error:  # noqa: BLE001  (a script meets a page of another kind)
            self._answers.put((f"{type(error).__name__}: {error}", ["FAIL"]))
        finally:
            if browser is not None:
                browser.close()


def find_task(browser):
    """Return the tab that has an address of the task's site."""
    for context in browser.contexts:
        for page in context.pages:
            if f"/{FOLDER}/" in urlsplit(page.url).path:
                return page
    raise LookupError("no tab has a page of MiniWoB++")
