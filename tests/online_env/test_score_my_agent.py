"""docs/score_my_agent.md: each of its files plays an episode, against an endpoint where it wants one.

What has its own page of packages is tried where it is installed: `gui-agents` and `cua-agent` pin
what others need newer, so each has an environment of its own.
"""

import re

import pytest

pytest.importorskip("gymnasium", reason="needs the extra [online]")
pytest.importorskip("lxml", reason="needs the extra [online]")

from online_env.agents.registry import AGENTS
from online_env.bench.episodes import play

from support.docs import ROOT, blocks_of
from support.seeing_endpoint import serve
from support.squares import JOB, SIZE, register_square, square_env

PAGE = ROOT / "docs" / "score_my_agent.md"
pytestmark = pytest.mark.usefixtures("no_waiting")


@pytest.fixture
def endpoint(monkeypatch):
    register_square(monkeypatch)
    with serve() as result:
        for name in ("OPENAI", "ANTHROPIC"):
            monkeypatch.setenv(f"{name}_API_KEY", "none")
        for name in ("OPENAI_BASE_URL", "OPENAI_API_BASE"):
            monkeypatch.setenv(name, f"{result.url}/v1")
        for name in ("ANTHROPIC_BASE_URL", "ANTHROPIC_API_BASE"):
            monkeypatch.setenv(name, result.url)
        yield result


def file_of(section):
    """The Python block of a section."""
    text = PAGE.read_text()
    start = text.index(f"\n## {section}\n")
    number = len(re.findall(r"^```", text[:start], re.M)) // 2
    return next(block for block in blocks_of(PAGE)[number:] if block.language == "python").text


def play_section(section, folder, max_steps=5, edit=lambda code: code):
    """The record of an episode that the agent of a section plays, and its desktop."""
    file = folder / "my_agent.py"
    file.write_text(edit(file_of(section)))
    agent = AGENTS.get(AGENTS.find(f"{file}:MyAgent"))()
    env, desktop = square_env(max_steps=max_steps)
    record = play(env, agent, JOB, 0, None)
    reset = getattr(agent, "reset", None)
    if reset is not None:
        reset()
    return record, desktop


@pytest.mark.parametrize(
    ("section", "package", "requests"),
    [
        ("A Python class", "numpy", 0),
        ("OSWorld's mm_agents", "PIL", 0),
        ("A loop around Anthropic's API", "anthropic", 2),
        ("A loop around OpenAI's API", "openai", 2),
    ],
)
def test_the_agent_of_a_section_does_the_task(section, package, requests, endpoint, tmp_path):
    pytest.importorskip(package, reason=f"needs the package {package}")
    record, desktop = play_section(section, tmp_path)
    assert (record["status"], record["score"]) == ("ok", 1.0), record["problem"]
    assert (record["steps"], record["ended"], len(desktop.ran)) == (2, "agent", 1)
    assert len(endpoint.requests) == requests
    assert {size for sizes in endpoint.pictures for size in sizes} <= {SIZE}
    text = str(endpoint.requests)
    assert not [word for word in ("square-3", "clean", "accessib", "corrupt") if word in text]


@pytest.mark.parametrize("section", ["A loop around Anthropic's API", "A loop around OpenAI's API"])
def test_a_loop_that_never_ends_is_ended_by_the_limit(section, endpoint, tmp_path):
    pytest.importorskip("anthropic" if "Anthropic" in section else "openai")
    endpoint.never_done = True
    record, _ = play_section(section, tmp_path, max_steps=3)
    assert (record["status"], record["ended"], record["steps"]) == ("ok", "max_steps", 3)
    assert len(endpoint.requests) == 3


def test_anthropics_toolset_is_read_as_the_page_says(endpoint, tmp_path):
    pytest.importorskip("anthropic")

    def edit(code):
        code = code.replace('"computer_20251124"', '"computer_toolset_20260801"')
        old, new = "computer.act(call.input,", "computer.act({'action': call.name, **call.input},"
        assert old in code
        return code.replace(old, new)

    record, _ = play_section("A loop around Anthropic's API", tmp_path, edit=edit)
    assert record["score"] == 1.0


@pytest.mark.filterwarnings("ignore")
def test_agent_s3(endpoint, tmp_path):
    pytest.importorskip("gui_agents", reason="needs the extra [agent-s]", exc_type=ImportError)
    record, _ = play_section("Agent S3", tmp_path)
    assert (record["status"], record["score"]) == ("ok", 1.0), record["problem"]
    assert (record["malformed"], record["last_action"]) == (0, "DONE")


@pytest.mark.filterwarnings("ignore")
def test_actions_of_agent_s3_pass_the_guard(endpoint, tmp_path):
    pytest.importorskip("gui_agents", reason="needs the extra [agent-s]", exc_type=ImportError)
    from hijack_data.actions import read_action

    file = tmp_path / "my_agent.py"
    file.write_text(file_of("Agent S3"))
    agent = AGENTS.get(AGENTS.find(f"{file}:MyAgent"))()
    env, _ = square_env()
    obs, _ = env.reset(seed=3)
    from hijack_data.picture_io import encode_png

    aci = agent._aci
    aci.assign_screenshot({"screenshot": encode_png(obs["screenshot"])})
    for code in (
        aci.type("the dark square", "Grüße", overwrite=True, enter=True),
        aci.type(text="a"),
        aci.switch_applications("x"),
        aci.click("the dark square", 2, "left", ["ctrl"]),
        aci.scroll("the dark square", 3, True),
        aci.drag_and_drop("the dark square", "the dark square"),
        aci.hotkey(["ctrl", "s"]),
        aci.hold_and_press(["ctrl"], ["a"]),
        aci.open("mousepad"),
        aci.wait(1.0),
    ):
        assert read_action(code).kind == "code", code
    assert "call_code_agent" not in str(endpoint.requests)


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("model", ["anthropic/claude-sonnet-4-6", "openai/computer-use-preview"])
def test_cua_agent(model, endpoint, tmp_path):
    pytest.importorskip("cua_agent", reason="needs the extra [cua]", exc_type=ImportError)

    def edit(code):
        return code.replace("anthropic/claude-sonnet-4-6", model)

    record, desktop = play_section("cua-agent", tmp_path, edit=edit)
    assert (record["status"], record["score"]) == ("ok", 1.0), record["problem"]
    assert len(desktop.ran) == 1
    endpoint.never_done = True
    (tmp_path / "endless").mkdir()
    record, _ = play_section("cua-agent", tmp_path / "endless", max_steps=3, edit=edit)
    assert (record["ended"], record["steps"]) == ("max_steps", 3)


@pytest.mark.filterwarnings("ignore")
def test_a_cua_agent_that_touches_nothing_fails(endpoint, tmp_path):
    pytest.importorskip("cua_agent", reason="needs the extra [cua]", exc_type=ImportError)
    endpoint.unknown_tool = True

    def edit(code):
        return code.replace("anthropic/claude-sonnet-4-6", "openai/gpt-5.4")

    record, _ = play_section("cua-agent", tmp_path, edit=edit)
    assert record["status"] == "error"
    assert "5 turns without touching the computer" in record["problem"]
    assert len(endpoint.requests) < 12
