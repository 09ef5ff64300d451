"""Faults of the agent's input: what arrives on the machine, how it is proved, and that
`hijack verify` computes it again."""

import json
import re
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

import pytest
from click.testing import CliRunner

pytest.importorskip("gymnasium", reason="needs the extra [online]")

import hijack_data as hj
from hijack_data.actions.input_faults import InputFault, alter_code
from hijack_data.cli import hijack
from hijack_data.errors import ParameterError, PlanningError
from hijack_data.params import Every
from hijack_data.plugin import Corruption, Draft
from hijack_data.types import as_boxes
from online_env.errors import GuestError
from pipelines.proof.rebuild import rebuild

from support.episodes import make, play
from support.live import FakeDesktop, FakeStage

pytestmark = pytest.mark.usefixtures("no_waiting")
CLICK = "pyautogui.click(20, 30)"  # the middle of a button of 100 x 30 pixels is at 60, 35
INPUT_PROBLEM = re.compile(r"step 3: input|: the input at step 3 was not proved|inputs are not")
TYPE = "pyautogui.write('ab')"


def events(*names: str, at=(20, 30)) -> list[dict]:
    return [{"event": name, "code": 1, "at": list(at)} for name in names]


class WatchedDesktop(FakeDesktop):
    """A desktop whose guest server says what its X server got."""

    got: list[dict] = events()

    def tool(self, name, operation, fields, timeout):
        assert name == "inputtool"
        return {"events": self.got} if operation == "stop" else {}


def sent_codes(env, stage) -> list[str]:
    return [code.strip() for code in stage.desktop.ran]


def test_a_missed_input_moves_the_pointer_only_and_waits_for_an_action_that_presses():
    env, stage = make(corruption=hj.make_corruption("missed_input", step=1))
    play(env, CLICK, "WAIT", "pyautogui.moveTo(1, 2)", CLICK, CLICK, "DONE")
    assert sent_codes(env, stage) == [
        CLICK,
        "pyautogui.moveTo(1, 2)",
        "pyautogui.moveTo(20, 30)",
        CLICK,
    ]
    assert [entry["step"] for entry in env.record["inputs"]] == [3]
    assert env.record["last_action"] == "DONE"
    assert stage.history == (CLICK, "WAIT", "pyautogui.moveTo(1, 2)", CLICK, CLICK, "DONE")


def test_what_one_action_holds_for_the_next_is_not_hit():
    env, stage = make(corruption=hj.make_corruption("missed_input", step=0))
    items = ["pyautogui.keyDown('ctrl')", "pyautogui.keyUp('ctrl')"]
    play(env, *items, "pyautogui.keyDown('a'); pyautogui.keyUp('a')", "DONE")
    assert sent_codes(env, stage) == [*items, "pyautogui.sleep(0); pyautogui.sleep(0)"]


def test_a_slip_is_measured_by_the_element_under_the_pointer():
    spec = hj.make_corruption("slipped_pointer", step=0, distance=1.5)
    env, stage = make(corruption=spec)
    play(env, TYPE, CLICK, "DONE")
    _, arrived = sent_codes(env, stage)
    # half the button is 50 x 15 pixels; 20 - 75 is off the screen, so the slip is mirrored there
    assert arrived in (
        "pyautogui.click(95, 30)",
        "pyautogui.click(20, 53)",
        "pyautogui.click(20, 7)",
    )


@pytest.mark.parametrize(
    ("code", "dx", "arrived"),
    [
        ("click(0, 50)", -5, "click(5, 50)"),
        ("click(0, 50)", -500, None),  # the edge holds the pointer where it is
        ("click(0, 50)", 500, "click(199, 50)"),
        ("moveTo(100, 50)\npyautogui.click(0, 50)", -500, None),
        ("click()\npyautogui.moveTo(9, 9)", 5, None),  # it clicks before anything slips
        ("moveTo(0, 50)\npyautogui.dragTo(9, 50)", -500, "moveTo(0, 50)\npyautogui.dragTo(0, 50)"),
    ],
)
def test_a_slip_hits_no_action_that_arrives_where_it_aimed(code, dx, arrived):
    fault = InputFault("offset", ("click", "drag"), dx=dx)
    altered = alter_code(f"pyautogui.{code}", fault, (100, 200), as_boxes([]))
    assert altered == (arrived and f"pyautogui.{arrived}")


@pytest.mark.parametrize(
    ("code", "is_hit"),
    [
        ("press('ctrl+l')", False),  # a model's mistake, at which pyautogui presses nothing
        ("hotkey('nosuch')", False),
        ("hotkey()", False),
        ("write(['nosuch'])", False),
        ("keyDown('nosuch'); pyautogui.keyUp('nosuch')", False),
        ("hotkey('nosuch', 'L')", True),
        ("press(['nosuch', 'Enter'])", True),
        ("write('nosuch')", True),
    ],
)
def test_a_key_that_there_is_not_uses_no_fault_up(code, is_hit):
    for fault in (InputFault("drop"), InputFault("repeat")):
        altered = alter_code(f"pyautogui.{code}", fault, (100, 200), as_boxes([]))
        assert (altered is not None) == is_hit


@pytest.mark.parametrize("name", hj.corruption_names("everyday")[:3])
def test_verify_computes_what_arrived_again_and_finds_edits(name, tmp_path):
    env, _ = make(corruption=hj.make_corruption(name, step=(0, 2)), log=tmp_path)
    play(env, CLICK, CLICK, "WAIT", CLICK, "DONE")
    assert env.record["status"] == "ok"
    (folder,) = (tmp_path / "episodes").iterdir()
    assert verify_folder(tmp_path) == []
    path = folder / "steps.jsonl"
    rows = [json.loads(line) for line in path.read_text().splitlines()]
    hits = [row["step"] for row in rows if "input" in row]
    assert hits == [0, 3]
    for change in (
        lambda row: row["input"].update(sent=row["code"]),
        lambda row: row.pop("input"),
        lambda row: row["input"].update(faults=[]),
        lambda row: row["input"]["probe"].update(ok=False),
    ):
        edited = json.loads(json.dumps(rows))
        change(edited[3])
        path.write_text("".join(json.dumps(row) + "\n" for row in edited))
        assert any(INPUT_PROBLEM.search(problem) for problem in verify_folder(tmp_path))


def verify_folder(runs) -> list[str]:
    return [text for text in rebuild(runs).problems if "previous" not in text]


@pytest.mark.parametrize(
    ("name", "got", "problem"),
    [
        ("missed_input", events("button_down", "button_up"), "got 2 events, none was sent"),
        ("repeated_input", events("button_down", "button_up"), "which are not 2 times the same"),
        ("repeated_input", [], "no press"),
        ("slipped_pointer", events("button_down", "button_up"), "the button went down at [20, 30]"),
    ],
)
def test_a_fault_that_the_x_server_does_not_confirm_makes_the_episode_invalid(name, got, problem):
    stage = FakeStage(WatchedDesktop())
    stage.desktop.got = got
    env, _ = make(stage, corruption=hj.make_corruption(name, step=0))
    play(env, CLICK)
    assert env.record["status"] == "invalid"
    assert problem in env.record["problem"]


@pytest.mark.parametrize("operation", ["start", "stop"])
def test_a_guest_that_dies_under_a_fault_leaves_a_log_that_verifies(operation, tmp_path):
    class Dying(WatchedDesktop):
        def tool(self, name, asked, fields, timeout):
            if asked == operation:
                raise GuestError("the guest is gone")
            return super().tool(name, asked, fields, timeout)

    corruption = hj.make_corruption("missed_input", step=1)
    env, _ = make(FakeStage(Dying()), corruption=corruption, log=tmp_path)
    play(env, TYPE, CLICK)
    assert (env.record["status"], len(env.record["inputs"])) == ("error", 1)
    assert verify_folder(tmp_path) == []


def test_events_of_the_x_server_prove_a_repetition():
    stage = FakeStage(WatchedDesktop())
    stage.desktop.got = events("button_down", "button_up") * 2
    env, _ = make(stage, corruption=hj.make_corruption("repeated_input", step=0))
    play(env, CLICK, "DONE")
    assert env.record["status"] == "ok"
    assert env.record["inputs"][0]["probe"]["facts"] == {
        "by": "events",
        "down": 2,
        "events": 4,
        "once": 2,
    }


def test_a_trigger_with_a_cap_is_verified(tmp_path):
    missed_input = hj.make_corruption("missed_input", step=Every(1))
    env, _ = make(corruption=hj.OneOf([missed_input], p_clean=0.5, max_times=2), log=tmp_path)
    play(env, *[CLICK] * 12, "DONE")
    assert len(env.record["inputs"]) == 2
    assert rebuild(tmp_path).problems == []
    (path,) = tmp_path.glob("episodes/*/episode.json")
    text = path.read_text()
    assert "max_times: 2" in text
    path.write_text(text.replace("max_times: 2", "max_times: 3"))
    assert any("plan" in problem for problem in rebuild(tmp_path).problems)


@pytest.mark.parametrize(
    ("parts", "words"),
    [
        ([hj.NetworkError(), hj.make_corruption("slow_network")], "no rate can be measured"),
        ([hj.make_corruption("missed_input")] * 2, "plans 'drop' twice at one step"),
        ([hj.AccidentalTouch(), hj.AccidentalTouch()], "plans 'touch' twice at one step"),
    ],
)
def test_parts_that_cannot_act_together_are_refused(parts, words):
    env, _ = make(corruption=hj.Sequence(parts))
    with pytest.raises(ParameterError, match=words):
        env.reset(seed=0)


def test_a_plan_of_one_corruption_has_each_kind_of_fault_once():
    @dataclass(frozen=True)
    class Lossy(Corruption):
        name: ClassVar[str] = "lossy"
        scope: ClassVar[str] = "action"
        inputs: ClassVar[tuple[str, ...]] = ("drop",)

        def make_plan(self, scene, stream, step):
            return Draft(inputs=(InputFault("drop", ("click",)), InputFault("drop", ("key",))))

    with pytest.raises(PlanningError, match="lossy-v1 plans the fault 'drop' twice at one step"):
        Lossy().plan(hj.Scene((9, 9)), seed=0)


def test_an_agent_that_may_run_any_code_is_refused():
    env, _ = make(corruption="missed_input", allow_code=True)
    with pytest.raises(ParameterError, match="allow_code"):
        env.reset(seed=0)


def test_two_faults_wait_side_by_side():
    parts = [
        hj.make_corruption("repeated_input", step=0),
        hj.make_corruption("missed_input", step=1),
    ]
    env, stage = make(corruption=hj.Sequence(parts))
    play(env, "WAIT", TYPE, TYPE, TYPE, "DONE")
    # what gets lost uses up no repetition, which waits for the next action
    assert sent_codes(env, stage) == ["pyautogui.sleep(0)", f"{TYPE}\n{TYPE}", TYPE]
    assert [[fault["input"] for fault in entry["faults"]] for entry in env.record["inputs"]] == [
        ["drop"],
        ["repeat"],
    ]


def test_a_plugin_of_30_lines_changes_actions_of_its_own_and_passes_every_check():
    path = Path(__file__).parents[2] / "examples/trembling_hand.py"
    assert len(path.read_text().splitlines()) <= 30
    result = CliRunner().invoke(hijack, ["check", str(path)])
    assert result.exit_code == 0, result.output
    env, stage = make(corruption=hj.make_corruption("trembling_hand", pixels=5))
    play(env, CLICK, TYPE, "DONE")
    slipped, typed = sent_codes(env, stage)
    x, y = map(int, re.findall("[0-9]+", slipped))
    assert 1 <= abs(x - 20) <= 5
    assert abs(y - 30) <= 5
    assert typed == TYPE
