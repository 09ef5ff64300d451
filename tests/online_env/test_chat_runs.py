"""Runs of `hijack bench` whose agents ask a model: log, replay, cost, prompts, keys."""

import json
import os
from dataclasses import replace

import numpy as np
import pytest
from click.testing import CliRunner

pytest.importorskip("gymnasium", reason="needs the extra [online]")
pytest.importorskip("openai", reason="needs the extra [agents]")

from ext_package.paper import PaperDesktop, PressOk, provider

from hijack_data.errors import HijackError, MissingDependencyError
from online_env.agents.chat.prompts import read_prompt
from online_env.agents.chat.run import ChatRun
from online_env.agents.makers import agent_file_maker, prompts_folder
from online_env.agents.registry import AGENTS
from online_env.bench.bench_command import bench
from online_env.bench.config import load_bench, override
from online_env.bench.models import ModelOptions, begin, prepare
from online_env.bench.providers import PROVIDERS
from online_env.environment import Settle
from online_env.results import records
from online_env.tasks import TASKS
from online_env.tasks.machines import MachineSettings

from support.chatting import file
from support.endpoints import Raw, serving

pytestmark = pytest.mark.usefixtures("no_waiting", "paper")
PRESS = "```python\npyautogui.click(70, 70)\n```"
CONFIG = """
desktop: {provider: paper, size: [320, 240]}
tasks: [press_ok]
agents: [do_nothing]
corruptions: [clean, marks]
max_steps: 3
"""
MARKS = "press_ok-0__marks__s0__"


@pytest.fixture
def paper(monkeypatch):
    """A desktop of paper, which is settled at once, and its task."""
    before = [(registry, dict(registry.entries)) for registry in (AGENTS, PROVIDERS, TASKS)]
    PROVIDERS.add(provider, "paper")
    TASKS.add(PressOk)
    monkeypatch.setattr(PaperDesktop, "settle", Settle(quiet=0, cap=0), raising=False)
    yield
    for registry, entries in before:
        registry.entries.clear()
        registry.entries.update(entries)


def model(body):
    """Press the button, then say that it is done."""
    pictures = json.dumps(body).count("data:image/png")
    return PRESS if pictures == 1 else "```DONE```"


class Run:
    """Runs of one configuration in a folder."""

    def __init__(self, folder, url, text="", **keys):
        self.folder = folder
        self.agent = file(folder, url, text, **keys)
        (folder / "bench.yaml").write_text(CONFIG)

    def __call__(self, name, *options, agent=None, code=0):
        """Run into a folder; returns the output and the records."""
        out = self.folder / name
        AGENTS.entries.pop(str(self.agent), None)
        agent_name = str(agent or self.agent)
        words = [str(self.folder / "bench.yaml"), "--agent", agent_name, "--out", str(out)]
        words += ["--desktops", "1"]
        value = CliRunner().invoke(bench, [*words, *map(str, options)])
        if isinstance(value.exception, HijackError):
            raise value.exception
        assert value.exit_code == code, value.output
        return value.output, records.read(out).records


def lines(folder):
    """The lines of all logs of a run, by episode."""
    return {
        path.stem: [json.loads(line) for line in path.read_text().splitlines()]
        for path in sorted((folder / "requests").glob("*.jsonl"))
    }


def outcome(record):
    """What must be the same when a run is replayed."""
    clocks = ("seconds", "setup_seconds", "previous", "episode_sha256", "chain")
    return {key: value for key, value in record.items() if key not in clocks}


def test_a_run_keeps_its_log_and_can_be_replayed_without_the_endpoint(tmp_path, monkeypatch):
    monkeypatch.setenv("MY_KEY", "k-secret-7")
    with serving(model) as endpoint:
        run = Run(tmp_path, endpoint.url, api_key_env="MY_KEY", prices="{input: 1, output: 1}")
        _, value = run("first")
        requests = len(endpoint.asked)
    assert [record["score"] for record in value] == [1.0, 1.0]
    assert all(record["usage"]["usd"] == pytest.approx(2 * 1020e-6) for record in value)
    logs = lines(tmp_path / "first")
    assert set(logs) == {record["id"] for record in value}
    assert sum(map(len, logs.values())) == requests == 4
    everything = "".join(p.read_text() for p in (tmp_path / "first").rglob("*.json*"))
    assert "k-secret-7" not in everything
    assert "base64," not in everything
    monkeypatch.delenv("MY_KEY")
    _, again = run("again", "--replay", tmp_path / "first")
    assert list(map(outcome, again)) == list(map(outcome, value))
    assert not (tmp_path / "again" / "requests").exists()
    steps = [(tmp_path / name / "episodes").glob("*/steps.jsonl") for name in ("first", "again")]
    taken_names = [
        [
            json.loads(line)["raw"]
            for path in sorted(paths)
            for line in path.read_text().split("\n")[:2]
        ]
        for paths in steps
    ]
    assert taken_names[0] == taken_names[1] == ["pyautogui.click(70, 70)", "DONE"] * 2


def test_a_request_that_the_log_lacks_names_its_step_and_what_differs(tmp_path):
    with serving(model) as endpoint:
        run = Run(tmp_path, endpoint.url)
        _, value = run("first")
    log = tmp_path / "first" / "requests" / f"{value[1]['id']}.jsonl"
    first, second = log.read_text().splitlines()
    log.write_text(first + "\n" + second.replace('"sha256": "', '"sha256": "0', 1) + "\n")
    _, again = run("again", "--replay", tmp_path / "first", code=1)
    assert [record["status"] for record in again] == ["ok", "error"]
    assert "ReplayError" in again[1]["problem"]
    assert f"{log}: step 1 (act): this request is not in the log" in again[1]["problem"]
    log.write_text(first + "\n")
    _, again = run("third", "--replay", tmp_path / "first", code=1)
    assert "step 1 (act): the log has no further request" in again[1]["problem"]


def test_another_prompt_is_another_run(tmp_path):
    with serving(model) as endpoint:
        run = Run(tmp_path, endpoint.url)
        run("first")
    words = tmp_path / "words"
    words.mkdir()
    (words / "pyautogui.yaml").write_text("first: Press it! {instruction}")
    _, again = run("again", "--replay", tmp_path / "first", "--prompts", words, code=1)
    assert "they differ in the request.messages (the value)" in again[0]["problem"]


def test_a_failure_is_replayed_as_one(tmp_path):
    with serving(Raw(b'{"error": {"message": "no such model"}}', status=404)) as endpoint:
        run = Run(tmp_path, endpoint.url)
        _, value = run("first", code=1)
    assert "no such model" in value[0]["problem"]
    _, again = run("again", "--replay", tmp_path / "first" / "requests", code=1)
    assert [record["problem"] for record in again] == [record["problem"] for record in value]


def test_a_log_that_is_not_there(tmp_path):
    run = Run(tmp_path, "http://127.0.0.1:1")
    with pytest.raises(HijackError, match="no folder requests with the log of a run"):
        run("again", "--replay", tmp_path)


def test_a_run_stops_at_its_cost_and_goes_on_later(tmp_path):
    with serving(model) as endpoint:
        run = Run(tmp_path, endpoint.url, prices="{input: 1000, output: 1000}")
        output, value = run("run", "--max-cost", 1.5, code=1)
        assert len(value) == 1, "an episode costs 2.04 USD, and the one under way is finished"
        assert "the run has cost 2.0400 USD, and --max-cost is 1.5" in output
        output, value = run("run", "--max-cost", 1.5, "--resume", code=1)
        assert len(value) == 1
        output, value = run("run", "--max-cost", 3, "--resume")
        assert [record["score"] for record in value] == [1.0, 1.0]
        assert "models: 4 requests, 4000 tokens read, 80 written, 4.08 USD" in output


def test_a_run_stops_at_an_endpoint_that_does_not_count(tmp_path):
    answer = {"choices": [{"message": {"content": "```DONE```"}}], "usage": None}
    with serving(Raw(json.dumps(answer).encode())) as endpoint:
        run = Run(tmp_path, endpoint.url, prices="{input: 1, output: 1}")
        output, value = run("run", "--max-cost", 1, code=1)
    assert len(value) == 1
    assert f"cost (m at {endpoint.url}) is not known" in " ".join(output.split())


def test_what_costs_an_unknown_amount_cannot_be_limited(tmp_path):
    run = Run(tmp_path, "http://127.0.0.1:1")
    with pytest.raises(HijackError, match="does not say what m costs; add prices"):
        run("run", "--max-cost", 1)


def test_a_missing_key_is_told_before_the_first_episode(tmp_path, monkeypatch):
    monkeypatch.delenv("MY_KEY", raising=False)
    run = Run(tmp_path, "http://127.0.0.1:1", api_key_env="MY_KEY")
    with pytest.raises(HijackError, match=r"agent.yaml: m needs a key.* export MY_KEY=\.\.\."):
        run("run")
    assert not (tmp_path / "run").exists()


def test_options_for_models_want_one(tmp_path):
    run = Run(tmp_path, "http://127.0.0.1:1")
    with pytest.raises(HijackError, match="--max-cost is for agents of files"):
        run("run", "--max-cost", 1, agent="do_nothing")


def test_prompts_that_replace_nothing(tmp_path):
    run = Run(tmp_path, "http://127.0.0.1:1")
    words = tmp_path / "words"
    words.mkdir()
    with pytest.raises(HijackError, match="no folder with prompts"):
        run("run", "--prompts", words)
    (words / "pyautogu.yaml").write_text("first: x")
    with pytest.raises(
        HijackError, match=r"pyautogu\.yaml replaces no prompt of ours; did you mean"
    ):
        run("run", "--prompts", words)


def test_prompts_of_ui_tars_come_from_the_users_copy(tmp_path):
    run = Run(tmp_path, "http://127.0.0.1:1")
    with pytest.raises(HijackError, match=r"--prompts ui-tars: .*git clone .*bytedance/UI-TARS"):
        run("run", "--prompts", "ui-tars")
    copy = tmp_path / "prompts.py"
    copy.write_text("X = 1")
    with pytest.raises(HijackError, match="has none of UITARS_USR_PROMPT_THOUGHT, "):
        run("run", "--prompts", copy)
    copy.write_text("UITARS_SUMMARIZE_PROMPT = 'After {pyautogui}'")
    with pytest.raises(HijackError, match=r"the field \{pyautogui\}, which nothing fills in"):
        run("run", "--prompts", copy)
    # As in OSWorld's file and that of the paper's authors, with other words.
    copy.write_text(
        """raise SystemExit("this file is never run")
UITARS_CALL_USR_ACTION_SPACE = "\\ncall_user()\\n"
UITARS_NORMAL_ACTION_SPACE = "wait()"
UITARS_USR_PROMPT_THOUGHT = "Do:\\n\\n{action_space} in {language}\\n{instruction}\\n"
UITARS_SUMMARIZE_PROMPT = "After {response}: {instruction}"
UITARS_REMINDER_PROMPT = "Reminder: ..."
"""
    )
    folder = prompts_folder(copy)
    read = {path.stem: read_prompt(path.stem, (folder,)).first for path in folder.iterdir()}
    assert read == {
        "ui_tars": "Do:\n\n\ncall_user()\n in {language}\n{instruction}",
        "ui_tars_1.5": "Do:\n\nwait() in {language}\n{instruction}",
        "onlooker_summary": "After {action}: {instruction}",
        "onlooker_check": "Reminder: ...",
    }


@pytest.mark.parametrize(
    ("machines", "password"),
    [
        (None, "password"),
        (MachineSettings(vm=("aws",)), "osworld-public-evaluation"),
        (MachineSettings(vm=("docker",), options={"client_password": "s3cret"}), "s3cret"),
    ],
)
def test_a_model_is_told_the_password_of_its_machine(machines, password, tmp_path):
    """With a wrong one, no agent gets past a lock screen or sudo."""
    asked = []
    with serving(lambda body: asked.append(json.dumps(body)) or "```DONE```") as endpoint:
        run = Run(tmp_path, endpoint.url)
        name = AGENTS.find(str(run.agent))
        configuration = replace(
            override(load_bench("embedded_small"), agent=name), machines=machines
        )
        prepare(configuration, ModelOptions(), tmp_path)
        log = begin(name, "", "an-episode")
        agent = AGENTS.get(name)()
        agent.predict("Unlock it.", {"screenshot": np.zeros((40, 60, 3), np.uint8)})
    assert f"The password of this computer is '{password}'" in asked[0]
    logged = (tmp_path / "requests" / "an-episode.jsonl").read_text()
    assert log is not None
    assert ("s3cret" in asked[0], "s3cret" in logged) == (password == "s3cret", False)


def test_errors_of_the_user_that_the_check_would_not_be_asked_for_are_refused(tmp_path):
    """As under the prompts of the paper's authors, which name two errors."""
    (tmp_path / "errors.yaml").write_text("errors: [{name: Fire, looks: flames, say: Run.}]")
    copy = tmp_path / "prompts.py"
    copy.write_text("UITARS_REMINDER_PROMPT = 'Is it locked? Reminder: ...'")
    run = Run(tmp_path, "http://127.0.0.1:1", "onlooker: {errors: errors.yaml}")
    with pytest.raises(HijackError, match=r"onlooker\.errors would not be asked for"):
        run("run", "--prompts", copy)
    maker = agent_file_maker(str(file(tmp_path, "http://127.0.0.1:1", "onlooker: {}")))
    maker.run = ChatRun(prompts=prompts_folder(copy))
    maker.check_errors()


def test_a_run_goes_on_only_with_the_same_file_and_prompts(tmp_path):
    words = tmp_path / "words"
    words.mkdir()
    (words / "pyautogui.yaml").write_text("first: Press it! {instruction}")
    with serving(model) as endpoint:
        run = Run(tmp_path, endpoint.url)
        run("run", "--prompts", words)
        (words / "pyautogui.yaml").write_text("first: Press it, please! {instruction}")
        with pytest.raises(HijackError, match=r"another run: code\.\S*prompts_sha256 was"):
            run("run", "--prompts", words, "--resume")
        run("other")
        run.agent.write_text(run.agent.read_text() + "history: 3\n")
        with pytest.raises(HijackError, match=r"another run: code\.\S*sha256 was"):
            run("other", "--resume")


def test_an_episode_that_is_run_again_replaces_its_log(tmp_path):
    with serving(model) as endpoint:
        run = Run(tmp_path, endpoint.url)
        _, value = run("run")
        path = tmp_path / "run" / "records.jsonl"
        path.write_bytes(path.read_bytes().splitlines(keepends=True)[0])
        os.remove(tmp_path / "run" / "episodes" / value[1]["id"] / "episode.json")
        run("run", "--resume")
    assert [len(log) for log in lines(tmp_path / "run").values()] == [2, 2]


def test_a_list_of_episodes_needs_no_key_and_no_log(tmp_path, monkeypatch):
    monkeypatch.delenv("MY_KEY", raising=False)
    run = Run(tmp_path, "http://127.0.0.1:1", api_key_env="MY_KEY")
    words = [str(tmp_path / "bench.yaml"), "--agent", str(run.agent), "--dry-run"]
    assert CliRunner().invoke(bench, words).exit_code == 0


def test_a_client_that_is_not_installed_names_the_extra(tmp_path, monkeypatch):
    run = Run(tmp_path, "http://127.0.0.1:1")
    monkeypatch.setattr("hijack_data.extras._is_importable", lambda name: name != "openai")
    with pytest.raises(MissingDependencyError, match=r"needs openai: pip install .*\[agents\]"):
        run("run")
    assert not (tmp_path / "run").exists()
