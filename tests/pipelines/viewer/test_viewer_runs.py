"""`hijack view` shows a run: its episodes are trajectories."""

import json
import shutil
from pathlib import Path

import pytest

from hijack_data.errors import HijackError
from pipelines.errors import DatasetError
from pipelines.viewer import answers, open_source

from support.runlog import lines_of, make_run


@pytest.fixture
def run(tmp_path: Path) -> Path:
    return make_run(tmp_path / "run")


def test_episodes_are_trajectories(run: Path) -> None:
    source = open_source(run)
    assert source.problems == []
    page = answers.rows(source, {})
    assert page["found"] == 6
    assert page["filters"]["score"]["values"] == [["0", 3], ["1", 3]]
    assert (
        answers.rows(
            source,
            {
                "score": "0",
                "agent": "oracle",
                "task": "write_note",
            },
        )["found"]
        == 3
    )
    row = answers.row(source, {"row": "1"})
    assert (row["step_back"], row["step_next"]) == (0, 2)
    assert row["same_step"] == [[1, "app_minimization"], [4, "clean"]]
    detail = row["detail"]
    assert (detail["action"], detail["points"], detail["size"]) == (
        "click at (101, 50)",
        [(101, 50)],
        (320, 200),
    )
    assert ("Event", 'minimise: {"windows": 2}') in detail["notes"]
    assert ("Episode", "ok, score 0: there is no note") in detail["notes"]
    assert json.loads(detail["plan"]) == {"corruption": "app_minimization"}
    assert dict(detail["fields"]["Episode"])["status"] == "ok"
    assert (source.picture(1, True)[0, 0, 0], source.picture(1, False)[0, 0, 0]) == (200, 40)


def test_where_the_agent_saw_the_clean_screen_there_is_no_picture_before(run: Path) -> None:
    detail = answers.row(open_source(run), {"row": "0"})["detail"]
    assert detail["no_before"] == "the agent saw the clean picture"
    last = answers.row(open_source(run), {"row": "5"})["detail"]
    assert (last["action"], last["code"]) == ("the last observation", "")


def test_broken_parts_of_a_run_are_named(run: Path) -> None:
    homes = {home.name.split("__")[1]: home for home in (run / "episodes").iterdir()}
    steps = homes["app_minimization"] / "steps.jsonl"
    lines = steps.read_text().splitlines()
    steps.write_text(
        "\n".join(
            [lines[0], "{rubbish", lines[2].replace("frames/0002.seen.png", "../../../run.json")]
        )
    )
    for name, record in (("bytes", b"\xff\xfe"), ("list", b"[1]"), ("nosteps", b"{}")):
        (run / "episodes" / name).mkdir()
        (run / "episodes" / name / "episode.json").write_bytes(record)
    (run / "episodes" / "unfinished").mkdir()
    source = open_source(run)
    named = [problem.partition(":")[0] for problem in source.problems]
    assert named[1:] == ["episodes/bytes", "episodes/list", "episodes/nosteps"]
    assert named[0] == "1 episode(s) without a record (not finished), such as unfinished"
    assert len(source.index) == 6
    for number, words in ((1, "not JSON"), (2, "leaves the source folder")):
        assert words in answers.row(source, {"row": str(number)})["detail"]["problem"]
        with pytest.raises(HijackError, match=words):
            source.picture(number, False)


def test_what_an_agent_wrote_need_not_be_an_action(run: Path) -> None:
    file = next((run / "episodes").glob("*clean*")) / "steps.jsonl"
    lines_of(
        file,
        [
            {
                "step": 0,
                "image": "frames/0000.png",
                "raw": "import (((",
            },
            {
                "step": 1,
                "image": 5,
                "events": 3,
            },
        ],
    )
    source = open_source(run)
    first = next(n for n in range(len(source.index)) if "clean" in source.index.ids[n])
    detail = answers.row(source, {"row": str(first)})["detail"]
    assert (detail["action"], detail["code"], detail["points"]) == (
        "not a pyautogui action",
        "import (((",
        [],
    )
    assert answers.row(source, {"row": str(first + 1)})["detail"]["problem"]


@pytest.mark.parametrize(
    "text",
    [
        "",
        "[]",
        "{",
        '{"format": "x"}',
        '{"format": "agenthijack-run", "version": 3}',
        "[" * 100_000,
    ],
)
def test_a_log_that_is_none_is_refused(run: Path, text: str) -> None:
    (run / "run.json").write_text(text)
    with pytest.raises(DatasetError, match=r"run\.json"):
        open_source(run)


def test_a_run_without_an_episode_is_an_empty_page(run: Path) -> None:
    shutil.rmtree(run / "episodes")
    source = open_source(run)
    assert (source.problems, answers.rows(source, {})["found"]) == ([], 0)


def test_a_log_needs_no_bench_around_it(run: Path) -> None:
    whole = answers.rows(open_source(run), {})
    for name in ("run.json", "records.jsonl"):
        (run / name).unlink()
    assert answers.rows(open_source(run), {}) == whole


def test_what_an_agent_said_and_where_it_raised_are_shown(run: Path) -> None:
    home = next((run / "episodes").glob("*clean*"))
    rows = [json.loads(line) for line in (home / "steps.jsonl").read_text().splitlines()]
    lines_of(home / "steps.jsonl", [rows[0] | {"said": "I click\nthere"}, *rows[1:]])
    record = json.loads((home / "episode.json").read_text())
    frames = ["agent.py:3 in predict: self.see()", "agent.py:9 in see: 1 / 0"]
    (home / "episode.json").write_text(json.dumps(record | {"traceback": frames}))
    source = open_source(run)
    first = next(n for n in range(len(source.index)) if "clean" in source.index.ids[n])
    notes = dict(answers.row(source, {"row": str(first)})["detail"]["notes"])
    assert (notes["Said"], notes["Traceback"]) == ("I click\nthere", "\n".join(frames))
    assert "Said" not in dict(answers.row(source, {"row": str(first + 1)})["detail"]["notes"])
