"""`hijack view` reads runs: a list of episodes, one episode, its pictures."""

import json
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from hijack_data.errors import HijackError
from hijack_data.runs.run_log import VERSION
from pipelines.errors import DatasetError
from pipelines.viewer.opening import open_source
from pipelines.viewer.runs import RunSource, listing, listing_index
from pipelines.viewer.runs.action_strokes import parse_strokes

from support.edited_runs import read_lines, write_lines
from support.runlog import lines_of, make_run
from support.viewed_runs import HOSTILE, episode_id
from support.viewing import read

MARKS = episode_id("write_note", "marks", "gpt-9")
MINIMISED = episode_id("write_note", "app_minimization", "gpt-9")


def run_of(folder: Path) -> RunSource:
    source = open_source(folder)
    assert isinstance(source, RunSource)
    return source


def number_of(source: RunSource, name: str) -> int:
    return [entry.id for entry in source.entries].index(name)


def values(about: dict[str, Any], column: str) -> list[str]:
    text = about["texts"][column]
    return [text["values"][code] for code in text["codes"]]


def test_the_list_has_every_episode_with_its_outcome(played: Path) -> None:
    source = run_of(played)
    about = source.about()
    assert (about["facts"], about["problems"], len(about["ids"])) == ("12 episodes", [], 12)
    assert about["texts"]["agent"]["values"] == ["pixel", "gpt-9"]
    assert about["texts"]["corruption"]["values"] == ["clean", "marks", "app_minimization"]
    outcomes = dict(zip(about["ids"], values(about, "outcome"), strict=True))
    assert outcomes[episode_id("write_note", "clean", "pixel")] == "success"
    assert outcomes[MARKS] == "failure"
    assert outcomes[MINIMISED] == "partial"
    assert outcomes[episode_id("rename_file", "clean", "gpt-9")] == "agent error"
    number = number_of(source, MARKS)
    assert about["numbers"]["tokens"][number] == 9270
    assert about["numbers"]["score"][number] == 0.0
    assert (
        about["numbers"]["tokens"][number_of(source, episode_id("write_note", "marks", "pixel"))]
        is None
    )
    assert values(about, "instruction")[number].startswith("Write a short packing list")
    assert about["counts"] == [1] * 12
    json.dumps(about, allow_nan=False)


def test_what_an_agent_was_given_stands_beside_it(harmed: Path) -> None:
    lines = read_lines(harmed / "records.jsonl")
    entries = {"pixel": ["plan"], "gpt-9": []}
    write_lines(harmed / "records.jsonl", [row | {"given": entries[row["agent"]]} for row in lines])
    about = run_of(harmed).about()
    names = set(zip(values(about, "agent"), values(about, "given"), strict=True))
    assert names == {("pixel", "the task's plan in words"), ("gpt-9", "")}


def test_a_step_has_what_was_said_done_and_seen(played: Path) -> None:
    source = run_of(played)
    number = number_of(source, MARKS)
    data = source.episode(number)
    assert data["problems"] == []
    assert len(data["steps"]) == 7
    first, second, third = data["steps"][:3]
    assert (first["said"][:13], first["action"]) == ("The title bar", "click at (101, 50)")
    assert first["strokes"] == [{"type": "click", "at": (101, 50)}]
    assert (first["size"], first["corrupted"], first["no_before"]) == ([320, 200], True, "")
    assert json.loads(first["plan"])["corruption"].startswith("marks")
    assert first["onlooker"] == [["check", "Reminder: a window is gone."]]
    assert (first["usage"]["input_tokens"], first["usage"]["output_tokens"]) == (1200, 40)
    assert second["said"] == HOSTILE
    assert second["strokes"] == [{"type": "drag", "at": (20, 30), "to": (200, 120)}]
    assert second["onlooker"][0][1].startswith("d_1: the pointer moved")
    # the second action of one turn: the words, the onlooker and the tokens are the turn's
    assert (third["said"], third["onlooker"], third["usage"]) == ("", [], {})
    assert third["strokes"] == [{"type": "scroll", "at": (60, 90), "amount": -5.0}]
    assert data["steps"][4]["error"].startswith("line 1")
    assert data["steps"][6]["code"] == ""


def test_a_step_has_what_arrived_of_an_altered_action(harmed: Path) -> None:
    steps = harmed / "episodes" / MARKS / "steps.jsonl"
    slip = {
        "sent": "pyautogui.click(125, 50)",
        "faults": [{"input": "offset", "dx": 24}],
        "probe": {"ok": True, "facts": {}, "problem": ""},
    }
    loss = {
        "sent": "pyautogui.sleep(0)",
        "faults": [{"input": "drop"}],
        "probe": {"ok": False, "facts": {}, "problem": "an event came"},
    }
    first, second, *others = read_lines(steps)
    write_lines(steps, [first | {"input": slip}, second | {"input": loss}, *others])
    seen = harmed / "episodes" / MARKS / "frames" / "0000.seen.png"
    Image.open(seen).resize((160, 100)).save(seen)  # half as large as the screen
    source = run_of(harmed)
    slipped, lost, third = source.episode(number_of(source, MARKS))["steps"][:3]
    assert (slipped["faults"], slipped["arrived"]) == (["offset"], "click at (125, 50)")
    assert slipped["arrived_strokes"] == [{"type": "click", "at": (62, 25)}]
    assert lost["arrived"] == "nothing was pressed; not proved: an event came"
    assert (lost["faults"], lost["arrived_strokes"]) == (["drop"], [])
    assert (third["faults"], third["arrived"]) == ([], "")


def test_effects_come_with_their_probes(played: Path) -> None:
    source = run_of(played)
    data = source.episode(number_of(source, MINIMISED))
    (effect,) = data["effects"]
    assert (effect["kind"], effect["step"]) == ("minimise", 1)
    assert [probe["ok"] for probe in effect["probes"]] == [True, True]
    assert [undone["ok"] for undone in effect["undone"]] == [True]
    assert data["steps"][1]["effects"] == [0]
    assert data["steps"][1]["no_before"] == "the agent saw the clean screen"


def test_pictures_are_the_files_of_the_run(played: Path) -> None:
    source = run_of(played)
    number = number_of(source, MARKS)
    frames = played / "episodes" / MARKS / "frames"
    assert source.picture(number, 2, False) == (frames / "0002.seen.png").read_bytes()
    assert source.picture(number, 2, True) == (frames / "0002.png").read_bytes()
    assert not np.array_equal(
        read(source.picture(number, 2, False)), source.pixels(number, 2, True)
    )
    for step in (7, -1):
        with pytest.raises(HijackError, match="has no step"):
            source.picture(number, step, False)
    for wrong in (12, -1):
        with pytest.raises(HijackError, match="there is no episode"):
            source.episode(wrong)


def test_what_verify_finds_is_told(played: Path, harmed: Path) -> None:
    source = run_of(played)
    assert [source.check(number) for number in range(12)] == [[]] * 12
    frame = harmed / "episodes" / MARKS / "frames" / "0001.seen.png"
    pixels = np.array(Image.open(frame))
    pixels[-1, 3] ^= 1
    Image.fromarray(pixels).save(frame)
    second = run_of(harmed)
    (problem,) = second.check(number_of(second, MARKS))
    assert "is not what the agent saw" in problem
    assert second.check(number_of(second, MINIMISED)) == []


@pytest.mark.parametrize(
    ("code", "words", "strokes"),
    [
        ("pyautogui.click(3, 4)", "click at (3, 4)", [{"type": "click", "at": (3, 4)}]),
        (
            "pyautogui.click(3, 4)\npyautogui.click(9, 9)\npyautogui.hotkey('ctrl', 's')",
            "click at (3, 4), then click at (9, 9), then hotkey ctrl+s",
            [
                {"type": "click", "at": (3, 4)},
                {"type": "click", "at": (9, 9)},
                {"type": "hotkey", "text": "ctrl+s"},
            ],
        ),
        (
            "pyautogui.click(1, 2)\npyautogui.moveTo(5, 6)\npyautogui.dragTo(7, 8)",
            "click at (1, 2), then move at (5, 6), then drag at (5, 6) to (7, 8)",
            [
                {"type": "click", "at": (1, 2)},
                {"type": "move", "at": (5, 6)},
                {"type": "drag", "at": (5, 6), "to": (7, 8)},
            ],
        ),
        ("pyautogui.click(900, -5)", "click at (99, 0)", [{"type": "click", "at": (99, 0)}]),
        (
            "```python\npyautogui.click(10, 20)\n```",
            "click at (10, 20)",
            [{"type": "click", "at": (10, 20)}],
        ),
        ("WAIT", "wait", []),
        ("REQUEST_REINIT", "asks for the desktop to be put in order", []),
        ("import os", "not a pyautogui action", []),
        ("import (((", "not a pyautogui action", []),
        ("x = 3", "other", []),
    ],
)
def test_actions_become_strokes(code: str, words: str, strokes: list[Any]) -> None:
    assert parse_strokes(code, (80, 100)) == (words, strokes)


def test_a_program_of_very_many_actions_is_cut_off() -> None:
    code = "pyautogui.click(1, 1)\n" * 60
    assert len(parse_strokes(code, (80, 100))[1]) == 40
    assert parse_strokes(50 * code, (80, 100)) == ("code that is too long to be drawn", [])


def test_a_small_run_is_shown(tmp_path: Path) -> None:
    source = run_of(make_run(tmp_path / "run"))
    assert (source.facts, source.problems) == ("2 episodes", [])
    corrupted = number_of(source, "write_note__app_minimization__s0__oracle")
    data = source.episode(corrupted)
    assert (data["problems"], [step["action"] for step in data["steps"]]) == (
        [],
        ["click at (100, 50)", "click at (101, 50)", ""],
    )
    assert data["effects"][0]["kind"] == "minimise"
    assert json.loads(data["effects"][0]["did"]) == {"windows": 2}
    assert source.pixels(corrupted, 1, True)[0, 0, 0] == 200
    assert source.pixels(corrupted, 1, False)[0, 0, 0] == 40


def test_a_log_needs_no_bench_around_it(harmed: Path, played: Path) -> None:
    run = run_of(played)
    for name in ("run.json", "records.jsonl"):
        (harmed / name).unlink()
    bare = run_of(harmed)
    assert (len(bare.entries), bare.problems) == (12, [])
    assert [entry.problem for entry in bare.entries] == [""] * 12
    number = number_of(bare, MARKS)
    assert bare.episode(number)["steps"] == run.episode(number_of(run, MARKS))["steps"]


@pytest.mark.parametrize("text", ["", "[]", "{", '{"format": "x"}', "[" * 100_000])
def test_what_is_no_run_is_refused(tmp_path: Path, text: str) -> None:
    (tmp_path / "run.json").write_text(text)
    with pytest.raises(DatasetError, match=r"run\.json"):
        open_source(tmp_path)


def test_a_run_without_an_episode_is_an_empty_page(tmp_path: Path) -> None:
    head = {"format": "agenthijack-run", "version": VERSION, "config": {}, "episodes": ["a", "b"]}
    (tmp_path / "run.json").write_text(json.dumps(head))
    source = run_of(tmp_path)
    assert (source.problems, source.facts) == ([], "0 episodes, 2 of 2 planned not played")


def test_elements_are_outlined_where_a_resized_picture_shows_them(harmed: Path) -> None:
    home = harmed / "episodes" / MARKS
    rows = [json.loads(line) for line in (home / "steps.jsonl").read_text().splitlines()]
    with Image.open(home / rows[0]["seen"]) as picture:
        width, height = picture.size
        half = picture.resize((width // 2, height // 2))
    half.save(home / rows[0]["seen"])
    rows[0]["boxes"] = [[20, 10, 40, 30]]
    lines_of(home / "steps.jsonl", rows)
    step, *_ = run_of(harmed).episode(number_of(run_of(harmed), MARKS))["steps"]
    assert (step["size"], step["boxes"]) == ([width // 2, height // 2], [[10, 5, 20, 15]])


def test_numbers_that_json_has_not_do_no_harm(harmed: Path) -> None:
    home = harmed / "episodes" / MARKS
    rows = [json.loads(line) for line in (home / "steps.jsonl").read_text().splitlines()]
    rows[0] |= {
        "seconds": {"settle": float("nan"), "x": "y"},
        "boxes": [[0, 1, float("inf"), 2], 3],
    }
    rows[1] |= {"raw": "pyautogui.scroll(1e999)", "seconds": [1]}
    lines_of(home / "steps.jsonl", rows)
    source = run_of(harmed)
    data = source.episode(number_of(source, MARKS))
    json.dumps(data, allow_nan=False)
    assert (data["steps"][0]["seconds"], data["steps"][0]["boxes"]) == ({}, [])


def test_an_index_gives_what_the_journal_gives_until_the_journal_changes(
    played: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    run = tmp_path / "run"
    shutil.copytree(played, run)
    cache = tmp_path / "cache"
    monkeypatch.setenv("XDG_CACHE_HOME", str(cache))
    read_once = run_of(run).about()
    assert not list(cache.rglob("*.json"))  # a small journal is read faster without
    monkeypatch.setattr(listing_index, "MIN_JOURNAL_BYTES", 0)
    assert run_of(run).about() == read_once
    (index,) = cache.rglob("*.json")
    with monkeypatch.context() as patch:
        patch.setattr(listing, "_read_journal", None)  # whoever reads it now fails
        assert run_of(run).about() == read_once
    lines = read_lines(run / "records.jsonl")
    lines[0]["score"] = 0.25
    write_lines(run / "records.jsonl", lines)
    assert run_of(run).about()["numbers"]["score"][0] == 0.25
    (newer,) = set(cache.rglob("*.json")) - {index}
    for damage in (b"", b"{}", b"[]", newer.read_bytes()[:-9]):
        newer.write_bytes(damage)
        assert run_of(run).about()["numbers"]["score"][0] == 0.25
