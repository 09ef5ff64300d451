"""`rebuild`: what an agent saw is made again from the log, and whatever differs is found."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from PIL import Image

pytest.importorskip("gymnasium", reason="needs the extra [online]")
pytest.importorskip("isal", reason="needs the extra [hf]")

import hijack_data as hj
from hijack_data.cli import hijack
from online_env.environment import CorruptedEnv
from pipelines.errors import SourceError
from pipelines.proof.rebuild import is_run, rebuild
from pipelines.readers.survey import survey
from pipelines.viewer.opening import open_source

from support.live import AT_ONCE, FakeDesktop, FakeStage

PUBLISHED = Path(__file__).resolve().parents[2] / "docs" / "results" / "ablation_modules" / "run"
CASES = {
    "clean": None,
    "pop_ups": hj.PopUps(width=420, height=260),
    "resolution": hj.Resolution(scale=0.5),
    "marks": hj.Marks(number=3, mark_size=8, avoid_elements=True),
    "subtitle": hj.Subtitle(subtitle_text="hello", font_size=12),
    "sequence": hj.Sequence(
        [hj.Marks(number=2), hj.Resolution(scale=0.75), hj.NetworkError(step=99)]
    ),
    "drawn": hj.OneOf(
        [hj.Marks(number=2), hj.Subtitle(subtitle_text="ho", font_size=20)], p_clean=0.3
    ),
    "twice": hj.Sequence([hj.Marks(number=2), hj.Marks(number=5)]),
}


def play_episodes(folder: Path, *labels: str) -> list[Path]:
    """Episodes under `folder`; returns their folders."""
    env = CorruptedEnv(FakeStage(FakeDesktop((720, 1280))), settle=AT_ONCE, log=folder)
    items = []
    for label in labels:
        env.reset(seed=2**63 + 5, options={"corruption": CASES[label], "label": label})
        for action in ("pyautogui.click(10, 20)", "nonsense", "DONE"):
            env.step(action)
        items.append(folder / "episodes" / env.record["id"])
    return items


def edit(folder: Path, step: int, /, **changes) -> None:
    """Change a line of a log."""
    path = folder / "steps.jsonl"
    rows = [json.loads(line) for line in path.read_text().splitlines()]
    rows[step] |= changes
    path.write_text("".join(json.dumps(row) + "\n" for row in rows))


def test_everything_is_made_again_byte_for_byte(tmp_path):
    play_episodes(tmp_path, *CASES)
    report = rebuild(tmp_path)
    assert report.problems == []
    assert (report.episodes, report.steps, report.exit_code) == (len(CASES), 4 * len(CASES), 0)
    assert 4 * 6 <= report.disturbed <= 4 * 7
    assert "all identical" in report.lines()[0]


def test_one_episode_can_be_checked_alone(tmp_path):
    (folder,) = play_episodes(tmp_path, "marks")
    assert (rebuild(folder).episodes, rebuild(folder).steps) == (1, 4)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"boxes": [[0, 0, 1280, 700]]}, "planned again the plan is another"),
        ({"step": 7}, "planned again the plan is another"),
        ({"plan_digest": "0" * 64}, "plan_digest is not that of the plan"),
        ({"seen_sha256": "0" * 64}, "is not what the agent saw"),
        ({"plan": {"format": "agenthijack-plan"}}, "line 2"),
        ({"plan": None}, "line 2"),
        ({"image": "../../../x.png"}, "leaves the source folder"),
        ({"image": "frames/none.png"}, "is not in the source folder"),
        ({"boxes": "x"}, "boxes"),
        ({"apps": 5, "boxes": [[1, 2]]}, "shape"),
    ],
)
def test_whatever_differs_is_named_with_file_and_step(tmp_path, change, words):
    folder, _ = play_episodes(tmp_path, "marks", "pop_ups")
    edit(folder, 1, **change)
    report = rebuild(tmp_path)
    assert report.exit_code == 1
    assert words in "\n".join(report.problems)
    assert all(
        problem.startswith(f"episodes/{folder.name}/steps.jsonl: ") for problem in report.problems
    )


def test_a_changed_picture_is_found(tmp_path):
    folder, second = play_episodes(tmp_path, "marks", "clean")
    for path, name in ((folder, "0000.png"), (folder, "0001.seen.png"), (second, "0002.png")):
        picture = np.array(Image.open(path / "frames" / name))
        picture[700, 3] ^= 1
        Image.fromarray(picture).save(path / "frames" / name)
    result = "\n".join(rebuild(tmp_path).problems)
    assert "step 0: frames/0000.png: disturbed again it is not" in result
    assert "step 1: frames/0001.seen.png: is not" in result
    assert "step 2: frames/0002.png" in result
    assert len(result.splitlines()) == 3
    (folder / "frames" / "0002.png").write_bytes(b"no picture")
    assert "line 3" in "\n".join(rebuild(tmp_path).problems)


def test_a_changed_record_is_found(tmp_path):
    (folder,) = play_episodes(tmp_path, "marks")
    record = json.loads((folder / "episode.json").read_text())
    for change, words in (
        ({"seed": 1}, "planned again"),
        ({"sample": "x"}, "planned again"),
        ({"seed": "x"}, "seed"),
    ):
        (folder / "episode.json").write_text(json.dumps({**record, **change}))
        assert words in "\n".join(rebuild(tmp_path).problems)


def test_unfinished_episodes_are_counted_and_left_alone(tmp_path):
    folder, _ = play_episodes(tmp_path, "marks", "clean")
    (folder / "episode.json").unlink()
    report = rebuild(tmp_path)
    assert (report.ok, report.episodes, report.unfinished) == (True, 1, 1)


def test_what_is_no_run_is_refused(tmp_path):
    assert not is_run(tmp_path)
    with pytest.raises(SourceError, match="neither a run"):
        rebuild(tmp_path)


def test_a_run_published_without_steps_is_verified_as_far_as_its_records_go(tmp_path):
    shutil.copytree(PUBLISHED, tmp_path / "run")
    result = CliRunner().invoke(hijack, ["verify", str(tmp_path)])  # finds the run inside
    assert result.exit_code == 0, result.output
    assert "no steps were published" in result.output
    source = open_source(tmp_path)
    assert "damaged" not in source.facts
    data = source.episode(0)
    assert (data["problems"], "without its steps" in data["no_steps"]) == ([], True)
    records = tmp_path / "run" / "records.jsonl"
    lines = records.read_text().splitlines(keepends=True)
    records.write_text("".join([lines[0].replace('"seconds": ', '"seconds": 1'), *lines[1:]]))
    verification = CliRunner().invoke(hijack, ["verify", str(tmp_path)])
    assert (verification.exit_code, "does not follow on line 1" in verification.output) == (1, True)
    with pytest.raises(SourceError, match="is a run without the folder episodes"):
        survey(tmp_path / "run")


def test_hijack_verify_checks_runs_too(tmp_path):
    folder, _ = play_episodes(tmp_path, "marks", "clean")
    run = CliRunner().invoke(hijack, ["verify", str(tmp_path)])
    assert (run.exit_code, "2 episodes, 8 observations, 4 of them disturbed" in run.output) == (
        0,
        True,
    )
    edit(folder, 0, seen_sha256="0" * 64)
    run = CliRunner().invoke(hijack, ["verify", str(tmp_path), "--json"])
    assert run.exit_code == 1
    assert json.loads(run.output)["ok"] is False
