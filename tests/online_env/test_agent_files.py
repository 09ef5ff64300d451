"""Agent files: what they may say, every mistake with its place, and those that are shipped."""

import pytest
import yaml

from hijack_data.errors import ConfigError, ParameterError, UnknownNameError

pytest.importorskip("gymnasium", reason="needs the extra [online]")
pytest.importorskip("openai", reason="needs the extra [agents]")

from online_env.agents import agent_files
from online_env.agents.chat import prompts
from online_env.agents.registry import AGENTS, make
from online_env.agents.settings import SamplingSettings
from online_env.bench.config import load_bench, override
from online_env.errors import AgentSetupError
from online_env.report.ablations import MODULES, ONLOOKERS

from support.chatting import file

BASELINES = {
    "qwen2.5-vl-72b",
    "llama-3.2-90b-vision",
    "glm-4.5v",
    "gemini-2.5-pro",
    "gpt-4o",
    "claude-3.7-sonnet",
    "ui-tars-7b-dpo",
    "ui-tars-72b-dpo",
    "ui-tars-1.5-7b",
}


@pytest.fixture(autouse=True)
def _agents_as_before():
    before = dict(AGENTS.entries)
    yield
    AGENTS.entries.clear()
    AGENTS.entries.update(before)


def mistakes(path):
    with pytest.raises(ConfigError) as caught:
        agent_files.read_agent(str(path))
    return [problem.removeprefix(f"{path}:") for problem in caught.value.problems]


def test_every_shipped_file_can_be_read_and_says_how_it_is_served():
    assert set(agent_files.packaged()) > BASELINES
    for name in agent_files.packaged():
        settings = agent_files.read_agent(name)
        source, data = agent_files.read_config(f"agents/{name}")
        local = settings.model.base_url is not None and "127.0.0.1" in settings.model.base_url
        assert source == settings.source
        assert ("serve" in yaml.safe_load(data)) is local
        assert local or settings.model.api_key_env, "an API of somebody else's wants a key"


@pytest.mark.parametrize("name", sorted(BASELINES))
def test_the_papers_baselines_are_as_the_paper_has_them(name):
    settings = agent_files.read_agent(name)
    assert settings.model.sampling == SamplingSettings(temperature=0.6, top_p=0.9, max_tokens=1500)
    assert settings.history == 15
    assert settings.onlooker is None
    talks = "ui_tars" if "tars" in name else "pyautogui"
    assert settings.parser.removesuffix("_1.5") == settings.prompt.removesuffix("_1.5") == talks


def test_the_ablations_switch_one_module_each():
    def modules(name):
        onlooker = agent_files.read_agent(f"agenthijack-agent{name}").onlooker
        return onlooker.check, onlooker.summarise

    assert modules("") == modules("-no-rl") == (True, True)
    assert modules("-no-check") == (False, True)
    assert modules("-no-summary") == (True, False)
    assert modules("-no-onlooker") == (False, False)
    agent_spec = agent_files.read_agent("agenthijack-agent")
    assert agent_spec.onlooker.model == agent_spec.model
    second = agent_files.read_agent("agenthijack-agent-onlooker-qwen3-vl-235b")
    assert second.model == agent_spec.model
    assert second.onlooker.model.model == "Qwen/Qwen3-VL-235B-A22B-Instruct"
    assert second.onlooker.model.base_url != second.model.base_url
    assert second.onlooker.model.sampling == second.model.sampling
    assert [error.name for error in second.onlooker.errors] == [
        "The screen is locked",
        "The network is down",
    ]


@pytest.mark.parametrize("variants", [MODULES["agenthijack-agent"], ONLOOKERS["agenthijack-agent"]])
def test_the_models_of_a_figure_can_be_served_at_once(variants):
    models = {}
    for name in variants:
        settings = agent_files.read_agent(name)
        for model in (settings.model, settings.onlooker.model):
            assert models.setdefault(model.base_url, model.model) == model.model


def test_all_mistakes_at_once_each_with_its_place(tmp_path):
    path = tmp_path / "a.yaml"
    path.write_text(
        """\
model: 5
client: openia
base_url: http://127.0.0.1:1
api_key_env: sk-secret-0123
prompt: pyautogiu
parser: ui_tarz
history: -1
sampling: {temperature: hot, top_k: 3}
prices: {input: 1}
retires: 3
onlooker: {chek: true, errors: nowhere.yaml}
"""
    )
    result = mistakes(path)
    assert [problem.split(": ")[0] for problem in result] == [
        "1:8",
        "2:9",
        "4:14",
        "5:9",
        "6:9",
        "7:10",
        "8:25",
        "8:30",
        "9:9",
        "10:1",
        "11:12",
        "11:32",
    ]
    text = "\n".join(result)
    assert "secret" not in text, "what may be a key is never shown"
    assert "did you mean 'openai'" in text
    assert "did you mean 'pyautogui'" in text
    assert "did you mean 'ui_tars'" in text
    assert "did you mean 'retries'" in text
    assert "did you mean 'check'" in text
    assert "prices.output is missing" in text


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("", "1:1: this file is a mapping"),
        ("- a", "1:1: this file is a mapping"),
        ("model: m", "1:1: prompt is missing"),
        ("model: m\nprompt: openai\nparser: openai", "3:1: parser openai reads the tool of"),
        (
            "model: m\nprompt: openai\nparser: pyautogui\nclient: openai_computer",
            "3:1: client openai_computer needs parser: openai",
        ),
        (
            "model: m\nprompt: anthropic\nparser: anthropic\nclient: anthropic\ntool: computer",
            "5:1: unknown tool 'computer'",
        ),
        ("model: m\nprompt: pyautogui\nparser: pyautogui\ntool: computer", "4:1: unknown tool"),
        (
            "model: m\nprompt: ui_tars\nparser: ui_tars\ncoordinates: resized",
            "4:1: coordinates goes with parser: pyautogui",
        ),
        (
            "model: m\nclient: anthropic\nprompt: anthropic\nparser: anthropic\nonlooker: {}",
            "5:11: onlooker.summarise cannot replace",
        ),
        ("model: m\nprompt: pyautogui\nparser: pyautogui\nprompts: none", "4:10:"),
        ("model: m\nprompt: openai\nparser: pyautogui\nonlooker: {tool: computer}", "4:12:"),
        (
            "model: m\nprompt: openai\nparser: pyautogui\nonlooker: {client: openai_computer}",
            "4:20: onlooker.client must be one of openai, anthropic",
        ),
        ("model: m\nprompt: pyautogui\nparser: pyautogui\nrequest: 1", "4:10: request must be"),
        ("model: m\nprompt: pyautogui\nparser: pyautogui\nrequest: {stream: true}", "4:11:"),
        ("model: m\nprompt: pyautogui\nparser: pyautogui\nbase_url: localhost:1", "4:11: base_u"),
        ("model: m\nprompt: pyautogui\nparser: pyautogui\nbase_url: http://u:p@h/", "4:11: base_u"),
    ],
)
def test_a_file_that_makes_no_sense(tmp_path, text, problem):
    path = tmp_path / "a.yaml"
    path.write_text(text)
    assert any(mistake.startswith(problem) for mistake in mistakes(path)), mistakes(path)


def test_paths_in_a_file_are_relative_to_it(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    home = tmp_path / "deep"
    (home / "words").mkdir(parents=True)
    (home / "words" / "mine.yaml").write_text("first: Do {instruction}!")
    (home / "errors.yaml").write_text("errors: [{name: Fire, looks: flames, say: Run.}]")
    text = "prompts: words\nonlooker: {errors: errors.yaml}"
    path = file(home, "http://127.0.0.1:1", text, prompt="mine")
    settings = agent_files.read_agent(str(path.relative_to(tmp_path)))
    assert settings.onlooker.errors[0].say == "Run."
    prompt = prompts.read_prompt("mine", (settings.prompts,))
    assert prompt.fill({"instruction": "{width} it", "width": 5}).first == "Do {width} it!"
    before = settings.sha256
    (home / "errors.yaml").write_text("errors: [{name: Fire, looks: flames, say: Go.}]")
    assert agent_files.read_agent(str(path)).sha256 != before, "the errors are part of the agent"


@pytest.mark.parametrize(
    "text", ["errors: []", "errors: [{name: a, looks: b}]", "[]", "errors: [{nam: a}]", "e: 1"]
)
def test_a_repository_of_errors_with_mistakes(tmp_path, text):
    (tmp_path / "e.yaml").write_text(text)
    path = file(tmp_path, "http://127.0.0.1:1", "onlooker: {errors: e.yaml}")
    assert "e.yaml" in "".join(mistakes(path))


def test_a_prompt_with_mistakes(tmp_path):
    (tmp_path / "p.yaml").write_text("system: 5\nfrist: x\n")
    with pytest.raises(ConfigError) as caught:
        prompts.read_prompt("p", (tmp_path,))
    assert [problem.rpartition("p.yaml:")[2][:3] for problem in caught.value.problems] == [
        "1:9",
        "2:1",
    ]
    with pytest.raises(UnknownNameError, match="did you mean 'pyautogui'"):
        prompts.read_prompt("pyautogu")


# In a benchmark


def test_a_benchmark_finds_files_and_keeps_their_digest(tmp_path):
    path = file(tmp_path, "http://127.0.0.1:1")
    bench = override(load_bench("embedded_small"), f"{path},gpt-4o,oracle")
    assert bench.agents == (str(path), "gpt-4o", "oracle")
    code = bench.to_data()["code"]
    assert code[str(path)] == {
        "path": str(path),
        "sha256": agent_files.read_agent(str(path)).sha256,
    }
    assert code["gpt-4o"]["path"] == "agents/gpt-4o"
    assert "oracle" not in code


def test_a_benchmark_file_names_them_too(tmp_path):
    path = file(tmp_path, "http://127.0.0.1:1")
    (tmp_path / "b.yaml").write_text(f"agents: [{path}, ui-tars-1.5-7b]")
    assert load_bench(tmp_path / "b.yaml").agents == (str(path), "ui-tars-1.5-7b")
    path.write_text("model: m\nparser: ui_tarz\nprompt: pyautogui")
    AGENTS.entries.pop(str(path))
    with pytest.raises(ConfigError, match=r"b.yaml:1:10: agents\[0\]: .*agent.yaml:2:9: parser"):
        load_bench(tmp_path / "b.yaml")
    with pytest.raises(ConfigError, match=r"^\S*agent.yaml:2:9: parser must be one of"):
        override(load_bench("embedded_small"), str(path))


def test_a_name_that_is_nearly_right_is_suggested(tmp_path):
    with pytest.raises(UnknownNameError, match="--agent: no 'gpt-4'; did you mean 'gpt-4o'"):
        override(load_bench("embedded_small"), "gpt-4")
    with pytest.raises(ConfigError, match="no such file"):
        override(load_bench("embedded_small"), "nowhere.yaml")
    with pytest.raises(ParameterError, match="twice"):
        override(load_bench("embedded_small"), "gpt-4o,gpt-4o")


def test_a_path_wins_over_a_packaged_name(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    file(tmp_path, "http://127.0.0.1:1").rename("gpt-4o")
    assert agent_files.read_agent("gpt-4o").model.model == "m"


def test_a_key_that_is_not_set_is_named(monkeypatch):
    monkeypatch.delenv("OPENAI_API_KEY", raising=False)
    with pytest.raises(AgentSetupError, match="OPENAI_API_KEY is not set"):
        make("gpt-4o")


# Values that no field checks alone


@pytest.mark.parametrize(
    ("line", "problem"),
    [
        ("base_url: 'http://[::1:8000/v1'", "1:11: base_url is an address such as http://127."),
        ("base_url: 'http://[host]/v1'", "1:11: base_url is an address such as http://127."),
        ("base_url: 'http://h:99999/v1'", "1:11: base_url is an address such as http://127."),
        ("base_url: 'http://h:x/v1'", "1:11: base_url is an address such as http://127."),
        ("base_url: 'http://:80/v1'", "1:11: base_url is an address such as http://127."),
        ("min_pixels: 1000000\nmax_pixels: 1000", "1:1: min_pixels (1000000) must not be above"),
        ("min_pixels: 67108864", "1:1: min_pixels (67108864) must not be above max_pixels (12845"),
        ("max_pixels: 784", "1:1: min_pixels (3136) must not be above max_pixels (784)"),
        ("serve: ' '", "1:8: serve must not be empty"),
        ("onlooker: {model: ''}", "1:19: onlooker.model must not be empty"),
    ],
)
def test_a_value_that_no_request_can_use(tmp_path, line, problem):
    path = tmp_path / "a.yaml"
    path.write_text(f"{line}\nmodel: m\nprompt: pyautogui\nparser: pyautogui\n")
    (value,) = mistakes(path)
    assert value.startswith(problem)


@pytest.mark.parametrize("url", ["http://[::1]:8000/v1", "https://h", "http://h:65535/a?b=c"])
def test_addresses_of_any_kind_of_host(tmp_path, url):
    assert agent_files.read_agent(str(file(tmp_path, f"'{url}'"))).model.base_url == url


def test_an_error_that_has_nothing_to_say_is_refused(tmp_path):
    (tmp_path / "e.yaml").write_text("errors: [{name: a, looks: b, say: ''}]")
    with pytest.raises(ConfigError, match=r"e\.yaml:1:35: errors\[0\]\.say must not be empty"):
        agent_files.read_errors(str(tmp_path / "e.yaml"))


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"", "1:1: a prompt is a mapping of system, first, each to texts"),
        (b"{}", "1:1: a prompt is a mapping of system, first, each to texts"),
        (b"- first", "1:1: a prompt is a mapping of system, first, each to texts"),
        (b"first: [a]", "1:8: first must be a text, got a list"),
        (b"frist: a", "1:1: a prompt has no key 'frist'; did you mean 'first'?"),
        (b"first: Do {instructions}.", "1:1: no text of the prompt has the field {instruction}"),
        (b"first: " + b"x" * 2**18, "1:1: larger than 262144 bytes; is it a prompt?"),
    ],
)
def test_a_prompt_that_is_none(tmp_path, content, said):
    (tmp_path / "p.yaml").write_bytes(content)
    with pytest.raises(ConfigError) as caught:
        prompts.read_prompt("p", (tmp_path,))
    (problem,) = caught.value.problems
    assert problem.startswith(f"{tmp_path / 'p.yaml'}:{said}")


def test_of_two_folders_the_first_has_the_prompt_and_the_rest_is_ours(tmp_path):
    value, two = tmp_path / "one", tmp_path / "two"
    for folder, names in ((value, ["mine"]), (two, ["mine", "theirs"])):
        folder.mkdir()
        for name in names:
            (folder / f"{name}.yaml").write_text(f"first: {name} of {folder.name}{{instruction}}\n")
    paths = (value, two)
    assert prompts.read_prompt("mine", paths).first == "mine of one{instruction}"
    assert prompts.read_prompt("theirs", paths).first == "theirs of two{instruction}"
    assert prompts.read_prompt("pyautogui", paths) == prompts.read_prompt("pyautogui")


def test_the_digest_of_prompts_changes_with_names_and_with_texts(tmp_path):
    def digest(**contents):
        for path in tmp_path.iterdir():
            path.unlink()
        for name, content in contents.items():
            (tmp_path / f"{name}.yaml").write_text(content)
        (tmp_path / "notes.txt").write_text(str(contents))
        return prompts.digest(tmp_path)

    first = digest(a="x", b="y")
    assert digest(b="y", a="x") == first
    remaining = [digest(a="xy", b=""), digest(a="y", b="x"), digest(a="x"), digest(a="x", c="y")]
    assert len({first, *remaining}) == 5
