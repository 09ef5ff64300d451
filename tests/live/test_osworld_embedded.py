"""OSWorld's own evaluators on a real embedded desktop: tasks of its own, and the self-test."""

import contextlib
import sqlite3
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from online_env.osworld import history
from online_env.osworld.env import OsworldEnv
from online_env.osworld.run import embedded_env
from online_env.osworld.selftest import Results, choose, read_groups, run, run_all
from online_env.osworld.tasks import OsworldTask, Revision, TaskSet, load

from support import needs

HERE = Revision("test", "0")


@pytest.fixture(scope="module")
def env(embedded_machine: None, tmp_path_factory: pytest.TempPathFactory) -> Iterator[OsworldEnv]:
    with embedded_env(
        needs.osworld(), tmp_path_factory.mktemp("cache"), size=(800, 1280), standby=False
    ) as result:
        yield result


def task(command: str, config: Any = (), func: str = "exact_match", **more: Any) -> OsworldTask:
    evaluator = {
        "func": func,
        "result": {"type": "vm_command_line", "command": command, "shell": True},
        "expected": {"type": "rule", "rules": {"expected": "yes\n"}},
        **more,
    }
    content = {"id": "t-1", "instruction": "x", "config": list(config), "evaluator": evaluator}
    return OsworldTask("t-1", "os", content, Path("t-1.json"))


def shell(command: str) -> dict[str, Any]:
    return {"type": "execute", "parameters": {"command": command, "shell": True}}


def test_tasks_of_osworld_are_scored(env: OsworldEnv, shared_data: Path) -> None:
    tasks = load(shared_data / "tasks" / "osworld_verified")
    groups = read_groups(shared_data / "tasks" / "feasibility.json")
    chosen_tasks = choose(tasks, groups, ["e0df059f", "b3d4a89c"])
    calls: list[str] = []
    results = run_all(env, chosen_tasks, groups, {}, lambda row, _: calls.append(row.id))
    rows = {row.id[:8]: row for row in results.rows}
    assert {(row.status, row.untouched, row.solved) for row in results.rows} == {("works", 0, 1)}, (
        results.as_markdown()
    )
    assert (rows["e0df059f"].how, rows["b3d4a89c"].how) == ("shell", "FAIL")
    assert (rows["e0df059f"].group, rows["e0df059f"].revision) == ("A0_local", str(tasks.revision))
    assert len(calls) == 2
    assert results.sound


def test_a_task_that_is_done_already_or_by_waiting_is_excluded(env: OsworldEnv) -> None:
    result = run(env, task("echo yes"), HERE)
    assert (result.status, result.reason, result.untouched) == ("excluded", "scores 1 untouched", 1)
    later = {
        "type": "launch",
        "parameters": {"command": "sleep 3; echo yes > ~/late", "shell": True},
    }
    late = run(env, task("cat ~/late", [later]), HERE)
    assert (late.status, late.reason) == ("excluded", "scores 1 untouched")


def test_a_setup_that_fails_excludes(env: OsworldEnv) -> None:
    launch = {"type": "launch", "parameters": {"command": ["no-such-editor"]}}
    row = run(env, task("true", [launch], func="infeasible"), HERE)
    assert row.status == "excluded"
    assert row.reason.startswith("its setup fails here: ERROR Failed to launch application")


def test_an_evaluator_that_raises_is_an_error_on_record(env: OsworldEnv) -> None:
    row = run(
        env,
        task(
            "",
            [shell("rm -f ~/.config/vlc/vlcrc")],
            "check_qt_bgcone",
            result={"type": "vlc_config", "dest": "vlcrc"},
            expected={"type": "rule", "rules": {"expected_qt_bgcone": 0}},
        ),
        HERE,
    )
    assert (row.status, row.untouched) == ("error", None)
    assert "TypeError" in row.reason
    assert not Results(HERE, {}, [row]).sound


def test_every_reset_is_pristine(env: OsworldEnv) -> None:
    marked = task("ls ~/mark 2>&1 >/dev/null | grep -q . && echo yes", [])
    env.reset(marked.config)
    env.step("import subprocess; subprocess.run('touch ~/mark', shell=True)", pause=0)
    assert env.evaluate() == 0
    env.reset(marked.config)
    assert env.evaluate() == 1


def test_groups_and_beginnings_choose(shared_data: Path) -> None:
    tasks = load(shared_data / "tasks" / "osworld_verified")
    groups = read_groups(shared_data / "tasks" / "feasibility.json")
    assert len(choose(tasks, groups, ["A0_local"])) == 23
    assert len(choose(tasks, groups, ["A0_local", "I0_infeasible_nofiles", "030eeff7"])) == 40
    assert isinstance(choose(tasks, groups, []), TaskSet)
    with pytest.raises(ValueError, match="neither a group nor a task; did you mean 'A0_local'"):
        choose(tasks, groups, ["A0_locla"])


def test_a_task_without_config_and_one_with_a_history_are_provided_for(
    env: OsworldEnv, tmp_path: Path
) -> None:
    plain = OsworldTask(
        "t-0",
        "os",
        {"id": "t-0", "instruction": "x", "evaluator": {"func": "infeasible"}},
        Path("t"),
    )
    wants = task("", [{"type": "update_browse_history", "parameters": {"history": []}}])
    history.provide(env, TaskSet(HERE, (plain,)), tmp_path)
    assert list(tmp_path.iterdir()) == []
    needs.apps("chromium")
    history.provide(env, TaskSet(HERE, (plain, wants)), tmp_path)
    with contextlib.closing(sqlite3.connect(tmp_path / "t-1" / "history_new.sqlite")) as result:
        assert result.execute("select count(*) from urls").fetchone() == (0,)
        assert result.execute("select count(*) from visits").fetchone() == (0,)
