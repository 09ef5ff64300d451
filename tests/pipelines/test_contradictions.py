"""Whoever edits a run and writes all hashes anew is found where the run contradicts itself, or what
the library knows; the rest, which only a signature protects, is listed here, too."""

import json
import shutil
from pathlib import Path

import pytest

pytest.importorskip("gymnasium", reason="needs the extra [online]")
pytest.importorskip("isal", reason="needs the extra [hf]")

from hijack_data.corruption import make_corruption
from hijack_data.runs.run_log import episode_slug
from online_env import tasks
from online_env.bench import runner
from online_env.bench.episodes import play
from online_env.bench.jobs import Job
from online_env.environment import CorruptedEnv, Setting
from online_env.results import origin, records
from pipelines.proof.rebuild import rebuild

from support.edited_runs import (
    both,
    configured,
    hashed_anew,
    head,
    home,
    journal,
    read_lines,
    renamed,
    steps,
    write_lines,
)
from support.live import FakeDesktop, FakeStage
from support.recorded import Silent, Teller, config, no_machine

TASK, SEED = "write_note", 3
PLANNERS = {
    "clean": None,
    "marks": make_corruption("marks"),
    "app_minimization": make_corruption("app_minimization"),
}
JOBS = [Job("do_nothing", TASK, label, SEED) for label in PLANNERS]
CLEAN, MARKS, MINIMISED = (job.id for job in JOBS)


class EmbeddedDesktop(FakeDesktop):
    """What the record calls the desktop of this library."""


class LibraryStage(FakeStage):
    """A stage whose tasks are those of the library; it judges that nothing is right."""

    def reset(self, task, seed):
        super().reset(task, seed)
        result = tasks.get(task, seed)
        return Setting(
            result.id, result.instruction, tuple(result.apps), bool(result.infeasible), seed
        )


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    """A run as `hijack bench` leaves it, with a line of `sessions.jsonl`."""
    folder = tmp_path_factory.mktemp("recorded") / "run"
    corruptions = ["clean", {"marks": {}}, {"app_minimization": {}}]
    settings = config(
        agents=["do_nothing"],
        tasks=[TASK],
        seeds=[SEED],
        corruptions=corruptions,
        desktop={"provider": "embedded", "size": [640, 360]},
    )
    ids = [job.id for job in JOBS]
    records.create(folder, settings, ids, origin.describe(settings, desktops=1)).release()

    def episode(job, attempt):
        stage = LibraryStage(EmbeddedDesktop(), score=0.0)
        env = CorruptedEnv(stage, max_steps=9, log=folder, agent=job.agent)
        return play(env, Teller(), job, attempt, PLANNERS[job.corruption])

    with no_machine(), records.resume(folder, settings, ids, origin.describe(settings, desktops=1)):
        runner.run_jobs(JOBS, folder, 1, episode, Silent())
    return folder


@pytest.fixture
def run(recorded, tmp_path):
    return Path(shutil.copytree(recorded, tmp_path / "run"))


def change_all(**changes):
    """Change all records, in both places."""
    return lambda run: [both(name, **changes)(run) for name in (CLEAN, MARKS, MINIMISED)]


def together(*edits):
    return lambda run: [edit(run) for edit in edits]


def added(name, content=b"x"):
    """Add a file, or a folder if the name ends with a slash."""

    def tamper(run):
        path = run / name
        (path if name.endswith("/") else path.parent).mkdir(parents=True, exist_ok=True)
        if not name.endswith("/"):
            path.write_bytes(content)

    return tamper


def desktop(**changes):
    """Change the field `desktop` of all records."""

    def tamper(run):
        for name in (CLEAN, MARKS, MINIMISED):
            value = json.loads((home(run, name) / "episode.json").read_text())["desktop"]
            both(name, desktop=value | changes)(run)

    return tamper


def session(**changes):
    """Change the line of `sessions.jsonl`."""

    def tamper(run):
        path = run / "sessions.jsonl"
        write_lines(path, [row | changes for row in read_lines(path)])

    return tamper


def lines(name=CLEAN, /, **changes):
    """Change the first line of an episode's steps."""
    return steps(lambda rows: rows[0].update(changes), name)


def effect(**changes):
    """Change what the record of an episode says of its effect."""

    def tamper(run):
        entries = json.loads((home(run, MINIMISED) / "episode.json").read_text())["effects"]
        entries[0]["record"].update(changes)
        both(MINIMISED, effects=entries)(run)

    return tamper


def cheaper(run):
    """Say that every agent may take six steps less, in configuration and records."""
    configured(lambda data: data.update(max_steps=3))(run)
    change_all(max_steps=3)(run)


def given_other_name(name):
    """Let the episodes be those of another agent."""

    def tamper(run):
        for label, old in zip(PLANNERS, (CLEAN, MARKS, MINIMISED), strict=True):
            new = episode_slug(f"{TASK}-{SEED}", label, SEED, name, 0)
            renamed(old, new, agent=name)(run)
        configured(lambda data: data.update(agents=[name]))(run)

    return tamper


def one_is_dropped(run):
    """Remove an episode, and its condition from the head, but not from the configuration."""
    shutil.rmtree(home(run, MARKS))
    journal(lambda rows: [row for row in rows if row["id"] != MARKS])(run)
    head(lambda data: data["episodes"].remove(MARKS))(run)


def condition_is_dropped(run):
    one_is_dropped(run)
    configured(lambda data: data["corruptions"].pop(1))(run)


ERROR = {"status": "error", "score": None, "reason": "", "problem": "x", "ended": None}
FOUND = {
    # the findings of a review, in its order
    "a failure becomes an end from outside": both(CLEAN, **ERROR, cause="outside"),
    "the hash of the configuration": head(lambda data: data.update(config_sha256="0" * 64)),
    "the configuration without its hash": head(lambda data: data["config"].update(retries=3)),
    "the size of the desktop": configured(
        lambda data: data.update(desktop={"provider": "embedded", "size": [800, 600]})
    ),
    "the provider in the records": desktop(provider="OsworldDesktop"),
    "the seed of the task": change_all(task_seed=9),
    "any code was allowed": change_all(allow_code=True),
    "the instruction": change_all(instruction="Do nothing"),
    "the task is infeasible": change_all(infeasible=True),
    "the time of an episode": both(CLEAN, seconds=0.1),
    "the agent is renamed to one that is given the task": given_other_name("oracle"),
    "fewer steps were allowed": cheaper,
    "a picture that no line names": added(f"episodes/{CLEAN}/frames/9999.png"),
    "a folder of an episode that was not planned": added("episodes/evil/"),
    "a report beside the run": added("report.json", b"{}"),
    # others of the same classes
    "a failure becomes the machine's": both(CLEAN, **ERROR, cause="machine"),
    "a failure becomes that of the agent's code": both(CLEAN, **ERROR, cause="agent"),
    "a failure becomes invalid": both(CLEAN, **ERROR | {"status": "invalid"}, cause=None),
    "a status that is none": both(CLEAN, status="skipped"),
    "an end that is none of a run": both(CLEAN, ended="outside"),
    "a problem, and the status ok": both(CLEAN, problem="x"),
    "a cause, and the status ok": both(CLEAN, cause="machine"),
    "the applications": change_all(apps=["thunar"]),
    "the task of one record": both(CLEAN, task="copy_file-3", sample="copy_file-3"),
    "what the agent was given": change_all(given=["task"]),
    "the settings of the screenshots": desktop(settle={"quiet": 0, "cap": 0, "look": 0.05}),
    "the size of the desktop in the records": desktop(size=[800, 600]),
    "the policy in a record": both(
        CLEAN, recovery={"policy": "repair", "requests": 1, "false_alarms": 1, "repaired": 0}
    ),
    "repairs that no step has": change_all(
        recovery={"policy": "none", "requests": 1, "false_alarms": 0, "repaired": 1}
    ),
    "more false alarms than requests": change_all(
        recovery={"policy": "none", "requests": 1, "false_alarms": 2, "repaired": 0}
    ),
    "setting up took longer than the episode": both(CLEAN, setup_seconds=1e4),
    "the steps took longer than the episode": lines(seconds={"settle": 1e4}),
    "a time that is none": lines(seconds={"settle": -1}),
    "an episode is dropped": one_is_dropped,
    "another task in the configuration": configured(
        lambda data: data.update(tasks=["copy_folder"])
    ),
    "a task of somebody else in the configuration": configured(
        lambda data: data.update(tasks=["mine.py:Task"])
    ),
    "another seed in the configuration": configured(lambda data: data.update(seeds=[4])),
    "another agent in the configuration": configured(lambda data: data.update(agents=["fail"])),
    "a parameter of a corruption": configured(
        lambda data: data["corruptions"].__setitem__(1, {"marks": {"number": 1}})
    ),
    "the policy in the configuration": configured(lambda data: data.update(recovery="reset")),
    "an episode twice in the plan": head(lambda data: data["episodes"].append(CLEAN)),
    "a field of a record": change_all(rank=1),
    "a field of a step": lines(rank=1),
    "a field of the head": head(lambda data: data.update(rank=1)),
    "a field of the configuration": configured(lambda data: data.update(rank=1)),
    "a field of the desktop": desktop(rank=1),
    "code of an agent that is not in the run": configured(
        lambda data: data.update(code={"a.py:A": {}})
    ),
    "a field of a session": session(rank=1),
    "a session of another configuration": session(config_sha256="0" * 64),
    "a session of another version": session(versions={"agenthijack": "9.9"}),
    "a session after more records than there are": session(records=99),
    "a result of nothing": lines(MARKS, raw="WAIT", code=None, error="x"),
    "an answer that ran and was refused": lines(error="x"),
    "the picture of another step": lines(image="frames/0001.png"),
    "boxes that no plan needs": lines(boxes=[[1, 1, 5, 5]]),
    "the params of an effect": effect(params={"x": 1}),
    "the time of an effect in the record": effect(at=1.0),
    "a later probe in the record": effect(probes=[{"ok": True}]),
    "requests of an episode that is not in the run": added("requests/evil.jsonl"),
    "a file of an episode": added(f"episodes/{CLEAN}/notes.txt"),
    "a file among the episodes": added("episodes/notes.txt"),
    "an attempt that was not due": added(f"episodes/{CLEAN}__a1/"),
}
# What needs a secret: nothing else in the folder, or in the library, says what these are.
FREE = {
    "score and reason": both(CLEAN, score=1.0, reason="done as asked"),
    "usage": both(CLEAN, usage={"usd": 0.0}),
    "the agent's words": lines(said="Something else"),
    "answer and code together": lines(raw="pyautogui.click(1, 2)", code="pyautogui.click(1, 2)"),
    "the output of an action": lines(
        result={"status": "success", "output": "x", "error": "", "returncode": 0}
    ),
    "time and machine": together(
        both(CLEAN, seconds=500.0),
        head(lambda data: data.update(created=1.0, machine={}, git={}, desktops=9)),
    ),
    "options that came to nothing in this run": configured(
        lambda data: data.update(retries=3, agent_timeout=9, episode_timeout=9)
    ),
    "more steps, of which no episode made use": together(
        configured(lambda data: data.update(max_steps=60)), change_all(max_steps=60)
    ),
    "the agent is renamed to one that is given as little": given_other_name("random"),
    "the agent is renamed to one of somebody else": given_other_name("mine.py:Agent"),
    "a condition is dropped, and its configuration": condition_is_dropped,
    "the version of the library, with all that follows from it": together(
        head(lambda data: data["versions"].update(agenthijack="0.0.1")),
        session(versions={"agenthijack": "0.0.1"}),
        change_all(instruction="Do nothing"),
    ),
}


def test_the_run_as_it_was_recorded_is_whole(recorded):
    report = rebuild(recorded)
    assert (report.problems, report.episodes) == ([], 3)
    assert report.unproved == [
        "not signed: who writes all files anew, hashes included, is not found"
    ]


@pytest.mark.parametrize("name", FOUND)
def test_a_contradiction_is_found_although_all_hashes_fit(name, run):
    FOUND[name](run)
    hashed_anew(run)
    problems = rebuild(run).problems
    assert problems, f"{name}: not found"
    of_hashes = ("(previous)", "(chain)", "(episode_sha256)")
    assert not [text for text in problems if text.endswith(of_hashes)], problems


@pytest.mark.parametrize("name", FREE)
def test_what_only_a_signature_protects(name, run):
    """So that docs/verify_runs.md stays true; an entry that is found now moves to `FOUND`."""
    FREE[name](run)
    hashed_anew(run)
    assert rebuild(run).problems == []


def test_facts_of_another_version_of_the_library_are_not_claimed(run):
    head(lambda data: data["versions"].update(agenthijack="0.0.1"))(run)
    session(versions={"agenthijack": "0.0.1"})(run)
    hashed_anew(run)
    assert any("played with agenthijack '0.0.1', this is" in text for text in rebuild(run).unproved)


def test_an_episode_that_is_under_way_is_no_problem(run):
    shutil.rmtree(home(run, MINIMISED))
    journal(lambda rows: rows[:-1])(run)
    added(f"episodes/{MINIMISED}/frames/0000.png")(run)
    report = rebuild(run)
    assert report.problems == [
        f"run.json: 1 of 3 planned episodes are not there, such as {MINIMISED}"
    ]
    assert report.unfinished == 1
