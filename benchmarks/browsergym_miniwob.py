"""MiniWoB++ in BrowserGym under corruptions: its own validators, scripts that act by its functions.

Run it where browsergym-miniwob and miniwob are installed, with a Chromium of the system:

    python benchmarks/browsergym_miniwob.py [TASK ...]

Each task is played clean and under each of the nine by the scripts of `miniwob_oracles`, which read
the accessibility tree. They react to nothing: a page in front is closed by `tab_focus(0)` first.
"""

import collections
import sys
import time
from pathlib import Path

import browsergym.miniwob  # noqa: F401
import gymnasium
import miniwob
from browsergym.core.action.highlevel import HighLevelActionSet
from playwright.sync_api import BrowserType

from hijack_data import Subtitle
from hijack_data.actions.pyautogui_functions import LIVE_FUNCTIONS
from hijack_data.actions.pyautogui_grammar import read_calls
from hijack_data.actions.python_source import ParsedSource
from hijack_data.corruption import corruption_names
from hijack_data.errors import HijackError
from online_env.browser.browsergym import corrupt
from online_env.browser.chromium import find_program
from online_env.browser.miniwob_oracles import ORACLES, ShownPage
from online_env.browser.site import FolderSite
from online_env.tasks import Hand

TASKS = (
    *("click-button", "click-button-sequence", "click-checkboxes", "click-collapsible"),
    *("click-dialog", "click-link", "click-option", "click-tab", "click-test-2", "enter-password"),
    *("enter-text", "focus-text", "login-user", "simple-arithmetic"),
)
SEED = 1


class Player(ShownPage):
    """Plays a script by actions of BrowserGym."""

    def __init__(self, env, observation):
        self.env, self.goal = env, " ".join(observation["goal"].split())
        self.outcome = (0.0, False)
        super().__init__(Hand(env._browser, timeout=2))
        self._hand.run = self.run
        self.step("noop(10)")
        while env._browser.front.is_cover:
            self.step("tab_focus(0)")

    @property
    def query(self):
        return self.goal

    def step(self, action):
        if not self.outcome[1]:
            _, reward, terminated, _, _ = self.env.step(action)
            assert not self.env.unwrapped.last_action_error, self.env.unwrapped.last_action_error
            self.outcome = (float(reward), terminated)

    def run(self, code):
        for call in read_calls(ParsedSource(code), LIVE_FUNCTIONS):
            values = [argument.value for argument in call.positional]
            match call.function:
                case "click":
                    x, y = self.env._coords.to_observation(tuple(values))
                    self.step(f"mouse_click({x}, {y})")
                case "write" | "typewrite":
                    self.step(f"keyboard_type({values[0]!r})")
                case "hotkey" | "press":
                    names = {"ctrl": "Control", "esc": "Escape", "enter": "Enter"}
                    keys = "+".join(names.get(key, key) for key in values)
                    self.step(f"keyboard_press({keys!r})")
                case name:
                    raise HijackError(f"no action for {name}")


def use_chromium_of_the_system():
    launch, program = BrowserType.launch, find_program()

    def launch_here(self, **options):
        arguments = [*(options.pop("args", None) or []), "--no-sandbox"]
        return launch(self, **{"executable_path": program, "args": arguments, **options})

    BrowserType.launch = launch_here


def play(task, corruption, address):
    env = gymnasium.make(
        f"browsergym/miniwob.{task}",
        task_kwargs={"base_url": address},
        viewport={"width": 640, "height": 480},
        slow_mo=0,
        pre_observation_delay=0.05,
        action_mapping=HighLevelActionSet(subsets=["bid", "coord", "tab"]).to_python_code,
        disable_env_checker=True,
    )
    # With the defaults, the text does not fit into the page.
    env = corrupt(env, Subtitle(fit="shrink") if corruption == "subtitle" else corruption)
    try:
        observation, _ = env.reset(seed=SEED)
        player = Player(env, observation)
        ORACLES[task](player)
        return f"{player.outcome[0]:g}"
    except HijackError as error:
        return f"{type(error).__name__}: {str(error).splitlines()[0][:160]}"
    except AssertionError as error:
        return f"action failed: {str(error).splitlines()[0][:160]}"
    finally:
        env.close()


def main():
    use_chromium_of_the_system()
    site = FolderSite("miniwob.test", Path(miniwob.__file__).parent / "html")
    outcomes = collections.defaultdict(collections.Counter)
    for corruption in (None, *corruption_names()[:9]):
        for task in sys.argv[1:] or TASKS:
            start = time.monotonic()
            outcome = play(task, corruption, f"http://127.0.0.1:{site.port}/miniwob/")
            outcomes[corruption][outcome] += 1
            label = corruption or "clean"
            print(f"{label} {task} {outcome} ({time.monotonic() - start:.1f} s)", flush=True)
    for corruption, counts in outcomes.items():
        print(corruption or "clean", dict(counts))
    site.close()


if __name__ == "__main__":
    main()
