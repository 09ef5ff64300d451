"""Guards: the rules on pictures, a model that looks on, and runs of both with `--guard`."""

import json
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

pytest.importorskip("gymnasium", reason="needs the extra [online]")
pytest.importorskip("rapidocr", reason="needs the extra [ocr]")
pytest.importorskip("openai", reason="needs the extra [agents]")

from ext_package.paper import PaperDesktop, PressOk, provider
from PIL import Image

from hijack_data.cli import main
from hijack_data.errors import HijackError, ParameterError, UnknownNameError
from online_env.agents.agent_calls import method_names
from online_env.agents.agent_thread import AgentThread
from online_env.agents.chat.onlooker import CHECK
from online_env.agents.guarded import Guarded, Notice, joint_usage
from online_env.agents.guards import check_guard, find_guard, make_onlooker
from online_env.agents.pixel.picture_onlooker import COVERED, GONE
from online_env.agents.pixel.rules_onlooker import (
    NO_RESPONSE,
    UNCHANGED,
    RulesOnlooker,
    is_unchanged,
)
from online_env.agents.pixel.screen_reader import TextLine
from online_env.agents.registry import AGENTS
from online_env.bench.bench_command import bench
from online_env.bench.providers import PROVIDERS
from online_env.environment import Settle
from online_env.errors import DesktopError
from online_env.mcp.tool_client import ToolClient
from online_env.report.build import build_report
from online_env.results import records
from online_env.scoring.score_command import score
from online_env.tasks import TASKS

from support.chatting import file
from support.endpoints import serving
from support.scoring import dataset, write_agents

ROOT = Path(__file__).resolve().parents[2]
CLICK = "pyautogui.click(300, 200)"
WAITS = [[f"pyautogui.sleep({seconds})"] for seconds in (1, 2, 4, 8)]
SIZE = (1080, 1920)


def locked():
    image = Image.open(ROOT / "hijack_data/assets/lock_screen-1920x1080-1.webp").convert("RGB")
    return np.asarray(image.crop((640, 330, 1280, 740)))


def line(text, x=0, y=0):
    return TextLine(text=text, box=(x, y, x + 10 * len(text), y + 20))


def panel(*windows):
    buttons = [line(window, x=300 + 300 * at, y=1050) for at, window in enumerate(windows)]
    return [line("Applications", x=20, y=1050), *buttons]


class Says:
    """An agent that gives its answers in turn, and keeps what it was told."""

    def __init__(self, *answers):
        self.answers = list(answers)
        self.instructions = []

    def predict(self, instruction, obs):
        self.instructions.append(instruction)
        obs["screenshot"][:] = 7  # an agent may do that to its picture
        return "I act.", [self.answers.pop(0)]


class Screens:
    """A reader of pictures whose text is known by the first pixel."""

    def __init__(self, texts):
        self.texts, self.counts = texts, RulesOnlooker()._reader.counts

    def read(self, picture):
        return tuple(self.texts[int(picture[0, 0, 0])])


def rules(texts=()):
    onlooker = RulesOnlooker()
    onlooker._reader = Screens(texts or [[]] * 256)
    return onlooker


def play(guarded, *shades):
    """The actions on pictures of one colour each."""
    return [
        guarded.predict("do it", {"screenshot": np.full((*SIZE, 3), shade, np.uint8)})[1]
        for shade in shades
    ]


# The rules


def test_a_locked_screen_is_reported_once_and_unlocked_before_the_agent_is_asked():
    agent = Says(CLICK)
    guarded = Guarded(agent, RulesOnlooker())
    values = [guarded.predict("do it", {"screenshot": locked()})[1] for _ in range(3)]
    assert values == [
        ["REQUEST_REINIT"],
        ["pyautogui.write('password')"],
        ["pyautogui.press('enter', presses=1)"],
    ]
    assert agent.instructions == []
    assert [intervention["step"] for intervention in guarded.guard_record["interventions"]] == [
        0,
        1,
        2,
    ]


def test_a_click_that_changes_nothing_is_waited_for_then_repeated():
    agent = Says(CLICK, "WAIT", CLICK, "pyautogui.hotkey('ctrl', 'c')", "DONE")
    guarded = Guarded(agent, rules())
    assert play(guarded, *[0] * 7) == [[CLICK], *WAITS, [CLICK], ["WAIT"]]
    kinds = {intervention["kind"] for intervention in guarded.guard_record["interventions"]}
    assert kinds == {UNCHANGED}
    # the agent's own waiting is no click, nor is a key, and what came is no reason to wait
    assert play(guarded, 0, 1, 1) == [[CLICK], ["pyautogui.hotkey('ctrl', 'c')"], ["DONE"]]


def test_enter_is_pressed_again_but_no_other_key():
    enter, delete = "pyautogui.press('enter')", "pyautogui.press('delete')"
    agent = Says(enter, delete, "DONE")
    played = play(Guarded(agent, rules()), *[0] * 8)
    assert played == [[enter], *WAITS, [enter], [delete], ["DONE"]]


def test_text_that_does_not_arrive_is_not_typed_twice_but_told():
    typed = "pyautogui.write('abc')"
    agent = Says(typed, "DONE")
    assert play(Guarded(agent, rules()), *[0] * 6) == [[typed], *WAITS, ["DONE"]]
    assert "Reminder: The last action has changed nothing" in agent.instructions[1]


def test_pointer_and_caret_are_no_change_and_a_tick_is_one():
    before = np.full((200, 300, 3), 255, np.uint8)
    after = before.copy()
    after[40:60, 20:30] = 0  # the pointer left (20, 40)
    after[100:120, 100:112] = 0  # and came to (100, 100)
    assert is_unchanged(before, after, [(20, 40), (100, 100)])
    assert not is_unchanged(before, after, [None, (100, 100)])
    after[150:170, 200:202] = 0
    assert is_unchanged(before, after, [(20, 40), (100, 100)])
    after[88:94, 88:94] = 0  # a box ticked above and left of the hot spot
    assert not is_unchanged(before, after, [(20, 40), (100, 100)])
    assert not is_unchanged(before, after[1:], [])


def test_windows_that_went_or_came_by_themselves_are_put_right_by_the_panel():
    work = [line(f"row {n}", y=40 + 30 * n) for n in range(12)]
    at_work = [line("Notes - Mousepad", x=400), *work, *panel("Notes - Mousepad", "Files")]
    texts = [at_work, panel("Notes - Mousepad", "Files"), [*at_work, line("News", 900, 1050)]]
    leaving = Guarded(Says(CLICK), rules(texts))
    assert play(leaving, 0, 1)[1] == ["pyautogui.click(380, 1060)"]
    assert leaving.guard_record["interventions"][0]["kind"] == GONE
    waiting = Guarded(Says("WAIT", CLICK), rules(texts))
    assert play(waiting, 0, 2)[1] == ["pyautogui.rightClick(920, 1060)"]
    assert waiting.guard_record["interventions"][0]["kind"] == COVERED
    opening = Guarded(Says(CLICK, "DONE"), rules(texts))
    assert play(opening, 0, 2) == [[CLICK], ["DONE"]], "the agent's click may have opened it"
    keys = "pyautogui.hotkey('alt', 'f2')"
    late = Guarded(Says(keys, "WAIT", "DONE"), rules(texts))
    assert play(late, 0, 0, 2) == [[keys], ["WAIT"], ["DONE"]], "it may come while the agent waits"


def test_a_rule_acts_twice_then_it_only_reminds():
    texts = [[], [line("This window might be busy and is not responding."), line("No", y=50)]]
    agent = Says(*[CLICK] * 9)
    guarded = Guarded(agent, rules(texts))
    result = play(guarded, 0, *[1] * 6)
    assert result.count(["pyautogui.click(10, 60)"]) == 2
    assert result[-1] == [CLICK]
    assert f"Reminder: {NO_RESPONSE}." in agent.instructions[-1]


# A model


def answer(body):
    text = json.dumps(body)
    if "You look at the first screenshot" in text:
        return "Reminder: Please log in."
    return "It clicked.\nNot the agent's doing: A menu opened."


def test_a_model_looks_on_and_its_words_reach_any_agent(tmp_path):
    assert CHECK == "onlooker_check"
    with serving(answer) as endpoint:
        name = find_guard(str(file(tmp_path, endpoint.url)))
        agent = Says(CLICK, "DONE")
        guarded = Guarded(agent, make_onlooker(name, "random"))
        values = [
            guarded.predict("do it", {"screenshot": np.full((60, 80, 3), n, np.uint8)})[1]
            for n in range(3)
        ]
    assert values == [["REQUEST_REINIT"], [CLICK], ["DONE"]]
    assert agent.instructions[0] == "do it\n\nReminder: Please log in."
    assert agent.instructions[1] == (
        "do it\n\nYour last step: It clicked.\n\nNot your doing: A menu opened."
        "\n\nReminder: Please log in."
    )
    assert CLICK in json.dumps(endpoint.asked[-1])
    assert guarded.usage["requests"] == guarded.usage["guard"]["requests"] == 3


def test_no_row_is_answered_past_the_guard():
    """An agent that answers rows by the batch did so, unguarded."""

    class Batched:
        def predict(self, instruction, obs):
            return "", [CLICK]

        def predict_batch(self, instructions, pictures):
            return [("", [CLICK])] * len(pictures)

    guarded = Guarded(Batched(), RulesOnlooker())
    assert "predict_batch" in method_names(Batched())
    assert "predict_batch" not in method_names(guarded)


def test_a_cost_that_one_of_the_two_does_not_know_is_not_known():
    counts = {"requests": 1, "retries": 0, "input_tokens": 5, "output_tokens": 2, "seconds": 1.0}
    result = joint_usage({**counts, "usd": 0.5}, {**counts, "usd": 0.25})
    assert (result["requests"], result["input_tokens"], result["usd"]) == (2, 10, 0.75)
    assert joint_usage({**counts, "usd": None}, {**counts, "usd": 0.25})["usd"] is None
    assert joint_usage(counts, {**counts, "usd": 0.25})["usd"] is None
    assert joint_usage(None, {"reading": {}}) == {"guard": {"reading": {}}}
    assert joint_usage(None, None) is None


def test_a_client_of_mcp_reads_what_its_guard_says():
    class Tells:
        name, checks, reinits, settings, usage = "t", False, False, {}, None

        def begin_step(self):
            pass

        def watch(self, instruction, step, picture):
            return Notice(kind="k", summary="It clicked.", reminder="Look.")

    client = ToolClient()
    obs = {"screenshot": np.zeros((9, 9, 3), np.uint8)}
    with AgentThread(lambda: client) as agent, ThreadPoolExecutor() as pool:
        guarded = Guarded(agent, Tells())
        pool.submit(lambda: [guarded.predict("do it", obs) for _ in range(2)])
        first, second = client.look(), client.act(CLICK)
        client.leave()
    assert (first.instruction, first.notice) == ("do it", "")
    assert second.instruction == "do it"
    assert second.notice == "Your last step: It clicked.\n\nReminder: Look."


# Runs


CONFIG = """
desktop: {provider: paper, size: [320, 240]}
tasks: [press_ok]
agents: [do_nothing]
corruptions: [clean]
max_steps: 4
"""
OWN = """
class Mine:
    def predict(self, instruction, obs):
        return "x" * 10**6, ["pyautogui.click(70, 70)" if "Reminder" in instruction else "DONE"]
"""


@pytest.fixture
def paper(monkeypatch):
    """A desktop of paper, which is settled at once, and its task."""
    before = [(registry, dict(registry.entries)) for registry in (AGENTS, PROVIDERS, TASKS)]
    PROVIDERS.add(provider, "paper")
    TASKS.add(PressOk)
    monkeypatch.setattr(PaperDesktop, "settle", Settle(quiet=0, cap=0), raising=False)
    yield
    for registry, entries in before:
        registry.entries.clear()
        registry.entries.update(entries)


def run(folder, *words, code=0):
    (folder / "bench.yaml").write_text(CONFIG)
    argv = [str(folder / "bench.yaml"), "--out", str(folder / "run"), "--desktops", "1", *words]
    result = CliRunner().invoke(bench, argv)
    if isinstance(result.exception, HijackError):
        raise result.exception
    assert result.exit_code == code, result.output
    return result.output, records.read(folder / "run")


@pytest.mark.usefixtures("paper", "no_waiting")
def test_a_run_with_a_guard_keeps_the_agent_in_its_process_and_says_what_the_guard_did(
    tmp_path, capsys
):
    (tmp_path / "mine.py").write_text(OWN)
    with serving(answer) as endpoint:
        guard = str(file(tmp_path, endpoint.url))
        _, value = run(tmp_path, "--agent", f"{tmp_path}/mine.py:Mine", "--guard", guard)
    (record,) = value.records
    assert record["guard"]["name"] == "model"
    assert record["guard"]["settings"]["path"] == guard
    assert record["guard"]["interventions"] == [
        {"step": 0, "kind": "environment error", "actions": ["REQUEST_REINIT"]},
        {"step": 1, "kind": "environment error", "actions": []},
    ]
    assert record["usage"]["requests"] > 1
    assert len(record["said"]) <= 2000, "the guard is fed what the process's door lets through"
    assert (tmp_path / "run" / "requests").is_dir()
    (note,) = [note for note in build_report(value).notes if note.startswith("Guard ")]
    assert guard in note
    assert "2 of these were in clean episodes" in note
    with pytest.raises(SystemExit) as verified:
        main(["verify", str(tmp_path / "run")])
    assert verified.value.code == 0, capsys.readouterr()
    # a record that claims another intervention is noticed
    for path in [tmp_path / "run" / "records.jsonl", *(tmp_path / "run").rglob("episode.json")]:
        path.write_text(path.read_text().replace('["REQUEST_REINIT"]', '["WAIT"]'))
    with pytest.raises(SystemExit) as sabotaged:
        main(["verify", str(tmp_path / "run")])
    assert sabotaged.value.code == 1
    printed = capsys.readouterr()
    assert "guard.interventions has 'WAIT' at step 0" in printed.out + printed.err


def two_voices(body):
    """The guard's answers, and those of a model that ends once its history has the guard's words."""
    text = json.dumps(body)
    if "You look at the first screenshot" in text:
        return "Reminder: None"
    if "A GUI agent works on a task" in text:
        return "It clicked.\nNot the agent's doing: A menu opened."
    is_told = "Step 1: It clicked." in text and "Not the agent's doing: A menu opened." in text
    return "```DONE```" if is_told and "Your last step" not in text else f"```{CLICK}```"


@pytest.mark.usefixtures("paper", "no_waiting")
def test_the_words_of_a_guard_are_turns_of_a_models_history(tmp_path):
    with serving(two_voices) as endpoint:
        name = str(file(tmp_path, endpoint.url))
        _, value = run(tmp_path, "--agent", name, "--guard", "model")
    (record,) = value.records
    assert (record["last_action"], record["steps"]) == ("DONE", 2)
    summary = next(body for body in endpoint.asked if "A GUI agent works" in json.dumps(body))
    assert json.dumps(summary).count(CLICK) == 1, "a model's words hold its action already"


@pytest.mark.usefixtures("paper")
def test_a_guarded_run_whose_desktop_once_failed_at_the_start_verifies(tmp_path, monkeypatch):
    resets = iter((DesktopError("the network is gone"),))

    def reset(self, task=None):
        for error in resets:
            raise error

    monkeypatch.setattr(PaperDesktop, "reset", reset)
    _, value = run(tmp_path, "--guard", "rules")
    assert [record["status"] for record in value.records] == ["invalid", "ok"]
    with pytest.raises(SystemExit) as verified:
        main(["verify", str(tmp_path / "run")])
    assert verified.value.code == 0


@pytest.mark.usefixtures("paper")
@pytest.mark.parametrize("error", [ValueError("no text"), HijackError("no text")])
def test_a_guard_that_fails_ends_its_episode_and_not_the_run(error, tmp_path, monkeypatch):
    def check(self, picture, instruction):
        raise error

    monkeypatch.setattr(RulesOnlooker, "check", check)
    _, value = run(tmp_path, "--guard", "rules", code=1)
    (record,) = value.records
    assert (record["status"], record["cause"]) == ("error", "agent")
    assert f"{type(error).__name__} in its guard: no text" in record["problem"]


@pytest.mark.usefixtures("paper")
def test_guards_that_cannot_be_are_refused_before_the_run(tmp_path):
    with pytest.raises(UnknownNameError, match="not 'rule'; did you mean 'rules'"):
        run(tmp_path, "--guard", "rule")
    with pytest.raises(ParameterError, match="do_nothing is no agent file"):
        run(tmp_path, "--guard", "model")
    with pytest.raises(ParameterError, match="agenthijack-agent has an onlooker of its own"):
        check_guard("rules", (AGENTS.find("agenthijack-agent"),))
    with pytest.raises(ParameterError, match="pixel_onlooker has an onlooker of its own"):
        check_guard("rules", (AGENTS.find("pixel_onlooker"),))
    with pytest.raises(ParameterError, match="OpenAI keeps the conversation of openai-computer"):
        check_guard("rules", (AGENTS.find("openai-computer"),))
    assert not (tmp_path / "run").exists()


def test_scored_rows_are_asked_through_the_guard(tmp_path, monkeypatch):
    class Waits:
        name, checks, reinits, settings, usage = "rules", True, False, {}, None

        def check(self, picture, instruction):
            return Notice(kind="test", reminder="r", actions=("WAIT",))

        def reset(self):
            pass

        def begin_step(self):
            pass

    monkeypatch.setattr("online_env.scoring.row_asker.make_onlooker", lambda *_: Waits())
    agents = write_agents(tmp_path)
    data = dataset(tmp_path / "data", [{}, {}])
    words = [str(data), "--agent", f"{agents}:Batched", "--guard", "rules"]
    result = CliRunner().invoke(score, [*words, "--out", str(tmp_path / "run")])
    assert result.exit_code == 0, result.output
    value = records.read(tmp_path / "run")
    assert value.config["guard"] == "rules"
    assert {record["last_action"] for record in value.records} == {"WAIT"}
    assert all(record["guard"]["interventions"] for record in value.records)

    def fail(self, picture, instruction):
        raise ValueError("no text")

    monkeypatch.setattr(Waits, "check", fail)
    result = CliRunner().invoke(score, [*words, "--out", str(tmp_path / "failed")])
    assert result.exit_code == 1, result.output
    problems = {record["problem"] for record in records.read(tmp_path / "failed").records}
    assert problems == {"the agent: ValueError in its guard: no text"}
