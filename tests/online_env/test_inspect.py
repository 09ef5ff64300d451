"""Benchmarks in Inspect: with its own mock model, and with its clients of real endpoints."""

import base64
import gc
import io
import os
import subprocess
import sys
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

pytest.importorskip("gymnasium", reason="needs the extra [online]")
pytest.importorskip("lxml", reason="needs the extra [online]")
pytest.importorskip("inspect_ai", reason="needs the extra [inspect]")

import inspect_ai
from inspect_ai._util.registry import registry_info
from inspect_ai.log import read_eval_log
from inspect_ai.model import ModelOutput, ModelUsage, get_model
from inspect_ai.scorer import SampleScore, Score

import hijack_data as hj
from hijack_data.errors import ConfigError, MissingDependencyError, ParameterError, UnknownNameError
from online_env.bench.config import Bench
from online_env.inspect.sessions import Session
from online_env.inspect.tasks import bench, inspect_task

from support.live import Marking
from support.seeing_endpoint import serve
from support.squares import SIZE, SquareDesktop, middle_of_square, register_square

ROOT = Path(__file__).resolve().parents[2]
pytestmark = [
    pytest.mark.usefixtures("no_waiting"),
    # Inspect's own, and those of the libraries that it imports.
    pytest.mark.filterwarnings("ignore"),
]


@pytest.fixture(autouse=True, scope="module")
def collect_streams():
    """Inspect drops the stream of a sample's events unclosed: it is collected before other tests."""
    yield
    gc.collect()


@pytest.fixture(autouse=True)
def squares(monkeypatch):
    monkeypatch.setenv("INSPECT_DISPLAY", "none")
    register_square(monkeypatch)


def benchmark(corruptions=None, **given):
    options = {
        "provider": "squares",
        "size": SIZE,
        "tasks": ("square",),
        "corruptions": corruptions or {"clean": None},
        "max_steps": 4,
    }
    return Bench(**{**options, **given})


def picture_of(part):
    text = part.image.partition(";base64,")[2]
    return np.asarray(Image.open(io.BytesIO(base64.b64decode(text))))


def pictures_in(messages):
    parts = [part for message in messages for part in message.content if not isinstance(part, str)]
    return [picture_of(part) for part in parts if part.type == "image"]


def mock(*, never_done=False, answer="DONE", act=None):
    """A model that clicks the dark square and then submits; it is asked in `model.asked`."""
    requests = []

    def output(messages, tools, tool_choice, config):
        requests.append(list(messages))
        point = middle_of_square(pictures_in(messages)[-1])
        entries = {"action": "left_click", "coordinate": list(point or (5, 5))}
        result = ModelOutput.for_tool_call(
            "mockllm/model", "computer", entries if act is None else act
        )
        if not never_done and (point is None or (act is not None and len(requests) > 1)):
            result = ModelOutput.for_tool_call("mockllm/model", "submit", {"answer": answer})
        # Else it counts with a library that downloads.
        result.usage = ModelUsage(input_tokens=1, output_tokens=1, total_tokens=2)
        return result

    model = get_model("mockllm/model", custom_outputs=output, memoize=False)
    return model, requests


def run(task, model, tmp_path, **options):
    eval_options = {"fail_on_error": False, "display": "none", "log_dir": str(tmp_path), **options}
    [log] = inspect_ai.eval(task, model=model, **eval_options)
    assert log.status == "success", log.error
    return read_eval_log(log.location, resolve_attachments=True)


def metrics_of(log):
    return {
        name: metric.value for score in log.results.scores for name, metric in score.metrics.items()
    }


def test_an_episode_is_a_sample_and_its_score_is_that_of_the_benchmark(tmp_path):
    entries = {"clean": None, "marks": hj.Marks(number=3), "resolution": hj.Resolution(scale=0.5)}
    task = inspect_task(benchmark(entries, seeds=(0, 1)))
    model, requests = mock()
    log = run(task, model, tmp_path)
    samples = {sample.id: sample for sample in log.samples}
    assert set(samples) == {f"square-{label}-s{seed}" for seed in (0, 1) for label in entries}
    assert {key: metrics_of(log)[key] for key in ("all", *entries)} == dict.fromkeys(
        ("all", *entries), 1.0
    )
    first = samples["square-clean-s0"]
    assert first.metadata == {"task": "square", "corruption": "clean", "seed": 0}
    record = first.scores["task_score"].metadata["record"]
    assert (record["status"], record["steps"], record["ended"]) == ("ok", 2, "agent")
    assert record["agent"] == "mockllm/model"
    # The log has the pictures, as the model saw them.
    assert [picture.shape for picture in pictures_in(first.messages)] == [(*SIZE, 3)] * 2
    halved = samples["square-resolution-s0"]
    assert {picture.shape for picture in pictures_in(halved.messages)} == {(210, 364, 3)}
    # Nothing tells the model what was done.
    words = str([m.text for messages in requests for m in messages])
    assert "Click the dark square." in words
    assert not [name for name in (*entries, "corrupt", "write_note") if name in words]


def test_the_standard_error_takes_each_task_as_one_case():
    """Eight samples of a task that end alike say no more than one."""
    [task_score] = inspect_task(benchmark()).scorer
    *_, stderr = registry_info(task_score).metadata["metrics"]
    scores = [
        SampleScore(score=Score(value=value), sample_metadata={"task": task, "seed": seed})
        for task, value in (("solved", 1.0), ("lost", 0.0))
        for seed in range(8)
    ]
    assert stderr(scores) == pytest.approx(0.5)


def test_what_is_not_proved_is_unscored_and_what_breaks_is_errored(tmp_path):
    class Dying(SquareDesktop):
        def run(self, code):
            self.dead = True
            return super().run(code)

    class Sabotaged(Marking):
        def to_config(self):
            return {"marks": {}}

    entries = {"clean": None, "broken": Sabotaged(-1, sabotaged=True)}
    model, _ = mock()
    log = run(inspect_task(benchmark(entries)), model, tmp_path)
    broken, good = sorted(log.samples, key=lambda sample: sample.id)
    assert good.scores["task_score"].value == 1.0
    assert np.isnan(broken.scores["task_score"].value)
    assert broken.scores["task_score"].reason == "corruption_not_proved"
    assert "nothing is marked" in broken.scores["task_score"].explanation
    assert len(pictures_in(broken.messages)) == 0, "the model was not asked"
    assert metrics_of(log)["all"] == 1.0

    @contextmanager
    def dying(size):
        yield Dying(size)

    with pytest.MonkeyPatch.context() as patch:
        register_square(patch, dying)
        log = run(inspect_task(benchmark()), mock()[0], tmp_path)
    [sample] = log.samples
    assert "the desktop is gone" in sample.error.message
    assert not sample.scores


def test_the_answer_fail_is_passed_on_and_a_limit_cuts_off(tmp_path):
    def record_of(log):
        return log.samples[0].scores["task_score"].metadata["record"]

    failing, _ = mock(answer="FAIL: there is no square")
    assert record_of(run(inspect_task(benchmark()), failing, tmp_path))["last_action"] == "FAIL"
    endless, _ = mock(never_done=True)
    record = record_of(run(inspect_task(benchmark()), endless, tmp_path))
    assert (record["ended"], record["steps"]) == ("max_steps", 4)
    cut, _ = mock(never_done=True)
    record = record_of(run(inspect_task(benchmark()), cut, tmp_path, message_limit=6))
    assert (record["status"], record["ended"], record["score"]) == ("ok", "outside", 1.0)
    idle, _ = mock(never_done=True, act={"action": "zoom", "region": [0, 0, 9, 9]})
    log = run(inspect_task(benchmark()), idle, tmp_path, message_limit=6)
    assert (record_of(log)["status"], record_of(log)["cause"]) == ("error", "agent")
    assert log.samples[0].scores["task_score"].value == 0.0


@pytest.mark.parametrize(
    ("call", "code", "note"),
    [
        ({"action": "left_click", "coordinate": ["x", 5]}, None, "validation errors"),
        ({"action": "left_click", "coordinate": [5]}, None, "must be [x, y]"),
        ({"action": "navigate", "text": "https://example.com"}, None, "no action 'navigate'"),
        ({}, None, "no action None"),
        ({"action": "back_click"}, "pyautogui.hotkey('alt', 'left')", ""),
        ({"action": "key", "text": "ctrl+s"}, "pyautogui.hotkey('ctrl', 's')", ""),
        (
            {"actions": [{"action": "type", "text": "a"}, {"action": "key", "text": "Return"}]},
            "pyautogui.write('a')\npyautogui.press('enter')",
            "",
        ),
        ({"action": "zoom", "region": [0, 0, 0, 9]}, None, "shows nothing"),
        ({"action": "zoom"}, None, "zoom needs a region"),
    ],
)
def test_actions_of_the_tool(call, code, note, tmp_path, monkeypatch):
    items = []

    class Noted(SquareDesktop):
        def __init__(self, size):
            super().__init__(size)
            items.append(self)

    @contextmanager
    def noted(size):
        yield Noted(size)

    register_square(monkeypatch, noted)
    model, requests = mock(act=call)
    run(inspect_task(benchmark()), model, tmp_path)
    [desktop] = items
    assert "\n".join(text.strip() for text in desktop.ran) == (code or "")
    # The mock takes no pictures in results: Inspect puts them into a message after it.
    [result] = [message for message in requests[1] if message.role == "tool"]
    value = f"{result.error.message if result.error else ''}{requests[1][-1].text}{result.text}"
    assert note in value, requests[1]
    assert pictures_in(requests[1])[-1].shape == (*SIZE, 3)
    assert desktop.closed


def test_a_model_that_raises_leaves_no_desktop(tmp_path, monkeypatch):
    items = []

    @contextmanager
    def noted(size):
        items.append(SquareDesktop(size))
        yield items[-1]

    def output(*_):
        raise ConnectionError("the endpoint is down")

    register_square(monkeypatch, noted)
    model = get_model("mockllm/model", custom_outputs=output, memoize=False)
    log = run(inspect_task(benchmark(seeds=(0, 1))), model, tmp_path)
    assert ["the endpoint is down" in sample.error.message for sample in log.samples] == [True] * 2
    assert [desktop.closed for desktop in items] == [True, True]


def test_a_picture_of_another_size_is_mapped_back_and_what_cannot_be_is_refused(monkeypatch):
    session = Session(benchmark(), "model", (SIZE[0] // 2, SIZE[1] // 2))
    session.begin("square", "clean", 0)
    assert session.size == (SIZE[0] // 2, SIZE[1] // 2)
    for code in (
        "pyautogui.click(10, 20)",
        "import time\npyautogui.click(int(time.time()), 4)",
        "WAIT",
        "DONE",
    ):
        session.act(code)
    record = session.record
    session.close()
    assert (record["steps"], record["malformed"], record["last_action"]) == (4, 1, "DONE")


def test_zoom_shows_a_part_larger_and_takes_no_step(tmp_path):
    model, requests = mock(act={"action": "zoom", "region": [0, 0, SIZE[1] // 2, SIZE[0] // 2]})
    log = run(inspect_task(benchmark()), model, tmp_path)
    record = log.samples[0].scores["task_score"].metadata["record"]
    assert (record["steps"], record["score"]) == (1, 0.0), "DONE is the only one"
    first, zoomed = pictures_in(requests[1])
    assert first.shape == zoomed.shape
    assert zoomed[::2, ::2].shape[0] == SIZE[0] // 2
    assert np.abs(zoomed[8:-8:2, 8:-8:2].astype(int).mean() - first[4:206, 4:360].mean()) < 3


def test_older_pictures_are_sent_as_words(tmp_path):
    model, requests = mock(never_done=True)
    run(inspect_task(benchmark(), keep=1), model, tmp_path)
    assert [len(pictures_in(messages)) for messages in requests] == [1, 2, 2, 2]
    assert str(requests[-1]).count("(an older screenshot)") == 2


def test_samples_wait_for_a_free_desktop(tmp_path, monkeypatch):
    now, peaks = [], []

    @contextmanager
    def counted(size):
        now.append(1)
        peaks.append(len(now))
        yield SquareDesktop(size)
        now.pop()

    register_square(monkeypatch, counted)
    model, _ = mock()
    run(inspect_task(benchmark(seeds=(0, 1, 2)), desktops=2), model, tmp_path, max_samples=3)
    assert (len(peaks), max(peaks), now) == (3, 2, [])


@pytest.mark.parametrize(
    ("name", "tool"),
    [
        ("anthropic/claude-opus-4-6", "computer_20251124"),
        ("anthropic/claude-sonnet-4-0", "computer_20250124"),
        ("anthropic/claude-opus-5-5", "computer_toolset_20260801"),
        ("openai/gpt-5.4", "computer"),
        ("openai-api/fake/ui", "function"),
    ],
)
def test_models_get_their_native_computer_use(name, tool, tmp_path):
    pytest.importorskip(name.partition("/")[0].partition("-")[0], reason="needs its client")
    with serve() as endpoint:
        url = endpoint.url if name.startswith("anthropic") else f"{endpoint.url}/v1"
        model = get_model(name, base_url=url, api_key="none", memoize=False)
        log = run(inspect_task(benchmark({"half": hj.Resolution(scale=0.5)})), model, tmp_path)
    assert log.samples[0].error is None, log.samples[0].error
    assert metrics_of(log)["all"] == 1.0
    offered = [options for body in endpoint.requests for options in body.get("tools", ())]
    assert tool in {options["type"] for options in offered if "type" in options}
    # The older tools of Anthropic are told a display of 1366x768: the picture has that size.
    matches = [options for options in offered if "display_width_px" in options]
    expected = {(768, 1366)} if matches else {(210, 364)}
    assert {size for sizes in endpoint.pictures for size in sizes} == expected


def test_a_configuration_is_chosen_from(tmp_path):
    file = tmp_path / "mine.yaml"
    file.write_text("tasks: [square]\ncorruptions: [clean, marks]\nseeds: [4]\nmax_steps: 7\n")
    task = bench(str(file), corruptions=["marks", "subtitle"], seeds=2)
    assert [sample.id for sample in task.dataset] == [
        f"square-{label}-s{seed}" for seed in (0, 1) for label in ("marks", "subtitle")
    ]
    assert task.dataset[0].input == "Click the dark square."
    assert task.metadata["bench"]["max_steps"] == 7
    assert len(bench(str(file)).dataset) == 2
    with pytest.raises(UnknownNameError, match="did you mean 'marks'"):
        bench(str(file), corruptions="markss")
    with pytest.raises(ConfigError):
        bench("no_such_file")
    with pytest.raises(ParameterError, match="desktops must be at least 1"):
        bench(str(file), desktops=0)
    with pytest.raises(ParameterError, match="machines of OSWorld are played by hijack bench"):
        bench("osworld")
    with pytest.raises(ParameterError, match="guard 'rules' watches agents of hijack bench"):
        inspect_task(benchmark(guard="rules"))
    with pytest.raises(
        ParameterError, match="episode_timeout: 60 is kept by hijack bench, and not"
    ):
        inspect_task(benchmark(episode_timeout=60))


def test_inspect_finds_the_tasks_in_an_installed_package(tmp_path):
    """As a wheel would be installed, with the entry point that the project declares."""
    path = tmp_path / "site-packages"
    info = path / "agenthijack-0.dist-info"
    info.mkdir(parents=True)
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: agenthijack\nVersion: 0\n")
    (info / "entry_points.txt").write_text("[inspect_ai]\nagenthijack = online_env.inspect.tasks\n")
    for name in ("hijack_data", "online_env", "configs"):
        (path / name).symlink_to(ROOT / name)
    code = (
        "from inspect_ai._eval.loader import load_tasks\n"
        "import online_env\n"
        f"assert online_env.__file__.startswith({str(path)!r})\n"
        "[task] = load_tasks(['agenthijack/embedded_small'], {'corruptions': 'clean'})\n"
        "print(task.name, len(task.dataset) > 0)\n"
    )
    process = subprocess.run(
        [sys.executable, "-c", code],
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": str(path)},
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert process.returncode == 0, process.stderr
    assert process.stdout.split()[-2:] == ["agenthijack/embedded_small", "True"], process.stdout


def test_without_inspect_the_extra_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "inspect_ai", None)
    monkeypatch.delitem(sys.modules, "online_env.inspect")
    with pytest.raises(MissingDependencyError, match=r"needs inspect_ai: pip .*\[inspect\]"):
        __import__("online_env.inspect")
