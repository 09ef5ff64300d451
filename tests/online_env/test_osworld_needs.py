"""What tasks of OSWorld need, read from their files."""

import json
from collections import Counter
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner

from hijack_data.cli import hijack
from online_env.osworld.task_needs import TESTED, list_all_needs, list_needs, summary
from online_env.osworld.tasks import OsworldTask, load

FILE = {"type": "download", "parameters": {"files": [{"url": "https://a.test/x", "path": "/x"}]}}
MISSING = "metric compare_table needs the package 'pandas'"


def task(
    *steps: dict[str, Any],
    evaluator: dict[str, Any] | None = None,
    instruction: str = "Do it",
    **more: Any,
) -> OsworldTask:
    config = {
        "id": "a1",
        "instruction": instruction,
        "config": list(steps),
        "evaluator": evaluator or {"func": "exact_match"},
        **more,
    }
    return OsworldTask("a1", "os", config, Path("a1.json"))


def launch(*words: str) -> dict[str, Any]:
    return {"type": "launch", "parameters": {"command": list(words)}}


@pytest.mark.parametrize(
    ("given", "needs"),
    [
        (task(launch("vlc")), {}),
        (task(FILE), {"files": "1 to fetch"}),
        (task(launch("code", "/x")), {"program": "VS Code"}),
        (task(related_apps=["vs_code"]), {"program": "VS Code"}),
        (task(launch("/usr/bin/nautilus")), {"program", "gnome"}),
        (task(launch("gsettings", "set")), {"gnome"}),
        (task(launch("google-chrome", "https://b.test/page")), {"web": "b.test"}),
        (task(launch("google-chrome", "http://localhost:9222")), {}),
        (task(FILE, launch("cat", "https://a.test/x")), {"files"}),
        (task(instruction="Look at https://b.test/list."), {"web": "b.test"}),
        (task(proxy=True), {"web": "sites behind OSWorld's proxy"}),
        (task(launch("sudo", "apt install jq")), {"web"}),
        (task({"type": "login", "parameters": {}}), {"account"}),
        (task({"type": "update_browse_history", "parameters": {"u": "https://b.test"}}), {"files"}),
        (
            task(evaluator={"func": "a", "result": {"type": "info_from_website"}}),
            {"web": "what info_from_website reads"},
        ),
        (task(evaluator={"func": "a", "postconfig": [launch("code")]}), {"program": "VS Code"}),
    ],
)
def test_what_a_task_names_is_needed(given: OsworldTask, needs: Any) -> None:
    result = list_needs(given)
    assert result == needs if isinstance(needs, dict) else set(result) == needs


def test_packages_are_those_of_the_check() -> None:
    needs = list_needs(task(), lambda config: [MISSING] if config["id"] == "a1" else [])
    assert needs == {"packages": MISSING}


def test_every_task_that_works_here_needs_nothing_but_files_or_gnomes_settings(
    shared_data: Path,
) -> None:
    all_needs = list_all_needs(load(shared_data / "tasks" / "osworld_verified"))
    working = [item for item in all_needs if item.tested == "works"]
    assert len(working) == 41
    odd = {item.id[:8]: set(item.kinds) for item in working if item.needs}
    assert odd.pop("44ee5668") == {"files", "web"}  # the self-test makes the history itself
    assert set(map(frozenset, odd.values())) == {frozenset({"gnome"})}


def test_the_needs_agree_with_the_groups_that_were_made_by_hand(shared_data: Path) -> None:
    groups = json.loads((shared_data / "tasks" / "feasibility.json").read_text())
    group_of = {task: name for name, pairs in groups.items() for _, task in pairs}
    all_needs = list_all_needs(load(shared_data / "tasks" / "osworld_verified"))
    kinds = {name: Counter() for name in groups}
    for item in all_needs:
        kinds[group_of[item.id]].update(item.kinds or ["nothing"])
    assert kinds["C_vscode"]["program"] == len(groups["C_vscode"])
    assert kinds["G_gdrive_login"]["account"] == len(groups["G_gdrive_login"])
    assert kinds["B_files_only"]["files"] == len(groups["B_files_only"])
    assert kinds["W_live_web"]["web"] >= 36


def test_a_summary_counts_each_task_once(shared_data: Path) -> None:
    tasks = load(shared_data / "tasks" / "osworld_verified")
    rows = summary(list_all_needs(tasks, lambda _: [MISSING]))
    assert sum(count for _, count, _ in rows) == len(tasks) == 369
    assert rows[0] == ("self-test: works", 41, "")
    assert "files + packages" in {kinds for kinds, _, _ in rows}


def test_results_of_another_revision_do_not_count(shared_data: Path) -> None:
    assert json.loads(TESTED.read_text())["revision"].startswith("osworld-verified@")
    all_needs = list_all_needs(load(shared_data / "tasks" / "osworld_fork"))
    assert {item.tested for item in all_needs} == {""}


def test_the_command_says_what_was_not_looked_at(shared_data: Path, tmp_path: Path) -> None:
    folder = str(shared_data / "tasks" / "osworld_verified")
    nowhere = ["--venv", str(tmp_path / "none")]
    result = CliRunner().invoke(hijack, ["osworld", "needs", folder, *nowhere])
    assert result.exit_code == 0, result.output
    assert "packages were not looked at" in result.output
    assert "  41  self-test: works" in result.output
    listed = CliRunner().invoke(hijack, ["osworld", "needs", folder, *nowhere, "--json"])
    rows = json.loads(listed.output)["tasks"]
    assert len(rows) == 369
    assert {row["can_be_met"] for row in rows if row["needs"].keys() == {"files"}} == {True}
