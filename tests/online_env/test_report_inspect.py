"""`hijack report` of logs that Inspect wrote, by its own mock model."""

import gc
import json

import pytest

pytest.importorskip("scipy", reason="needs the extra [online]")
pytest.importorskip("inspect_ai", reason="needs the extra [inspect]")

import inspect_ai
from inspect_ai.dataset import Sample
from inspect_ai.log import read_eval_log, write_eval_log
from inspect_ai.model import ModelOutput, ModelUsage, get_model
from inspect_ai.scorer import match
from inspect_ai.solver import generate, solver

from online_env.report import build_report
from online_env.results.outcomes import OutcomeError, collect_run

SOLVED = {"clean": [1, 1, 1, 1, 1, 0], "marks": [1, 1, 0, 0, 0, 0]}
# Inspect's own warnings, and those of the libraries that it imports.
pytestmark = pytest.mark.filterwarnings("ignore")


@pytest.fixture(autouse=True, scope="module")
def collect_streams():
    """Inspect drops the stream of a sample's events unclosed: it is collected before other tests."""
    yield
    gc.collect()


def inspect_logs(folder, log_format="eval"):
    """Two logs that Inspect writes: a model that answers right, and one sample that raises."""

    @solver
    def broken():
        async def solve(state, generate):
            if state.sample_id == "t5" and state.metadata["corruption"] == "marks":
                raise ValueError("the desktop died")
            return state

        return solve

    for label, answers in SOLVED.items():
        samples = [
            Sample(id=f"t{n}", input="?", target="yes", metadata={"corruption": label})
            for n in range(len(answers))
        ]
        outputs = [
            ModelOutput.from_content("mockllm/model", "yes" if answer else "no")
            for answer in answers
        ]
        for output in outputs:  # else it counts with a library that downloads
            output.usage = ModelUsage(input_tokens=1, output_tokens=1, total_tokens=2)
        inspect_ai.eval(
            inspect_ai.Task(dataset=samples, solver=[broken(), generate()], scorer=match()),
            model=get_model("mockllm/model", custom_outputs=outputs, memoize=False),
            log_dir=str(folder),
            log_format=log_format,
            display="none",
            fail_on_error=False,
            max_samples=1,
            max_connections=1,
        )
    return folder


@pytest.mark.parametrize("log_format", ["eval", "json"])
def test_logs_of_inspect_are_read_and_an_error_is_no_zero(log_format, tmp_path):
    logs = inspect_logs(tmp_path / "logs", log_format)
    sources = [logs] if log_format == "eval" else sorted(logs.glob("*.json"))
    report = build_report(collect_run(sources))
    assert report.agents == ("mockllm/model",)
    marks = report.cell("mockllm/model", "marks")
    assert (marks.n, marks.invalid, marks.success) == (5, 1, 2 / 5)
    assert report.cell("mockllm/model", "clean").success == 5 / 6
    tokens = next(row for row in report.measures if row.measure == "tokens")
    assert (tokens.tasks, tokens.mean_clean, tokens.mean_corrupted) == (5, 2.0, 2.0)
    with pytest.raises(OutcomeError, match="has no scorer 'mach'; did you mean 'match'"):
        collect_run(sources, columns={"score": "mach"})
    with pytest.raises(OutcomeError, match="neither metadata nor task arguments have 'noise'"):
        collect_run(sources, columns={"condition": "noise"})


def test_a_folder_of_logs_leaves_none_out(tmp_path):
    """Only its .eval files were read."""
    logs = inspect_logs(tmp_path / "logs")
    (*_, last) = sorted(logs.glob("*.eval"))
    whole_run = collect_run([logs])
    write_eval_log(read_eval_log(str(last)), str(last.with_suffix(".json")), format="json")
    last.unlink()
    assert sorted(map(str, collect_run([logs]).records)) == sorted(map(str, whole_run.records))
    (logs / "more").mkdir()
    last.with_suffix(".json").rename(logs / "more" / "log.json")
    with pytest.raises(OutcomeError, match="more holds logs, too; give each folder"):
        collect_run([logs])


def test_a_log_that_did_not_end_is_refused_and_an_invalidated_sample_is_no_outcome(tmp_path):
    (path, *_) = sorted(inspect_logs(tmp_path, "json").glob("*.json"))
    log = json.loads(path.read_text())
    reason = {"timestamp": "2026-01-01T00:00:00Z", "author": "me", "reason": "leaked"}
    log["samples"][0]["invalidation"] = reason
    log["samples"][0]["metadata"]["noise"] = None
    path.write_text(json.dumps(log))
    run = collect_run([path])
    assert run.failures[0]["problem"] == "is invalidated: leaked"
    with pytest.raises(OutcomeError, match="sample t0: noise names no condition"):
        collect_run([path], columns={"condition": "noise"})
    log["status"] = "cancelled"
    path.write_text(json.dumps(log))
    assert len(collect_run([path]).records) == 6  # it is whole nevertheless
    del log["samples"][-1]
    path.write_text(json.dumps(log))
    with pytest.raises(OutcomeError, match=r"holds 5 of 6 samples \(its status is cancelled\)"):
        collect_run([path])


def test_a_log_whose_samples_have_no_id_is_refused(tmp_path):
    (path, *_) = sorted(inspect_logs(tmp_path, "json").glob("*.json"))
    log = json.loads(path.read_text())
    for sample in log["samples"]:
        del sample["id"]
    path.write_text(json.dumps(log))
    with pytest.raises(OutcomeError, match="is no log of Inspect"):
        collect_run([path])
