"""`hijack report` of jobs of Harbor, ATIF, studies of AgentLab, runs of cua-bench and OSWorld."""

import json

import pytest

pytest.importorskip("scipy", reason="needs the extra [online]")

from online_env.report import build_report
from online_env.results.outcomes import OutcomeError, collect_run, parse_columns

SOLVED = {"clean": [1, 1, 1, 0], "marks": [1, 0, 0, 0]}


def success(sources, **options):
    report = build_report(collect_run(sources, **options))
    return report, {(cell.agent, cell.corruption): cell.success for cell in report.cells}


def write_json(path, data):
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(data))
    return path


def trial(task, rewards, *, checksum="a" * 64, error=None, **more):
    """The result of a trial as Harbor 0.26 writes it."""
    exception = error and {"exception_type": error, "exception_message": "m", "occurred_at": "t"}
    return {
        "schema_version": 1,
        "id": "7e847602-99fb-42ca-a32f-23ea46842352",
        "task_name": task,
        "trial_name": f"{task}__abcdefg",
        "trial_uri": "file:///jobs",
        "task_id": {"path": task},
        "source": None,
        "task_checksum": checksum,
        "config": {},
        "agent_info": {"name": "terminus-2", "version": "2.0", "model_info": {"name": "gpt"}},
        "verifier_result": {"rewards": rewards},
        "exception_info": exception,
        **more,
    }


def harbor_jobs(root):
    for label, scores in SOLVED.items():
        write_json(root / label / "result.json", {"id": "x", "n_total_trials": 4, "stats": {}})
        for number, score in enumerate(scores):
            path = root / label / f"t{number}__abcdefg" / "result.json"
            write_json(path, trial(f"t{number}", {"reward": score}))
    return root


def test_jobs_of_harbor_are_conditions_by_the_names_of_their_folders(tmp_path):
    harbor_jobs(tmp_path)
    expected = {("terminus-2 (gpt)", "clean"): 0.75, ("terminus-2 (gpt)", "marks"): 0.25}
    assert success([tmp_path])[1] == expected
    assert success([tmp_path / "clean", tmp_path / "marks"])[1] == expected
    (tmp_path / "marks").rename(tmp_path / "run-7")
    columns = parse_columns("condition=1")
    assert success([tmp_path], columns=columns)[1][("terminus-2 (gpt)", "run-7")] == 0.25


def measures(sources, **options):
    rows = build_report(collect_run(sources, **options)).measures
    return {row.measure: (row.tasks, row.mean_clean, row.mean_corrupted) for row in rows}


def trajectory(agent_steps, **totals):
    """A trajectory in ATIF; its first step is the user's."""
    steps = [{"step_id": 1, "source": "user", "message": "do it"}]
    steps += [{"step_id": 2 + n, "source": "agent", "message": ""} for n in range(agent_steps)]
    agent = {"name": "a", "version": "1", "model_name": "m"}
    return {"schema_version": "ATIF-v1.7", "agent": agent, "steps": steps, "final_metrics": totals}


def test_what_an_episode_took_is_read_where_a_format_has_it(tmp_path):
    harbor, atif = harbor_jobs(tmp_path / "harbor"), tmp_path / "atif"
    agentlab, cua = tmp_path / "agentlab", tmp_path / "cua"
    for label in SOLVED:
        more = 3 * (label == "marks")
        for number in range(4):
            path = harbor / label / f"t{number}__abcdefg" / "result.json"
            used = {"n_input_tokens": 100, "n_output_tokens": 10 + more, "cost_usd": 0.5}
            write_json(path, json.loads(path.read_text()) | {"agent_result": used})
            write_json(path.parent / "agent" / "trajectory.json", trajectory(7 + more))
            totals = {"total_prompt_tokens": 5, "total_completion_tokens": 1 + more}
            extra = {"task": f"t{number}", "noise": label, "reward": 1}
            data = trajectory(2 + more, **totals, total_steps=99) | {"extra": extra}
            write_json(atif / f"{label}-{number}.json", data)
            name = f"2026-01-01_10-20-52_Generic_on_miniwob.t-{number}_64"
            spent = {"stats.cum_input_tokens": 8, "stats.cum_output_tokens": 2, "n_steps": 3 + more}
            experiment(agentlab / label, name, cum_reward=1, **spent, **{"stats.cum_cost": 0.0})
            cua_trace(cua / label, f"click_v{number}", [("evaluate", {"result": [1.0]})])
            path = cua / label / f"click_v{number}" / "trajectory.json"
            write_json(path, trajectory(4 + more))
    steps, tokens = (4, 7.0, 10.0), (4, 110.0, 113.0)
    assert measures([harbor]) == {"steps": steps, "tokens": tokens, "usd": (4, 0.5, 0.5)}
    columns = parse_columns("task=task,condition=noise,score=reward")
    value = measures([atif], columns=columns)
    assert value == {"steps": (4, 2.0, 5.0), "tokens": (4, 6.0, 9.0)}
    # AgentLab writes a cost of 0 for a model whose price it does not know.
    assert measures([agentlab]) == {"steps": (4, 3.0, 6.0), "tokens": (4, 10.0, 10.0)}
    value = build_report(collect_run([cua / "clean", cua / "marks"])).cells
    assert [cell.steps for cell in value] == [4.0, 7.0]
    path = harbor / "clean" / "t0__abcdefg" / "result.json"
    used = {"n_input_tokens": None, "n_output_tokens": 1, "cost_usd": -1}
    write_json(path, json.loads(path.read_text()) | {"agent_result": used})
    with pytest.raises(OutcomeError, match="cost_usd must be a number of at least 0, got -1"):
        collect_run([harbor])


def test_a_trial_without_a_valid_reward_is_no_zero(tmp_path):
    for name, result in {
        "a": trial("a", {"reward": 1}),
        "b": trial("b", {"reward": 0}, error="AgentTimeoutError"),
        "c": trial("c", {"reward": 0}, error="ApiError"),
        "d": trial("d", None, error="EnvironmentStartTimeoutError"),
        "e": trial("e", {"reward": 0}, error="NewError", reward_valid=True),
        "f": trial("f", {"reward": 0}, reward_valid=False),
    }.items():
        write_json(tmp_path / name / "result.json", result)
    (cell,) = success([tmp_path])[0].cells
    assert (cell.n, cell.invalid, cell.success) == (3, 3, 1 / 3)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"schema_version": 2}, "schema_version 2 is not known"),
        ({"agent_info": {"name": "x"}}, "has no field 'agent_info.version'"),
        ({"verifier_result": {"rewards": {"reward": 7}}}, "must be a number from 0 to 1, got 7"),
        ({"verifier_result": {"rewards": {"reward": float("nan")}}}, "from 0 to 1, got nan"),
        ({"verifier_result": {"rewards": {"a": 1, "b": 0}}}, "several rewards (a, b)"),
        ({"task_checksum": "b" * 64}, "the task t0 is not the same for"),
    ],
)
def test_a_result_of_another_form_is_named_with_its_field(change, said, tmp_path):
    harbor_jobs(tmp_path)
    path = tmp_path / "clean" / "t0__abcdefg" / "result.json"
    write_json(path, json.loads(path.read_text()) | change)
    with pytest.raises(OutcomeError) as error:
        collect_run([tmp_path])
    assert said in str(error.value)
    assert "task_checksum" in change or str(path) in str(error.value)


def test_keys_have_no_order_and_a_trial_without_a_result_is_refused(tmp_path):
    harbor_jobs(tmp_path)
    folder = tmp_path / "clean" / "t0__abcdefg"
    result = json.loads((folder / "result.json").read_text())
    write_json(folder / "result.json", {"config": {"prompt": "long " * 2000}, **result})
    assert success([tmp_path])[0].cells[0].n == 4
    write_json(folder / "config.json", {"task": {"path": "t0"}, "trial_name": folder.name})
    assert success([tmp_path])[0].cells[0].n == 4
    (folder / "result.json").unlink()
    with pytest.raises(OutcomeError, match=r"t0__abcdefg: is a trial without result\.json"):
        collect_run([tmp_path])


def test_a_trajectory_in_atif_needs_keys_for_task_and_score(tmp_path):
    for label, scores in SOLVED.items():
        for number, score in enumerate(scores):
            write_json(
                tmp_path / f"{label}-{number}.json",
                {
                    "schema_version": "ATIF-v1.7",
                    "agent": {"name": "a", "version": "1", "model_name": "m"},
                    "steps": [{"step_id": 1, "source": "user", "message": "do it"}],
                    "extra": {"task": f"t{number}", "noise": label, "reward": score},
                },
            )
    with pytest.raises(OutcomeError, match="has no field for its task and score; name keys"):
        collect_run([tmp_path])
    columns = parse_columns("task=task,condition=noise,score=reward")
    value = success([tmp_path], columns=columns)[1]
    assert value == {("a (m)", "clean"): 0.75, ("a (m)", "marks"): 0.25}
    path = tmp_path / "clean-0.json"
    path.write_text(path.read_text().replace("v1.7", "v2.0"))
    with pytest.raises(OutcomeError, match=r"schema_version 'ATIF-v2\.0' is not known"):
        collect_run([tmp_path], columns=columns)


def experiment(study, name, **summary):
    folder = study / name
    folder.mkdir(parents=True)
    (folder / "exp_args.pkl").write_bytes(b"not opened")
    if summary:
        summary = {"n_steps": 3, "err_msg": None, "terminated": True, **summary}
        write_json(folder / "summary_info.json", summary)


def test_studies_of_agentlab_are_read_without_their_pickles(tmp_path):
    for label, scores in SOLVED.items():
        for number, score in enumerate(scores):
            name = f"2026-01-01_10-20-52_Generic_on_miniwob.t-{number}_64"
            experiment(tmp_path / label, name, cum_reward=score)
    study = tmp_path / "clean"
    experiment(study, "2024-08-01_10-20-52_Generic_on_miniwob.t-0_68_b6312d")
    experiment(study, "2024-08-01_10-20-52_Generic_on_miniwob.t-1_7", cum_reward=0, err_msg="E")
    experiment(study, "2024-08-01_10-20-52_Generic_on_miniwob.t-2_7", cum_reward=0, terminated=None)
    experiment(study, "_2024-08-01_10-20-52_Generic_on_miniwob.t-3_7", cum_reward=1)
    report, value = success([tmp_path])
    assert value == {("Generic", "clean"): 0.75, ("Generic", "marks"): 0.25}
    assert report.cell("Generic", "clean").invalid == 3
    experiment(study, "2024-08-01_10-20-52_a_on_b_on_c_7", cum_reward=1)
    with pytest.raises(OutcomeError, match="does not tell where agent, task and seed end"):
        collect_run([tmp_path])


def cua_trace(run, name, events):
    pa = pytest.importorskip("pyarrow")
    folder = run / name / "task_0_trace"
    folder.mkdir(parents=True)
    table = pa.table(
        {
            "event_name": [event for event, _ in events],
            "data_json": [json.dumps(data) for _, data in events],
        }
    )
    path = str(folder / "data-00000-of-00001.arrow")
    with pa.OSFile(path, "wb") as file, pa.ipc.new_stream(file, table.schema) as writer:
        writer.write_table(table)


def test_runs_of_cua_bench_are_read_from_arrow_and_from_results(tmp_path):
    for label, scores in SOLVED.items():
        for number, score in enumerate(scores):
            events = [("reset", {"task": "t"}), ("evaluate", {"result": [float(score)]})]
            cua_trace(tmp_path / label, f"click_v{number}", events)
    cua_trace(tmp_path / "clean", "drag_v0", [("reset", {})])
    cua_trace(tmp_path / "marks", "drag_v0", [("evaluate", {"result": [1.0, False]})])
    report, value = success([tmp_path / "clean"])
    assert value == {("clean", "clean"): 0.75}
    assert report.cells[0].invalid == 1
    for label, scores in {
        "clean": [*SOLVED["clean"], None],
        "marks": [*SOLVED["marks"], 0],
    }.items():
        for number, score in enumerate(scores):
            name = f"click_v{number}" if number < 4 else "drag_v0"
            result = {"reward": score, "error": None, "schema_version": 1}
            result["agent_info"] = {"name": "cua", "version": "cua-bench", "model_info": None}
            write_json(tmp_path / label / name / "result.json", result)
    value = success([tmp_path])[1]
    assert value == {("cua", "clean"): 0.75, ("cua", "marks"): 0.2}
    cua_trace(tmp_path / "other", "click_v0", [("evaluate", {"score": 1})])
    with pytest.raises(OutcomeError, match="data_json of an evaluate event has no 'result'"):
        collect_run([tmp_path / "other"])


def osworld_task(root, *parts, score=1.0):
    folder = root.joinpath(*parts)
    folder.mkdir(parents=True)
    (folder / "traj.jsonl").touch()
    (folder / "result.txt").write_text(f"{score}\n")


def test_the_authors_layout_has_the_noise_above_the_model_and_trials_below(tmp_path):
    protocol = tmp_path / "results" / "pyautogui" / "screenshot"
    for label, scores in SOLVED.items():
        for number, score in enumerate(scores):
            for trial_id in "01":
                # Tasks of several applications lie in multi_apps, which is a corruption's name, too.
                place = label, "ui-tars", trial_id, "multi_apps", f"id-{number}"
                osworld_task(protocol, *place, score=bool(score))
    expected = {("ui-tars", "clean"): 0.75, ("ui-tars", "marks"): 0.25}
    report, value = success([tmp_path / "results"])
    assert (value, report.run.seeds, report.run.tasks) == (expected, (0, 1), 4)
    assert success([protocol / "clean", protocol / "marks"])[1] == expected
    one_folder = protocol / "marks" / "ui-tars"
    assert success([one_folder])[1] == {("ui-tars", "marks"): 0.25}


def test_a_folder_between_protocol_and_model_may_be_a_condition_and_is_asked_for(tmp_path):
    osworld_task(tmp_path, "pyautogui", "screenshot", "my_noise", "gpt", "os", "id-1")
    with pytest.raises(OutcomeError, match=r"not clear what its folders say \(my_noise; gpt\)"):
        collect_run([tmp_path])
    columns = parse_columns("condition=3")
    assert success([tmp_path], columns=columns)[1] == {("gpt", "my_noise"): 1.0}


def test_results_of_several_versions_are_said(tmp_path):
    harbor_jobs(tmp_path)
    path = tmp_path / "marks" / "t0__abcdefg" / "result.json"
    path.write_text(path.read_text().replace('"version": "2.0"', '"version": "2.1"'))
    (note,) = [note for note in success([tmp_path])[0].notes if "several versions" in note]
    assert "terminus-2 (gpt) 2.1: terminus-2 (gpt) under marks" in note
