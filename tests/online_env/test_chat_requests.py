"""What a chat agent sends to each API, seen by a real HTTP server."""

import json

import numpy as np
import pytest

pytest.importorskip("gymnasium", reason="needs the extra [online]")
pytest.importorskip("openai", reason="needs the extra [agents]")
pytest.importorskip("anthropic", reason="needs the extra [agents]")

from online_env.agents.chat.run import ChatRun

from support.chatting import SIZE, agent_of, picture
from support.endpoints import Call, serving
from support.reading_requests import LENGTH, decode_data_url, outline

CLICK = "I see.\n```python\npyautogui.click(1, 2)\n```"
DONE = "```DONE```"


def play(agent, steps, instruction="do it"):
    return [agent.predict(instruction, picture(shade)) for shade in range(steps)]


def test_a_conversation_in_text(tmp_path):
    with serving(CLICK) as endpoint:
        agent = agent_of(tmp_path, endpoint.url, history=2)
        assert play(agent, 4) == [(CLICK, ["pyautogui.click(1, 2)"])] * 4
    output = CLICK[:LENGTH]
    value = "The screen now. What is the next action?"[:LENGTH]
    left_out = "(An older screenshot, left out.)"
    body = dict(endpoint.asked[3])
    assert outline(body.pop("messages")) == [
        ("system", ["You operate a desktop computer to"[:LENGTH]]),
        ("user", ["Task: do it", value, left_out]),
        ("assistant", [output]),
        ("user", [value, 1]),
        ("assistant", [output]),
        ("user", [value, 2]),
        ("assistant", [output]),
        ("user", [value, 3]),
    ]
    assert body == {"model": "m", "temperature": 0.6, "top_p": 0.9, "max_tokens": 1500}
    assert endpoint.pictures == [1, 2, 3, 3]


def test_the_picture_arrives_as_it_was(tmp_path):
    noise = np.random.default_rng(0).integers(0, 256, (*SIZE, 3), dtype=np.uint8)
    with serving(DONE) as endpoint:
        agent_of(tmp_path, endpoint.url).predict("do it", {"screenshot": noise})
    part = endpoint.asked[0]["messages"][-1]["content"][-1]
    np.testing.assert_array_equal(decode_data_url(part["image_url"]["url"]), noise)


def test_what_a_file_says_about_sampling_and_fields(tmp_path):
    text = "sampling: {temperature: null, top_p: null, max_tokens: null}\nrequest: {seed: 5}"
    with serving(DONE) as endpoint:
        play(agent_of(tmp_path, endpoint.url, text), 1)
    assert endpoint.asked[0].keys() == {"model", "messages", "seed"}


def test_the_key_is_that_of_the_environment(tmp_path, monkeypatch):
    monkeypatch.setenv("MY_KEY", "k-123")
    with serving(DONE) as endpoint:
        play(agent_of(tmp_path, endpoint.url, api_key_env="MY_KEY"), 1)
        url = endpoint.url.removesuffix("/v1")
        play(agent_of(tmp_path, url, api_key_env="MY_KEY", client="anthropic"), 1)
    assert endpoint.headers[0]["authorization"] == "Bearer k-123"
    key_headers = {endpoint.headers[1].get(name) for name in ("x-api-key", "authorization")}
    assert key_headers & {"k-123", "Bearer k-123"}, (
        "one header or the other, as the client's version has it"
    )


def test_messages_in_text(tmp_path):
    with serving(CLICK, "", DONE) as endpoint:
        url = endpoint.url.removesuffix("/v1")
        agent = agent_of(tmp_path, url, client="anthropic", history=1)
        assert play(agent, 3) == [(CLICK, ["pyautogui.click(1, 2)"]), ("", [""]), (DONE, ["DONE"])]
    body = endpoint.asked[2]
    value = "The screen now. What is the next action?"[:LENGTH]
    assert outline(body["messages"]) == [
        ("user", ["Task: do it", value, "(An older screenshot, left out.)"]),
        ("assistant", [CLICK[:LENGTH]]),
        ("user", [value, 1]),
        ("assistant", ["(nothing)"]),
        ("user", [value, 2]),
    ]
    assert body["system"].startswith("You operate")
    assert "tools" not in body


@pytest.mark.parametrize(
    ("tool", "call", "beta"),
    [
        (
            "computer_20250124",
            Call("computer", {"action": "left_click", "coordinate": [3, 4]}),
            "computer-use-2025-01-24",
        ),
        (
            "computer_20251124",
            Call("computer", {"action": "left_click", "coordinate": [3, 4]}),
            "computer-use-2025-11-24",
        ),
        ("computer_toolset_20260801", Call("left_click", {"coordinate": [3, 4]}), None),
    ],
)
def test_anthropics_computer_tool(tmp_path, tool, call, beta):
    wait = Call(call.name, {"action": "wait", "duration": 1})
    if call.name != "computer":
        wait = Call("wait", {"duration": 1})
    keys = {"client": "anthropic", "prompt": "anthropic", "parser": "anthropic", "tool": tool}
    with serving(("Look.", call, wait), "I give up: FAIL") as endpoint:
        agent = agent_of(tmp_path, endpoint.url.removesuffix("/v1"), **keys)
        (_, first), (_, second) = play(agent, 2)
    assert (first, second) == (["pyautogui.click(3, 4)", "WAIT"], ["FAIL"])
    assert endpoint.headers[0].get("anthropic-beta") == beta
    body = endpoint.asked[1]
    [offered] = body["tools"]
    size = {"name": "computer", "display_width_px": 96, "display_height_px": 54}
    assert offered == {"type": tool, **(size if beta else {})}
    assert outline(body["messages"]) == [
        ("user", ["Task: do it", 0]),
        ("assistant", ["Look.", "toolu_1", "toolu_2"]),
        ("user", [["toolu_1", "Done."], ["toolu_2", 1]]),
    ]


@pytest.mark.parametrize("tool", ["computer", "computer_use_preview"])
def test_openais_computer_tool(tmp_path, tool):
    click = {"type": "click", "x": 1, "y": 2, "button": "left"}
    call = Call("computer", [click, {"type": "wait"}] if tool == "computer" else click)
    keys = {"client": "openai_computer", "prompt": "openai", "parser": "openai", "tool": tool}
    with serving(call, call, "The task is DONE") as endpoint:
        rollouts = play(agent_of(tmp_path, endpoint.url, **keys), 3)
    expected = ["pyautogui.click(1, 2)", "WAIT"][: 2 if tool == "computer" else 1]
    assert [actions for _, actions in rollouts] == [expected, expected, ["DONE"]]
    first, second, _ = endpoint.asked
    assert first["tools"][0]["type"] == tool
    assert ("display_width" in first["tools"][0]) is (tool != "computer")
    [message] = first["input"]
    assert [part["type"] for part in message["content"]] == ["input_text", "input_image"]
    assert "previous_response_id" not in first
    assert second["previous_response_id"] == "resp_1"
    [output] = second["input"]
    assert (output["type"], output["call_id"]) == ("computer_call_output", "call_0")
    assert decode_data_url(output["output"]["image_url"])[0, 0, 0] == 1
    assert output["acknowledged_safety_checks"] == [{"id": "s1", "code": "c", "message": "m"}]


def test_a_prompt_says_in_which_pixels_the_model_points(tmp_path):
    keys = {"prompt": "qwen2.5_vl", "parser": "qwen2.5_vl"}
    with serving("?") as endpoint:
        agent = agent_of(tmp_path, endpoint.url, **keys)
        agent.predict("do it", picture(size=(1080, 1920)))
    assert "resolution is 1932x1092" in json.dumps(endpoint.asked[0])


def test_prompts_of_a_folder_come_first(tmp_path):
    words = tmp_path / "words"
    words.mkdir()
    (words / "pyautogui.yaml").write_text("first: |\n  Mine: {instruction} {unknown} {width}\n")
    with serving(DONE) as endpoint:
        play(agent_of(tmp_path, endpoint.url, run=ChatRun(prompts=words)), 1)
    [message] = endpoint.asked[0]["messages"]
    assert message["content"][0]["text"] == "Mine: do it {unknown} 96"


def test_tokens_and_money_are_counted_a_step_and_in_all(tmp_path):
    with serving(CLICK) as endpoint:
        agent = agent_of(tmp_path, endpoint.url, prices="{input: 2.5, output: 10}")
        play(agent, 2)
    value = 1000 * 2.5e-6 + 20 * 10e-6
    usage = agent.usage
    assert [step["usd"] for step in usage["steps"]] == pytest.approx([value, value])
    assert usage["usd"] == pytest.approx(2 * value)
    assert (usage["requests"], usage["input_tokens"], usage["output_tokens"]) == (2, 2000, 40)
    with serving(CLICK) as endpoint:
        agent = agent_of(tmp_path, endpoint.url)
        play(agent, 1)
    assert agent.usage["usd"] is None, "an unknown price is not zero"


def test_a_new_episode_begins_without_the_last_one(tmp_path):
    with serving(CLICK) as endpoint:
        agent = agent_of(tmp_path, endpoint.url)
        play(agent, 2)
        agent.reset()
        play(agent, 1)
    assert endpoint.pictures == [1, 2, 1]


def test_a_megabyte_is_not_sent_back(tmp_path):
    with serving("x" * 1_000_000, DONE) as endpoint:
        (_, first), _ = play(agent_of(tmp_path, endpoint.url), 2)
    assert len(json.dumps(endpoint.asked[1])) < 60_000
    assert len(first[0]) == 1_000_000
