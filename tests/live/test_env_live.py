"""`CorruptedEnv` on the embedded desktop: all nine are real and proved, nothing tells the agent,
offline = live."""

import json
import warnings
from pathlib import Path

import pytest

from support import needs

pytest.importorskip("gymnasium", reason=needs.ONLINE)
pytest.importorskip("lxml", reason=needs.ONLINE)
pytest.importorskip("starlette", reason=needs.ONLINE)

import gymnasium
from gymnasium.utils.env_checker import check_env

import hijack_data as hj
from hijack_data.errors import HijackError
from hijack_data.params import Every
from online_env.effects import find, firewall_rules
from online_env.effects.guest import Guest
from online_env.environment import CorruptedEnv, SmallTasks
from pipelines.proof.rebuild import rebuild

from support.effects import Around, reach

VISUAL = ("pop_ups", "resolution", "marks", "subtitle")
STATE = {
    "multi_apps": (hj.MultiApps(), 0, "launch_app"),
    "accidental_touch": (hj.AccidentalTouch(step=1), 1, "touch"),
    "app_minimization": (hj.AppMinimization(step=1), 1, "minimise"),
    "network_error": (hj.NetworkError(), -1, "firewall"),
    "verification": (hj.Verification(), -1, "lock"),
}
CLICK = "pyautogui.click(600, 400)"


class Stage(SmallTasks):
    """Small tasks on a desktop that tests can put something around."""

    around = None

    @property
    def desktop(self):
        return self.around or self._desktop


@pytest.fixture(scope="module")
def stage(embedded_machine):
    from online_env.embedded.desktop import EmbeddedDesktop

    with EmbeddedDesktop.up((900, 1440), standby=True) as desktop:
        yield Stage(desktop)


@pytest.fixture
def begin(stage, tmp_path):
    """Begin an episode, logged in the test's folder; what `reset` returned comes second."""

    def start(corruption, /, **options):
        settings = {
            key: options.pop(key)
            for key in ("max_steps", "recovery", "allow_code")
            if key in options
        }
        env = CorruptedEnv(stage, corruption=corruption, log=tmp_path, **settings)
        return env, env.reset(seed=1, options=options)

    yield start
    stage.around = None


@pytest.fixture
def play(begin):
    """Begin an episode and take some actions; returns its environment."""

    def start(corruption, *actions, **options):
        env, _ = begin(corruption, **options)
        for action in actions:
            env.step(action)
        return env

    return start


def test_gymnasium_finds_nothing_to_complain_of(embedded_machine):
    env = gymnasium.make(
        "online_env:AgentHijack/Embedded-v0",
        size=(480, 800),
        corruption="resolution",
        standby=False,
    )
    try:
        assert env.observation_space["screenshot"].shape == (240, 400, 3)
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            check_env(env.unwrapped)
        assert env.unwrapped.spec.nondeterministic
    finally:
        env.close()
    with pytest.raises(HijackError, match="the environment is closed"):
        env.unwrapped.reset(seed=0)


@pytest.mark.parametrize("name", VISUAL)
def test_what_an_agent_saw_is_made_again_offline(play, tmp_path, name):
    env = play(name, CLICK, "pyautogui.write('hello')", "DONE")
    assert (env.record["status"], env.record["score"], env.record["steps"]) == ("ok", 0.0, 3)
    report = rebuild(tmp_path)
    assert report.problems == []
    assert (report.steps, report.disturbed) == (4, 4)


def test_a_visual_and_a_state_corruption_compose(play, stage, tmp_path):
    env = play(hj.Sequence([hj.Subtitle(fit="shrink"), hj.NetworkError()]), CLICK)
    assert not reach(stage.desktop)
    env.step("DONE")
    assert reach(stage.desktop)
    record = env.record
    assert (record["corruption"], record["status"]) == ("subtitle+network_error", "ok")
    assert [effect["record"]["probes"][0]["ok"] for effect in record["effects"]] == [True]
    report = rebuild(tmp_path)
    assert (report.problems, report.disturbed) == ([], 3)


PAIRS = {
    "pop_ups+slow_network": ["slow_link"],
    "app_freeze+missed_input": ["freeze"],
    "app_minimization+verification": ["lock", "minimise"],
}


@pytest.mark.parametrize("pair", PAIRS)
def test_a_pair_is_proved_and_undone_each_on_its_own(play, tmp_path, pair):
    parts = [hj.make_corruption(name) for name in pair.split("+")]
    env = play(hj.Sequence(parts), "WAIT", "WAIT", CLICK, CLICK, "DONE")
    record = env.record
    assert (record["corruption"], record["status"]) == (pair, "ok"), record["problem"]
    assert [effect["record"]["effect"] for effect in record["effects"]] == PAIRS[pair]
    for effect in record["effects"]:
        assert effect["record"]["probes"][0]["ok"]
        assert [undone["ok"] for undone in effect["record"]["undone"]] == [True]
    assert set(record["params"]) == {part.id for part in parts}
    faults = [entry["probe"]["ok"] for entry in record.get("inputs", ())]
    assert faults == [True] * any(part.inputs for part in parts)
    assert rebuild(tmp_path).problems == []
    (path,) = tmp_path.glob("episodes/*/episode.json")
    first = record["effects"][0]["record"]
    first["probes"][0]["ok"] = False
    path.write_text(json.dumps(record))
    assert any("was not proved" in problem for problem in rebuild(tmp_path).problems)


def assert_proved_and_undone(record, name):
    """That an episode has the effect of a corruption of the machine, and no other."""
    _, step, kind = STATE[name]
    (effect,) = record["effects"]
    assert (effect["step"], effect["record"]["effect"]) == (step, kind)
    probes = effect["record"]["probes"]
    assert len(probes) == (2 if find(kind).lasting else 1), (
        "what lasts is proved on both sides of the picture"
    )
    assert all(probe["ok"] and probe["facts"] for probe in probes)
    assert [undone["ok"] for undone in effect["record"]["undone"]] == [True]


class NoFirewall(Around):
    """Root's scripts do nothing."""

    network_root = None

    @property
    def namespace(self):
        return None

    def execute(self, argv, timeout=60):
        if isinstance(argv, list) and any("sudo" in word for word in argv):
            from online_env.desktops.protocol import RunResult

            return RunResult("success", "", "", 0)
        return self.desktop.execute(argv, timeout)


class NoSuchWindows(Around):
    """The tool that minimises is told to look instead."""

    def tool(self, name, operation, fields, timeout=60):
        if operation == "minimise":
            return {
                "managed": True,
                "hidden": [],
                "active": 0,
                "by": "show_desktop",
                "already": False,
            }
        return self.desktop.tool(name, operation, fields, timeout)


@pytest.mark.parametrize(
    ("name", "around", "words"),
    [
        ("network_error", NoFirewall, "still reachable"),
        ("app_minimization", NoSuchWindows, "still on the screen"),
    ],
)
def test_a_sabotaged_effect_makes_the_episode_invalid(play, stage, name, around, words):
    stage.around = around(stage._desktop)
    env = play(STATE[name][0], "WAIT")
    assert (env.record["status"], env.record["score"]) == ("invalid", None)
    assert words in env.record["problem"]
    assert env.step("DONE")[1:] == (0.0, False, True, {})


def test_a_firewall_that_was_opened_from_outside_is_found_at_the_end(play, stage):
    env = play("network_error", "WAIT")
    assert env.record is None
    assert Guest(stage.desktop, "", None).root(firewall_rules.nft_open()).ok
    assert env.step("DONE")[1:] == (0.0, False, True, {})
    assert env.record["status"] == "invalid"
    assert "no agent can lift, was gone at the end: still reachable" in env.record["problem"]


def test_an_agent_that_stops_the_window_manager_does_not_hold_it_up(play):
    env = play(hj.AppMinimization(step=1), allow_code=True)
    env.step("import os; os.system('pkill -STOP -x xfwm4')")
    assert env.record is None
    env.step("DONE")
    assert env.record["status"] == "ok"
    assert env.record["effects"][0]["record"]["probes"][0]["ok"]


def test_repair_and_reset_on_request(play, stage):
    env = play(
        hj.AppMinimization(step=Every(1)), "WAIT", "REQUEST_REINIT", "DONE", recovery="repair"
    )
    assert env.record["recovery"] == {
        "policy": "repair",
        "requests": 1,
        "false_alarms": 0,
        "repaired": 1,
        "free": 0,
    }
    env = play("network_error", recovery="reset")
    stage.desktop.write_file("/home/user/mark", b"")
    env.step("REQUEST_REINIT")
    assert reach(stage.desktop)
    assert not stage.desktop.execute(["test", "-e", "/home/user/mark"]).ok
    assert env.record is None
    env.step("DONE")
    assert env.record["recovery"]["repaired"] == 1


@pytest.mark.usefixtures("browser_machine")
def test_the_first_picture_shows_the_network_error_and_re_initialisation_lifts_it(play, stage):
    env = play("network_error", task="register_course", recovery="reset", max_steps=1)
    machine = stage.machine
    assert "DNS_PROBE" in stage.desktop.accessibility()
    env.step("REQUEST_REINIT")
    assert "DNS_PROBE" not in stage.desktop.accessibility()
    assert stage.machine is machine, "an agent that was given it goes on with it"
    assert env.record is None
    env.step("WAIT")
    record = env.record
    assert (record["status"], record["steps"], record["recovery"]["free"]) == ("ok", 1, 1)
    assert record["environment_errors"] == "before_setup"


def test_the_task_can_be_done_and_is_scored(play, stage):
    from online_env.tasks.hand import Hand

    env = play("subtitle", max_steps=12)
    task, path = stage.task, f"/home/user/{stage.task.values.path}"
    x, y = Hand(stage.desktop).find(("text", "entry"), app="mousepad").centre
    stages = (
        f"pyautogui.click({x}, {y})",
        f"pyautogui.write({task.values.text!r})",
        "pyautogui.hotkey('ctrl', 's')",
        "WAIT",
        f"pyautogui.hotkey('alt', 'n')\npyautogui.hotkey('ctrl', 'a')\npyautogui.write({path!r})",
        "WAIT",
        "pyautogui.hotkey('alt', 's')",
        "WAIT",
    )
    for action in stages:
        assert env.step(action)[1] == 0.0
    assert env.step("DONE")[1:4] == (1.0, True, False)
    assert (env.record["score"], env.record["malformed"]) == (1.0, 0)


# What is said of the corruptions anywhere in the program, but not by a desktop that has none.
WORDS = (
    *(
        name
        for name in hj.corruption_names()
        if name not in ("resolution", "marks", "subtitle", "verification")
    ),
    "launch_app",
    "firewall",
    "minimise",
    "agenthijack_offline",
    "AGENTHIJACK_OUT",
    "xtool",
    "nettool",
)
LOOK = r"""
{ for p in /proc/[0-9]*; do tr '\0' '\n' <$p/cmdline; tr '\0' '\n' <$p/environ; cat $p/comm; done
  env; find /home /tmp /run /var/tmp /dev/shm -newer /proc/1/cmdline
  find /home /tmp /run /var/tmp /dev/shm -type f -newer /proc/1/cmdline -size -4000k -exec cat {} +
  xprop -root | grep -v '^_NET_SUPPORTED'; wmctrl -lpx; cat /proc/net/route /proc/mounts; history; dmesg; } 2>/dev/null
"""


def words_in_the_guest(stage):
    """Which words of a corruption, or of its label, the desktop's user can read anywhere in it."""
    output = stage.desktop.execute(["sh", "-c", LOOK]).output
    assert len(output) > 2000
    assert "mousepad" in output
    return {word for word in (*WORDS, "sesame") if word.lower() in output.lower()}


@pytest.mark.parametrize("name", STATE)
def test_each_effect_is_proved_tells_nothing_and_is_undone(begin, stage, name):
    corruption, *_ = STATE[name]
    env, first = begin(None, corruption=corruption, label="sesame")
    options = [first, *map(env.step, ("WAIT", "WAIT", "REQUEST_REINIT"))]
    assert env.record is None
    assert all(not info for *_, info in options)
    assert all(set(obs) == {"screenshot", "instruction"} for obs, *_ in options)
    # A program may be called "minimise" by itself.
    result = {"minimise"} if name == "app_minimization" else set()
    assert words_in_the_guest(stage) <= result
    env.step("DONE")
    assert (env.record["status"], env.record["problem"]) == ("ok", "")
    assert_proved_and_undone(env.record, name)


def test_a_picture_that_is_corrupted_tells_the_guest_nothing(play, stage):
    env = play("pop_ups", "WAIT", "WAIT", label="sesame")
    assert env.record is None
    assert words_in_the_guest(stage) == set()
    env.step("DONE")
    assert env.record["status"] == "ok"


def test_an_episode_is_on_disk_where_the_desktops_user_cannot_read_it(play, stage, tmp_path: Path):
    env = play("subtitle", "DONE")
    folder = tmp_path / "episodes" / env.record["id"]
    assert (folder / "episode.json").exists()
    assert not stage.desktop.execute(["ls", str(folder)]).ok
