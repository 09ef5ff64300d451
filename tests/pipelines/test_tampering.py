"""Whoever edits a run is found by `hijack verify`: one edit a test, on one small recorded run."""

import json
import shutil
import subprocess
from pathlib import Path

import pytest
from click.testing import CliRunner

pytest.importorskip("gymnasium", reason="needs the extra [online]")
pytest.importorskip("isal", reason="needs the extra [hf]")

from hijack_data.cli import hijack
from hijack_data.errors import HijackError
from hijack_data.runs import seal
from hijack_data.runs.run_log import sha256_hex
from online_env.results import origin
from pipelines.proof.rebuild import rebuild

from support.edited_runs import (
    CLEAN,
    HALF,
    MARKS,
    MINIMISED,
    all_clean,
    both,
    both_pictures_and_hash,
    chained_anew,
    episode,
    file,
    flip_everywhere,
    flip_in_record,
    head,
    home,
    journal,
    picture,
    record,
    relabelled,
    removed,
    replaced_by_clean,
    step,
    steps,
    swapped,
    without_effects,
)
from support.recorded import ANSWERS, record_run

LINES = 1 + sum(len(actions) for _, actions in ANSWERS)


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    return record_run(tmp_path_factory.mktemp("recorded") / "run")


@pytest.fixture
def run(recorded, tmp_path):
    return Path(shutil.copytree(recorded, tmp_path / "run"))


SCREEN_CODE = "pyautogui.click(11, 20)"
TAMPERINGS = {
    # pictures
    "a pixel of a clean frame": picture(MARKS, "0001.png"),
    "a pixel of what was seen": picture(MARKS, "0001.seen.png"),
    "a pixel of both": picture(MARKS, "0001.png", "0001.seen.png"),
    "a pixel under a resize": picture(HALF, "0002.png"),
    "a pixel of a clean episode": picture(CLEAN, "0002.png"),
    "a frame is missing": file(f"episodes/{MARKS}/frames/0001.png", None),
    "a frame is cut off": file(f"episodes/{MARKS}/frames/0001.png", lambda data: data[:900]),
    "both frames and their hashes": both_pictures_and_hash,
    # plans
    "an operation of a plan": steps(lambda rows: rows[1]["plan"]["ops"].pop() and None),
    "the digest of a plan": step(1, plan_digest="0" * 64),
    "one plan is replaced by clean": replaced_by_clean,
    "all plans are replaced by clean": all_clean,
    "the seed": episode(seed=8),
    "the seed in both": both(seed=8),
    "the boxes, where no plan needs them": step(2, HALF, boxes=[[1, 1, 5, 5]]),
    "the apps": step(1, apps=[]),
    # scores
    "the score in the journal": record(score=1.0),
    "the score in the episode": episode(score=1.0),
    "the score in both": both(score=1.0),
    "the score of the last episode in both": both(HALF, score=0.0),
    "a score of 2": both(score=2.0),
    "a score that is none": both(score=float("nan")),
    "the status": both(status="invalid", score=None),
    "the reason": both(reason="as not wanted"),
    # the journal
    "a record is removed": journal(lambda rows: rows[:1] + rows[2:]),
    "the last record is removed": journal(lambda rows: rows[:-1]),
    "a record is doubled": journal(lambda rows: [*rows, rows[1]]),
    "a record is doubled with another score": journal(
        lambda rows: [*rows, rows[1] | {"score": 1.0}]
    ),
    "a record is invented": journal(
        lambda rows: [*rows, rows[0] | {"seed": 9, "id": rows[0]["id"].replace("7", "9")}]
    ),
    "records are swapped": journal(swapped(0, 1)),
    "a record and its episode are removed": lambda run: (
        journal(lambda rows: rows[:-1])(run),
        removed(HALF)(run),
    ),
    "an episode is removed": removed(MARKS),
    "an episode is copied in": lambda run: shutil.copytree(
        home(run), home(run, MARKS.replace("teller", "other"))
    ),
    "the journal is removed": file("records.jsonl", None),
    "the journal is emptied": file("records.jsonl", lambda data: b""),
    "a line of the journal is garbage": file("records.jsonl", lambda data: b"{x\n" + data),
    # what was done
    "probes in the journal": journal(flip_in_record),
    "probes everywhere": flip_everywhere,
    "effects of the record": both(MINIMISED, effects=[]),
    "events": steps(lambda rows: [row | {"events": []} for row in rows], MINIMISED),
    "effects and events": without_effects,
    # steps
    "a step is removed": steps(lambda rows: rows[:2] + rows[3:]),
    "the last step is removed": steps(lambda rows: rows[:-1]),
    "a step is doubled": steps(lambda rows: [*rows[:2], rows[1], *rows[2:]]),
    "steps are swapped": steps(swapped(1, 2)),
    "a step is added": steps(lambda rows: [*rows, rows[-1] | {"step": LINES}]),
    "a line is garbage": file(f"episodes/{MARKS}/steps.jsonl", lambda data: data + b"{x\n"),
    "a line is cut off": file(f"episodes/{MARKS}/steps.jsonl", lambda data: data[:-40]),
    "the steps of another episode": lambda run: shutil.copy(
        home(run, CLEAN) / "steps.jsonl", home(run) / "steps.jsonl"
    ),
    # actions
    "the raw answer": step(0, raw="pyautogui.click(11, 20)"),
    "what ran": step(0, code=SCREEN_CODE),
    "what ran, where it is mapped": step(0, HALF, code="pyautogui.click(10, 20)"),
    "a refused action was run": step(1, code="import os", error=None),
    "an action was refused": step(0, code=None, error="no"),
    "what the agent said": step(0, said="nothing"),
    "its last words": both(said="nothing"),
    "the last action": both(last_action="FAIL"),
    "the number of steps": both(steps=3),
    "how many were malformed": both(malformed=0),
    "the requests": both(
        recovery={"policy": "none", "requests": 0, "false_alarms": 0, "repaired": 0}
    ),
    # what it was
    "the params of the journal": record(params={}),
    "the params in both": both(params={}),
    "the label in the journal": record(corruption="clean"),
    "the label in both": both(corruption="clean"),
    "the label, wherever it stands": relabelled,
    "the agent in both": both(agent="oracle"),
    "the instruction in the journal": record(instruction="Open nothing"),
    "the instruction in both": both(instruction="Open nothing"),
    "the instruction of the last episode in both": both(HALF, instruction="Open nothing"),
    "the version": both(version=0),
    "what the agent was given in the journal": record(given=["plan"]),
    "what the agent was given in both": both(given=["plan"]),
    "run.json: a parameter": head(
        lambda data: data["config"]["corruptions"][1]["marks"].update(number=4)
    ),
    "run.json: a corruption is not planned": head(
        lambda data: (data["config"]["corruptions"].pop(), data["episodes"].pop())
    ),
    "run.json: what it was made with": head(lambda data: data["versions"].update(numpy="1.0")),
    "run.json: its version": head(lambda data: data.update(version=0)),
    "run.json is removed": file("run.json", None),
}


def test_the_run_as_it_was_recorded_is_whole(recorded):
    report = rebuild(recorded)
    assert (report.problems, report.episodes, report.steps) == ([], 4, 4 * LINES)


@pytest.mark.parametrize("name", TAMPERINGS)
def test_an_edit_is_found(name, run):
    TAMPERINGS[name](run)
    report = rebuild(run)
    assert report.problems, f"{name}: not found"
    assert report.exit_code == 1


def seal_is_a_folder(run):
    (run / "seal.json").mkdir()


@pytest.mark.parametrize(
    ("tamper", "problem"),
    [
        (record(attempt="x"), "records.jsonl: line 2: attempt: must be a whole number, got 'x'"),
        (record(attempt=None), "records.jsonl: line 2: attempt: must be a whole number, got None"),
        (record(id="a" * 5000), "records.jsonl: line 2: id: must be the name of a folder, got"),
        (record(id="../x"), "records.jsonl: line 2: id: must be the name of a folder, got '../x'"),
        (record(id=[]), "records.jsonl: line 2: id: must be a string, got []"),
        (
            head(lambda data: data["config"].update(retries="x")),
            "run.json: config.retries: must be a whole number, got 'x'",
        ),
        (
            head(lambda data: data["config"].update(agents=3)),
            "run.json: config.agents: must be a list, got 3",
        ),
        (
            head(lambda data: data["config"].update(seeds=None)),
            "run.json: config.seeds: must be a list, got None",
        ),
        (head(lambda data: data.update(config=[])), "run.json: config: must be an object, got []"),
        (
            head(lambda data: data.update(episodes=[{}])),
            "run.json: episodes: must be a list of ids, got [{}]",
        ),
        (step(1, said={}), "said must be a string, got {}"),
        (seal_is_a_folder, "seal.json: cannot be read ("),
    ],
)
def test_a_field_of_the_wrong_kind_is_named(tamper, problem, run):
    tamper(run)
    report = rebuild(run)
    assert any(problem in item for item in report.problems), report.problems


def test_a_second_attempt_that_was_removed_is_missed(run):
    """What is invalid is run again: where that is not there, it was taken out."""
    both(HALF, status="invalid", score=None, problem="x")(run)
    chained_anew(run)
    assert f"run.json: {HALF} was not run again, and retries is 1" in rebuild(run).problems


@pytest.mark.parametrize(
    ("changes", "problem"),
    [
        (
            {"given": ["hints"]},
            "given must be null or a list of task, plan, process, tree, devtools, got ['hints']",
        ),
        (
            {"given": ["plan", "plan"]},
            "given must be null or a list of task, plan, process, tree, devtools, got ['plan', ",
        ),
        ({"given": []}, "records.jsonl: teller was not always given the same (given): nothing; "),
    ],
)
def test_what_an_agent_was_given_is_of_a_kind_and_always_the_same(run, changes, problem):
    for name in (CLEAN, MINIMISED, HALF):
        both(name, given=["plan"])(run)
    both(MARKS, **changes)(run)
    chained_anew(run)
    assert any(problem in item for item in rebuild(run).problems)


def test_a_record_without_what_was_given_is_incomplete(run):
    def dropped(row):
        return {key: value for key, value in row.items() if key != "given"}

    path = home(run) / "episode.json"
    path.write_text(json.dumps(dropped(json.loads(path.read_text()))))
    journal(lambda rows: [dropped(row) if row["id"] == MARKS else row for row in rows])(run)
    chained_anew(run)
    missing = "given is missing: every record says what its agent was given, or null"
    assert rebuild(run).problems == [f"episodes/{MARKS}/episode.json: {missing}"]


def test_another_version_is_refused_by_name(run):
    both(MARKS, version=0)(run)
    chained_anew(run)
    assert any("version: is 0; this library reads" in problem for problem in rebuild(run).problems)
    head(lambda data: data.update(version=0))(run)
    assert any(problem.startswith("run.json: version 0 ") for problem in rebuild(run).problems)


def test_with_the_hashes_of_one_file_written_anew_the_next_one_tells(run):
    """The record in both places, and the hash of `episode.json` beside it."""
    both(score=1.0)(run)
    content = (home(run) / "episode.json").read_bytes()
    record(MARKS, episode_sha256=sha256_hex(content))(run)
    assert rebuild(run).problems == ["records.jsonl: line 3: does not follow on line 2 (previous)"]


# Signatures


@pytest.fixture(scope="module")
def keys(tmp_path_factory):
    """Paths of two keys; the public ones end in `.pub`."""
    if shutil.which("ssh-keygen") is None:
        pytest.skip("signatures need ssh-keygen: apt install openssh-client")
    folder = tmp_path_factory.mktemp("keys")
    for name in ("mine", "other"):
        command = ["ssh-keygen", "-q", "-t", "ed25519", "-N", "", "-f", str(folder / name)]
        subprocess.run(command, check=True)
    return folder / "mine", folder / "other"


def command(*words):
    return CliRunner().invoke(hijack, [str(word) for word in words], catch_exceptions=False)


def test_signing_says_that_the_seal_cannot_be_replaced(run, keys):
    seal_is_a_folder(run)
    with pytest.raises(HijackError, match=r"seal.json: cannot be written \(Is a directory\)"):
        command("sign", run, "--key", keys[0])


def test_who_writes_all_hashes_anew_is_found_by_the_signature_alone(run, keys):
    first_key, second = keys
    result = command("sign", run, "--key", first_key)
    assert (result.exit_code, "signed by SHA256:" in result.output) == (0, True), result.output
    assert command("verify", run, "--key", f"{first_key}.pub").exit_code == 0
    assert rebuild(run).signer.startswith("SHA256:")
    assert command("verify", run, "--key", f"{second}.pub").exit_code == 1
    both(score=1.0)(run)
    chained_anew(run)
    (run / "seal.json").rename(run.parent / "kept")
    (run / "seal.json.sig").rename(run.parent / "kept.sig")
    assert rebuild(run).problems == [], "without a secret nobody can tell"
    assert rebuild(run, f"{first_key}.pub").problems == [
        "seal.json: is missing: the run is not signed"
    ]
    (run.parent / "kept").rename(run / "seal.json")
    (run.parent / "kept.sig").rename(run / "seal.json.sig")
    assert rebuild(run).problems == ["seal.json: the run is not what was sealed"]
    seal.sign(run, str(second))
    assert rebuild(run).problems == [], "signed, by whoever"
    assert "is not a signature" in rebuild(run, f"{first_key}.pub").problems[0]


def test_an_edited_seal_is_no_longer_signed(run, keys):
    first_key, _ = keys
    seal.sign(run, str(first_key))
    both(score=1.0)(run)
    chained_anew(run)
    (run / "seal.json").write_text(json.dumps(seal.contents(run)))
    assert rebuild(run).problems == ["seal.json.sig: is not a signature of seal.json"]
    assert "is not a signature" in rebuild(run, f"{first_key}.pub").problems[0]
    (run / "seal.json.sig").unlink()
    assert rebuild(run).problems == ["seal.json.sig: is missing"]


def test_the_sessions_of_a_resumed_run_are_sealed(run, keys):
    """With another commit, or without the file, a signed run was one that had not been resumed."""
    origin.add_session(run, origin.describe({}), 1)
    seal.sign(run, str(keys[0]))
    assert list(seal.problems(run, None)) == []
    path = run / "sessions.jsonl"
    content = path.read_bytes()
    for edited in (content.replace(b'"dirty"', b'"Dirty"'), b""):
        path.write_bytes(edited)
        assert list(seal.problems(run, None)) == ["seal.json: the run is not what was sealed"]
    path.unlink()
    assert list(seal.problems(run, None)) == ["seal.json: the run is not what was sealed"]


def test_what_is_not_whole_is_not_signed(run, keys, tmp_path):
    first_key, _ = keys
    both(score=1.0)(run)
    result = command("sign", run, "--key", first_key)
    assert (result.exit_code, (run / "seal.json").exists()) == (1, False)
    for key in (tmp_path / "none", f"{first_key}.pub.none"):
        with pytest.raises(seal.SealError, match="ssh-keygen -t ed25519"):
            seal.check_key(str(key))
    seal.sign(run, str(first_key))
    with pytest.raises(seal.SealError, match=r"ends in \.pub"):
        rebuild(run, str(first_key))


@pytest.mark.parametrize("name", ["records.jsonl", f"episodes/{MARKS}/steps.jsonl"])
def test_a_device_in_the_place_of_a_file_is_not_read(name, run):
    (run / name).unlink()
    (run / name).symlink_to("/dev/null")
    assert any("is not a regular file" in problem for problem in rebuild(run).problems)
