"""OSWorld's tasks on a stage whose environment is none: files, leftovers, setups that fail."""

import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

pytest.importorskip("gymnasium", reason="needs the extra [online]")

from hijack_data.actions.agent_actions import read_action
from hijack_data.errors import ParameterTypeError
from online_env import tasks
from online_env.errors import DesktopError
from online_env.osworld import file_tasks, history
from online_env.osworld import stage as stage_module
from online_env.osworld.cache_files import HISTORY_NAME
from online_env.osworld.errors import OsworldError
from online_env.osworld.file_tasks import RUN_DIALOG, TERMINAL_TITLE, OsworldTasks, task_class
from online_env.osworld.solutions import SOLUTIONS

from support.trees import node, tree

NAME = "a1"
HISTORY = {"type": "update_browse_history", "parameters": {}}


class Env:
    """What the stage calls of OSWorld's environment; `logs` are its warnings, setup by setup."""

    def __init__(self, *logs: list[str], made: bytes | None = b"history") -> None:
        self.logs = list(logs)
        self.warnings: list[str] = []
        self.action_history: list[Any] = []
        self.tasks: list[str] = []
        self.ran: list[str] = []
        self.controller = SimpleNamespace(
            get_screenshot=lambda: None,
            execute_python_command=self.ran.append,
            get_file=lambda path: made,
        )

    def reset(self, task_config: dict[str, Any]) -> dict[str, Any]:
        self.tasks.append(task_config["id"])
        self.warnings = self.logs.pop(0) if self.logs else []
        return {}

    def step(self, action: Any, pause: float = 2.0) -> None:
        raise AssertionError("nobody acts")

    def evaluate(self) -> float:
        raise AssertionError("nobody is judged")


@pytest.fixture
def task(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """Make a task of OSWorld known, which has the given steps; nothing is waited for."""
    monkeypatch.setattr(tasks.TASKS, "entries", dict(tasks.TASKS.entries))
    monkeypatch.setattr(stage_module.time, "sleep", lambda _: None)

    def make(*steps: dict[str, Any]) -> str:
        config = {
            "id": NAME,
            "instruction": "Do it.",
            "related_apps": ["os"],
            "config": list(steps),
            "evaluator": {"func": "exact_match"},
        }
        path = tmp_path / "os" / f"{NAME}.json"
        path.parent.mkdir(exist_ok=True)
        path.write_text(json.dumps(config))
        tasks.TASKS.entries[NAME] = task_class(str(path))
        return NAME

    return make


def content(folder: Path) -> dict[str, bytes]:
    return {
        path.relative_to(folder).as_posix(): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


def test_each_episode_has_its_files_as_they_were_fetched(task: Any, tmp_path: Path) -> None:
    task()
    files, cache = tmp_path / "files", tmp_path / "cache"
    (files / NAME / "deep").mkdir(parents=True)
    (files / NAME / "deep" / "gold.txt").write_bytes(b"gold")
    (files / "other").mkdir()
    before = content(files)
    stage = OsworldTasks(Env(), files, cache)
    setting = stage.reset(NAME, 0)
    assert (setting.id, setting.instruction) == (NAME, "Do it.")
    assert content(cache) == {"a1/deep/gold.txt": b"gold"}
    (cache / NAME / "deep" / "gold.txt").write_bytes(b"spoilt by an evaluator")
    (cache / NAME / "left_over.txt").write_bytes(b"of the first episode")
    stage.reset(NAME, 1)
    assert content(cache) == {"a1/deep/gold.txt": b"gold"}
    assert content(files) == before, "the files of the user are only read"


def test_a_setup_that_fails_is_an_error_and_the_next_episode_is_none_the_worse(
    task: Any, tmp_path: Path
) -> None:
    task()
    env = Env(["WARNING slow", "ERROR no such file /x", "ERROR and more"], ["WARNING slow"])
    stage = OsworldTasks(env, None, tmp_path / "cache")
    with pytest.raises(DesktopError) as caught:
        stage.reset(NAME, 0)
    assert str(caught.value) == "OSWorld's setup of a1 failed: ERROR no such file /x"
    assert stage.reset(NAME, 0).id == NAME
    assert env.tasks == [NAME, NAME]


def test_a_task_of_ours_is_not_set_up_here(task: Any, tmp_path: Path) -> None:
    env = Env()
    stage = OsworldTasks(env, None, tmp_path / "cache")
    with pytest.raises(ParameterTypeError, match="a task of OSWorld is wanted, got 'write_note'"):
        stage.reset("write_note", 0)
    assert env.tasks == []


def test_the_history_is_made_anew_for_each_episode_unless_the_user_has_one(
    task: Any, tmp_path: Path
) -> None:
    task(HISTORY)
    env = Env()
    cache = tmp_path / "cache"
    stage = OsworldTasks(env, None, cache)
    for _ in range(2):
        stage.reset(NAME, 0)
        assert content(cache) == {f"{NAME}/{HISTORY_NAME}": b"history"}
        (cache / NAME / HISTORY_NAME).write_bytes(b"with pages that the task has added")
    assert len(env.ran) == 2
    files = tmp_path / "files"
    (files / NAME).mkdir(parents=True)
    (files / NAME / HISTORY_NAME).write_bytes(b"the user's")
    OsworldTasks(env, files, cache).reset(NAME, 0)
    assert content(cache) == {f"{NAME}/{HISTORY_NAME}": b"the user's"}
    assert len(env.ran) == 2


@pytest.mark.parametrize("made", [None, b""])
def test_a_browser_that_makes_no_history_is_told_before_the_setup(
    task: Any, tmp_path: Path, made: bytes | None
) -> None:
    task(HISTORY)
    env = Env(made=made)
    with pytest.raises(OsworldError) as caught:
        OsworldTasks(env, None, tmp_path / "cache").reset(NAME, 0)
    assert str(caught.value) == (
        "the desktop's browser made no history file; is it installed? (hijack desktop install)"
    )
    assert (env.tasks, content(tmp_path / "cache")) == ([], {})


def test_the_command_that_makes_a_history_is_python_for_the_guest(tmp_path: Path, task: Any):
    task(HISTORY)
    env = Env()
    OsworldTasks(env, None, tmp_path / "cache").reset(NAME, 0)
    (command,) = env.ran
    compile(command, "guest", "exec")
    assert history.PROFILE in command


class ShellHand:
    """The hand of an oracle, of which a script uses actions and tree."""

    def __init__(self, tree: str) -> None:
        self.code: list[str] = []
        self._tree = tree

    def run(self, code: str) -> None:
        self.code.append(code)

    def tree(self) -> str:
        return self._tree


def test_the_oracle_types_a_scripts_commands_into_a_terminal(
    task: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(file_tasks.time, "sleep", lambda _: None)
    task()
    titles = (RUN_DIALOG, TERMINAL_TITLE, "GNU Image Manipulation Program", "Untitled 1")
    window_tree = tree("all", *(node("frame", title) for title in titles))
    names = [name for name, value in SOLUTIONS.items() if value.how == "shell"]
    assert names
    for name in names:
        hand: Any = ShellHand(window_tree)
        type("Named", (tasks.TASKS.get(NAME),), {"name": name})(0).oracle(hand)
        assert hand.code[:3] == [
            "pyautogui.hotkey('alt', 'f2')",
            "pyautogui.write('xfce4-terminal')",
            "pyautogui.hotkey('enter')",
        ]
        assert 4 <= len(hand.code) <= 6
        assert all("\\n" in code for code in hand.code[3:])
        for code in hand.code:
            assert read_action(code).kind == "code"  # what any agent may do


def test_a_task_without_a_script_is_not_played(task: Any) -> None:
    task()
    hand: Any = ShellHand("")
    with pytest.raises(DesktopError, match="no script solves OSWorld's task"):
        tasks.TASKS.get(NAME)(0).oracle(hand)
    assert hand.code == []
