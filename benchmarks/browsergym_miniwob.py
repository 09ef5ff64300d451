"""MiniWoB++ in BrowserGym under corruptions: its own validators, scripts that act by its functions.

Run it where browsergym-miniwob and miniwob are installed, with a Chromium of the system:

    python benchmarks/browsergym_miniwob.py OUT.csv [TASK ...]

Tasks with a script in `miniwob_oracles`, which reads the accessibility tree, are played clean and
under each of the nine. The scripts react to nothing: a page in front is closed by `tab_focus(0)`
first. Each of the other tasks is begun clean and under one of the nine in turn, and waits for three
steps: the corruption must be proved, and the validator must give 0. OUT.csv has a row an episode;
rows that are there are not played again.
"""

import collections
import csv
import sys
import time
from pathlib import Path

try:
    import browsergym.miniwob  # noqa: F401  (registers the environments)
except ImportError:
    print("Not measured: needs browsergym-miniwob, in an environment of its own, and OUT.csv.")
    sys.exit()
import gymnasium
import miniwob
from browsergym.core.action.highlevel import HighLevelActionSet
from playwright.sync_api import BrowserType

from hijack_data import AccidentalTouch, AppMinimization, MultiApps, Subtitle
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

SEED = 1
WAITS = 3
# Most tasks are over before step 3. With the default size, the subtitle does not fit into the page.
PLANNERS = {
    "subtitle": Subtitle(fit="shrink"),
    "multi_apps": MultiApps(step=0),
    "accidental_touch": AccidentalTouch(step=0),
    "app_minimization": AppMinimization(step=0),
}
# Playwright's names of keys by ours
KEYS = {"ctrl": "Control", "enter": "Enter", "esc": "Escape", "left": "ArrowLeft", "space": "Space"}


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
            error = self.env.unwrapped.last_action_error
            if error:
                raise HijackError(f"action failed: {error}")
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
                    keys = "+".join(KEYS.get(key, key) for key in values)
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
    """Return score and reason of an episode; the score of one that could not be played is ""."""
    env = gymnasium.make(
        f"browsergym/miniwob.{task}",
        task_kwargs={"base_url": address},
        viewport={"width": 640, "height": 480},
        slow_mo=0,
        pre_observation_delay=0.05,
        action_mapping=HighLevelActionSet(subsets=["bid", "coord", "tab"]).to_python_code,
        disable_env_checker=True,
    )
    env = corrupt(env, PLANNERS.get(corruption, corruption))
    try:
        observation, _ = env.reset(seed=SEED)
        if task not in ORACLES:
            return wait(env)
        player = Player(env, observation)
    except HijackError as error:
        return "", describe(error)
    except Exception as error:  # noqa: BLE001  (a defect of ours, to be counted)
        return "", f"FAILED: {describe(error)}"
    else:
        try:
            ORACLES[task](player)
        except (HijackError, ValueError, LookupError) as error:  # it finds nothing to act on
            return player.outcome[0], describe(error)
        except Exception as error:  # noqa: BLE001  (the same)
            return "", f"FAILED: {describe(error)}"
        return player.outcome[0], ""
    finally:
        env.close()


def wait(env):
    for _ in range(WAITS):
        _, reward, terminated, _, _ = env.step("noop(10)")
        if terminated:
            return reward, "the validator ended it"
    return reward, "waited"


def describe(error):
    return f"{type(error).__name__}: {' '.join(str(error).split())[:200]}"


def list_episodes():
    names = sorted(
        name.removeprefix("browsergym/miniwob.")
        for name in gymnasium.registry
        if name.startswith("browsergym/miniwob.")
    )
    nine = corruption_names()[:9]
    unplayed_names = [name for name in names if name not in ORACLES]
    for corruption in (None, *nine):
        yield from ((name, corruption) for name in names if name in ORACLES)
    for number, name in enumerate(unplayed_names):
        yield from ((name, corruption) for corruption in (None, nine[number % len(nine)]))


def main():
    use_chromium_of_the_system()
    out, *options = sys.argv[1:]
    out = Path(out)
    rows = list(csv.DictReader(out.open())) if out.exists() else []
    finished_rows = {(row["task"], row["condition"]) for row in rows}
    site = FolderSite("miniwob.test", Path(miniwob.__file__).parent / "html")
    with out.open("a", newline="") as file:
        writer = csv.DictWriter(file, ("task", "condition", "seed", "score", "reason", "seconds"))
        if not rows:
            writer.writeheader()
        for task, corruption in list_episodes():
            condition = corruption or "clean"
            if (options and task not in options) or (task, condition) in finished_rows:
                continue
            start = time.monotonic()
            score, reason = play(task, corruption, f"http://127.0.0.1:{site.port}/miniwob/")
            row = {
                "task": task,
                "condition": condition,
                "seed": SEED,
                "score": score,
                "reason": reason,
                "seconds": f"{time.monotonic() - start:.1f}",
            }
            rows.append({key: str(value) for key, value in row.items()})
            writer.writerow(row)
            file.flush()
    counts = collections.defaultdict(collections.Counter)
    for row in rows:
        state = "played" if row["task"] in ORACLES else "begun"
        counts[row["condition"]][f"{state} {row['score'] or row['reason'][:60]}"] += 1
    for condition, outcomes in counts.items():
        print(condition, dict(outcomes))
    site.close()


if __name__ == "__main__":
    main()
