"""Files of a user that are damaged, of another version or wrong: what is said, and what is not done."""

import json

import pytest
from click.testing import CliRunner

pytest.importorskip("gymnasium", reason="needs the extra [online]")

from hijack_data.cli import hijack
from hijack_data.errors import ConfigError, HijackError, ParameterError, UnknownNameError
from hijack_data.runs.run_log import episode_slug
from online_env.agents.chat.request_log import RequestReplay
from online_env.agents.scripted import Scripted, read_script
from online_env.errors import ReplayError
from online_env.osworld import task_table
from online_env.osworld import tasks as osworld_tasks
from online_env.report.build import build_report, load_report
from online_env.report.gate import ReleaseGate
from online_env.report.report_command import report
from online_env.results import costs, reading, records
from online_env.results.reading import RunError

CONFIG = {"agents": ["oracle"], "corruptions": ["clean"]}
EPISODES = ["oracle--write_note-0--clean--0"]
RECORD = {
    "id": EPISODES[0],
    "agent": "oracle",
    "task": "write_note-0",
    "task_seed": 0,
    "corruption": "clean",
    "seed": 0,
    "status": "ok",
    "score": 1.0,
    "steps": 3,
}


@pytest.fixture
def run(tmp_path):
    """A run that was broken off after its first episode."""
    folder = tmp_path / "run"
    with records.create(folder, CONFIG, EPISODES):
        records.append(folder, dict(RECORD))
    return folder


def head_of(folder, **changes):
    path = folder / reading.RUN
    path.write_text(json.dumps(json.loads(path.read_text()) | changes))


def resume(folder, config=CONFIG, episodes=EPISODES):
    with records.resume(folder, config, episodes):
        pass


# Going on with a run


def test_a_run_goes_on_and_its_journal_stays_as_it_was(run):
    before = (run / reading.RECORDS).read_bytes()
    resume(run)
    assert (run / reading.RECORDS).read_bytes() == before
    assert len(records.read(run).records) == 1


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"version": 10**6}, r"version 1000000 is newer than this library reads \(\d\); upgrade"),
        ({"version": "2"}, "version '2' is not a version; it must be an integer"),
        ({"version": -1}, "version -1 is not a version; it must be an integer"),
        ({"format": "another"}, r"not the head of a run \(field 'format' must be"),
        ({"config": []}, "config: must be an object, got \\[\\]"),
        ({"versions": {"agenthijack": "0.0.1"}}, r"was begun with agenthijack 0\.0\.1, this is"),
        ({"versions": []}, "versions: must be an object, got \\[\\]"),
        ({"episodes": ["another"]}, "is another run: its tasks have other variants"),
    ],
)
def test_a_run_that_is_another_one_is_not_resumed(run, changes, said):
    head_of(run, **changes)
    before = {path: path.read_bytes() for path in run.iterdir() if path.is_file()}
    with pytest.raises(RunError, match=said) as error:
        resume(run)
    assert str(run) in str(error.value)
    assert {path: path.read_bytes() for path in before} == before, "refused, so nothing is written"


def test_another_configuration_is_named_by_its_first_difference(run):
    with pytest.raises(RunError, match=r'corruptions\[0\] was "clean", and is "marks" now'):
        resume(run, CONFIG | {"corruptions": ["marks"]})


def test_a_run_goes_on_where_the_files_of_its_code_have_moved_but_not_changed(tmp_path):
    def config(path, sha256):
        return CONFIG | {"code": {"mine.py:Mine": {"path": path, "sha256": sha256}}}

    with records.create(tmp_path / "run", config("/here/mine.py", "a1"), EPISODES):
        pass
    resume(tmp_path / "run", config("/there/mine.py", "a1"))
    with pytest.raises(RunError, match=r'sha256 was "a1", and is "b2" now'):
        resume(tmp_path / "run", config("/here/mine.py", "b2"))


def test_a_head_that_was_cut_off(run):
    head = run / reading.RUN
    head.write_bytes(head.read_bytes()[:40])
    with pytest.raises(RunError, match=r"run\.json: is not JSON"):
        resume(run)
    result = CliRunner().invoke(report, [str(run)])
    assert isinstance(result.exception, RunError)


def test_a_line_that_was_cut_off_at_the_end_is_dropped_and_run_again(run):
    journal = run / reading.RECORDS
    whole_bytes = journal.read_bytes()
    journal.write_bytes(whole_bytes + whole_bytes[:50])
    resume(run)
    assert journal.read_bytes() == whole_bytes


def test_a_line_that_is_damaged_in_the_middle_is_never_dropped(run):
    journal = run / reading.RECORDS
    whole_bytes = journal.read_bytes()
    broken = whole_bytes[:50] + b"\n" + whole_bytes
    journal.write_bytes(broken)
    with pytest.raises(RunError, match=r"records\.jsonl:1: not JSON, perhaps cut off"):
        resume(run)
    assert journal.read_bytes() == broken
    assert [damage.line for damage in records.read(run).damaged] == [1]


@pytest.mark.parametrize("content", ["{", "[]", '{"task": "t"}', "\0"])
def test_an_episode_without_a_line_whose_record_is_damaged(run, content):
    """A copy that was made while the run went on may hold half of a file."""
    path = run / reading.EPISODES / "x" / reading.EPISODE
    path.parent.mkdir(parents=True)
    path.write_text(content)
    with pytest.raises(RunError, match="remove the episode's folder to play it again") as error:
        resume(run)
    assert str(error.value).startswith(f"{path}: ")


def test_episodes_that_would_share_a_folder_are_refused(tmp_path):
    """An id keeps nothing of a name in another script, so two agents would write one record."""
    ids = [
        episode_slug("t", "clean", 0, agent, 0) for agent in ("我的.py:代理", "你的.py:代理", "a")
    ]
    with pytest.raises(RunError, match=r"1 ids stand for several episodes.*rename one of them"):
        records.create(tmp_path / "run", CONFIG, ids)
    assert not (tmp_path / "run").exists()


def test_a_run_that_another_process_plays(run):
    with (
        records.resume(run, CONFIG, EPISODES),
        pytest.raises(RunError, match="is being written by process"),
    ):
        resume(run)
    resume(run)


# Lines that no run writes


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"task_seed": []}, "field 'task_seed' is neither a number nor a text"),
        ({"seed": True}, "field 'seed' is missing or of the wrong type"),
        ({"score": True}, "score True is not a number in 0..1"),
        ({"steps": float("nan")}, "NaN is not a number"),
        ({"steps": -1}, "steps -1 is not a number of at least 0"),
        ({"seconds": 10**400}, "is not a number of at least 0"),
        ({"malformed": "1"}, "malformed '1' is not a number of at least 0"),
        ({"attempt": True}, "attempt True is not a number of at least 0"),
        ({"agent": "\ud800"}, "field 'agent' holds half of a surrogate pair"),
        ({"parts": {"type": "x"}}, "parts {'type': 'x'} are not true or false by name"),
        ({"parts": 5}, "parts 5 are not true or false by name"),
        ({}, f"episode '{EPISODES[0]}' is on line 1 already, which counts"),
    ],
)
def test_a_line_that_no_run_writes_is_left_out_and_named(run, changes, said):
    second = {"id": "another"} if changes else {}
    with (run / reading.RECORDS).open("a") as file:
        file.write(json.dumps({**RECORD, "score": 0.0, **second, **changes}) + "\n")
    result = records.read(run)
    assert [record["score"] for record in result.records] == [1.0]
    ((line, problem),) = [(damage.line, damage.problem) for damage in result.damaged]
    assert line == 2
    assert said in problem
    value = CliRunner().invoke(report, [str(run), "--format", "json"])
    assert value.exit_code == 1, "something is damaged"
    assert f"records.jsonl:2: skipped: {problem}" in value.stderr


def test_an_attempt_that_is_not_known_is_the_first(run):
    """A desktop that died once is no failure of the agent's."""
    failed = {"id": "x", "task": "t", "status": "error", "cause": "machine", "attempt": None}
    with (run / reading.RECORDS).open("a") as file:
        file.write(json.dumps({**RECORD, **failed}) + "\n")
    (cell,) = build_report(records.read(run)).cells
    assert (cell.n, cell.invalid) == (1, 1)


def test_what_an_agent_says_it_used_is_summed_only_if_it_can_be(run):
    sane = {"requests": 1, "input_tokens": 20, "output_tokens": 3, "usd": 0.25}
    odd = [sane, {**sane, "usd": -9.0}, {**sane, "input_tokens": -5}, {**sane, "usd": 10**400}]
    with (run / reading.RECORDS).open("a") as file:
        for number, usage in enumerate(odd):
            names = {"id": f"more-{number}", "task": f"task-{number}", "usage": usage}
            file.write(json.dumps({**RECORD, **names}) + "\n")
    result = records.read(run)
    assert not result.damaged
    (cell,) = build_report(result).cells
    assert (cell.input_tokens, cell.usd) == (None, None), "one usage is not known"
    assert costs.total_cost(result.records) == 0.5
    line = costs.usage_line(result.records)
    assert "60 tokens read, 9 written, price not known" in line
    assert line.endswith("without 2 episodes of unknown usage")


def test_records_of_other_episodes_do_not_stand_for_missing_ones(tmp_path):
    folder = tmp_path / "run"
    planned_ids = [EPISODES[0], "oracle--rename--clean--0"]
    with records.create(folder, CONFIG, planned_ids):
        records.append_all(folder, [RECORD, {**RECORD, "id": "x", "agent": "another"}])
    result = records.read(folder)
    assert result.unplayed == ("oracle--rename--clean--0",)
    assert result.missing == 1


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"episodes": 5}, "episodes: must be a list of ids, got 5"),
        ({"episodes": [5]}, "episodes: must be a list of ids, got [5]"),
        ({"created": float("nan")}, "is not JSON (NaN is not a number)"),
        ({"config": {"source": "\ud800"}}, "is not JSON ('utf-8' codec can't encode"),
    ],
)
def test_a_head_that_no_run_writes(run, changes, said):
    head_of(run, **changes)
    result = CliRunner().invoke(report, [str(run)])
    assert isinstance(result.exception, RunError)
    assert str(run / reading.RUN) in str(result.exception)
    assert said in str(result.exception)


@pytest.mark.parametrize(
    "config",
    [
        {"question": ["x"], "unscored": "many", "unpaired": True},
        {"agents": 5, "corruptions": 7},
        {"agents": {"x": 1}, "corruptions": [5, None, ["x"]]},
    ],
)
def test_a_scoring_run_whose_settings_are_of_the_wrong_kind_is_shown(run, config):
    head_of(run, config={**CONFIG, "kind": "score", **config})
    result = CliRunner().invoke(report, [str(run)])
    assert result.exception is None or isinstance(result.exception, SystemExit)
    assert "oracle" in result.stdout
    assert "many" not in result.stdout


@pytest.mark.parametrize("created", [10**400, 1e300, -1, True])
def test_a_run_of_a_machine_without_a_clock_has_no_date(run, tmp_path, created):
    head_of(run, created=created)
    result = CliRunner().invoke(report, [str(run), "-o", str(tmp_path / "report.html")])
    assert result.exit_code == 0, result.output
    assert "begun</" not in (tmp_path / "report.html").read_text()


@pytest.mark.parametrize("name", [reading.RUN, reading.RECORDS])
def test_a_device_in_the_place_of_a_file_is_not_read(run, name):
    (run / name).unlink()
    (run / name).symlink_to("/dev/null")
    with pytest.raises(RunError, match="is not a regular file, and reading it might never end"):
        reading.read(run)


# Reports


def cell(**fields):
    return {"cells": [{"agent": "a", "corruption": "clean", "n": 1, **fields}]}


def test_a_report_of_a_report_that_was_edited(run, tmp_path):
    value = tmp_path / "report.json"
    result = CliRunner().invoke(report, [str(run), "-o", str(value)])
    assert result.exit_code == 0, result.output
    assert load_report(value).cells
    data = json.loads(value.read_text())
    for changes, output in (
        ({"color": "red"}, "unknown field 'color'; make the report again"),
        ({"cells": 5}, "cells: must be a list, got 5; make the report again"),
        ({"cells": [5]}, "must be an object, got 5; make the report again"),
        ({"cells": [{"agent": 5}]}, "agent: must be str, got 5; make the report again"),
        (cell(success=7.0), "success: must be from 0 to 1, got 7.0; make the report again"),
        (cell(delta=-2), "delta: must be from -1 to 1, got -2.0"),
        (cell(steps=10**400), "steps: must be from 0 to 9007199254740992"),
        (cell(n=-1), "n: must be from 0 to"),
        (cell(success=float("nan")), "holds what JSON does not have"),
        (cell(agent="\ud800"), "holds what JSON does not have"),
        (
            {"summaries": [{"agent": "a", "n": 1, "given": ["hints"]}]},
            "given: must be among task, plan, process, tree, devtools, got ('hints',)",
        ),
        (
            {"run": {"name": "x", "kind": "bench", "settings": {"marks": 5}}},
            "settings: must hold the parameters of each label",
        ),
        (
            {"run": {"name": "x", "kind": "bench", "corruptions": {"marks": []}}},
            "corruptions: marks: must be str, got []",
        ),
        ({"run": {"name": "x", "kind": "bench", "created": 1e18}}, "created: must be from 0 to"),
    ):
        value.write_text(json.dumps(data | changes))
        with pytest.raises(HijackError) as error:
            load_report(value)
        assert output in str(error.value)
        assert str(value) in str(error.value)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (
            ["report", "RUN", "--format", "htm"],
            "--format: unknown format 'htm'; did you mean 'html'?",
        ),
        (["compare", "RUN", "RUN", "--pair", "oracle"], "--pair: 'oracle' is not OLD=NEW"),
        (
            ["compare", "RUN", "RUN", "--pair", "oracle=gpt"],
            r"--pair: 'gpt' is not in RUN (oracle)",
        ),
        (["gate", "RUN", "--fail-under", "clean"], "--fail-under clean: write SCORE=X"),
    ],
)
def test_options_of_a_report_that_cannot_be(run, words, said):
    result = CliRunner().invoke(hijack, [word.replace("RUN", str(run)) for word in words])
    assert result.exit_code != 0
    assert isinstance(result.exception, HijackError), result.output
    assert said.replace("RUN", str(run)) in str(result.exception)


@pytest.mark.parametrize(
    ("gate", "error", "said"),
    [
        ("sucess=0.5", UnknownNameError, "no score 'sucess'; did you mean 'success'"),
        ("orcle:success=0.5", UnknownNameError, "no agent 'orcle'; did you mean 'oracle'"),
        ("success=much", ParameterError, "success=much"),
    ],
)
def test_gates_that_mean_nothing_are_refused_before_the_run(gate, error, said):
    with pytest.raises(error, match="fail-under") as result:
        ReleaseGate.read((gate,), None, ("oracle",), ("clean",))
    assert said in str(result.value)


# Files of agents and of OSWorld


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("[WAIT", "cannot be parsed"),
        ("{a: 1}", "must be a list of actions, such as [WAIT, DONE]"),
        ("[]", "must be a list of actions"),
        ("[WAIT, 'click(1', DONE, 'import os']", "action 2"),
    ],
)
def test_a_script_with_mistakes(tmp_path, text, said):
    file = tmp_path / "plays.yaml"
    file.write_text(text)
    with pytest.raises(ConfigError) as error:
        read_script(file)
    assert f"{file}: {said}" in str(error.value)


def test_a_scripted_agent_without_its_script(monkeypatch):
    monkeypatch.delenv("AGENTHIJACK_SCRIPT", raising=False)
    with pytest.raises(ParameterError, match=r"name it with AGENTHIJACK_SCRIPT=FILE\.yaml"):
        Scripted()


@pytest.mark.parametrize(
    ("line", "said"),
    [('{"step": 0', "is damaged ("), ("[]", "it lacks one of"), ('{"step": 0}', "it lacks one of")],
)
def test_a_log_of_requests_that_is_damaged(tmp_path, line, said):
    log = tmp_path / "requests.jsonl"
    log.write_text(f"\n{line}\n")
    with pytest.raises(ReplayError) as error:
        RequestReplay(log)
    assert f"{log}:2: " in str(error.value)
    assert said in str(error.value)


def test_task_tables_of_osworld(tmp_path):
    with pytest.raises(ConfigError, match="no task files; expected examples/<domain>/<id>"):
        osworld_tasks.load(tmp_path)
    rows = tmp_path / "tasks.jsonl"
    with pytest.raises(ConfigError, match=r"tasks\.jsonl: cannot be read"):
        task_table.read(rows)
    rows.write_bytes(b'{"task_id": "\xff"}\n')
    with pytest.raises(ConfigError, match=r"tasks\.jsonl: not UTF-8"):
        task_table.read(rows)
    rows.write_text('{"task_id": 5}\n{"task_id": \n')
    with pytest.raises(ConfigError) as error:
        task_table.read(rows)
    assert [":1:" in str(error.value), ":2:" in str(error.value)] == [True, True]
