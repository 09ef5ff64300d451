"""Endpoints that fail and models that talk nonsense: each has an outcome, and none ends a run."""

import json
import traceback
from types import SimpleNamespace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hijack_data.actions import DIALECTS, read_action
from hijack_data.errors import ActionError

pytest.importorskip("gymnasium", reason="needs the extra [online]")
pytest.importorskip("openai", reason="needs the extra [agents]")
pytest.importorskip("anthropic", reason="needs the extra [agents]")

from online_env.agents.chat.endpoint import RetryWaits
from online_env.agents.chat.parsing import ReplyParser
from online_env.agents.chat.query import Reply
from online_env.agents.chat.request_log import RequestLog
from online_env.agents.chat.run import ChatRun
from online_env.agents.settings import COORDINATES
from online_env.bench.episodes import play
from online_env.bench.jobs import Job
from online_env.errors import EndpointError
from online_env.report.notes import fraction_note

from support.chatting import SIZE, agent_of, picture
from support.endpoints import Call, Raw, Refusal, chat, messages, serving
from support.episodes import make as make_env

pytestmark = pytest.mark.usefixtures("no_waiting")
JOB = Job("agent", "t", "clean", 0)
GOOD = "```python\npyautogui.click(1, 2)\n```"
CLICK = ["pyautogui.click(1, 2)"]
CUT = json.dumps(chat(GOOD)).encode()[:-40]


def ask(agent):
    return agent.predict("do it", picture())[1]


# On the way: tried again, or an error that says what to do


@pytest.mark.parametrize(
    "failure",
    [
        Raw(status=429),
        Raw(status=429, headers={"retry-after": "3600"}),
        Raw(status=500),
        Raw(status=503, body=b"<html>"),
        Raw(status=408),
        Raw(CUT),
        Raw(b""),
        Raw(b"[1, 2]"),
        Raw(b'{"choices": []}'),
        Raw(b'{"choices": [{"message": "hello"}]}'),
        Raw(b'{"error": {"message": "overloaded"}}'),
    ],
)
def test_what_may_pass_is_tried_again(tmp_path, failure):
    with serving(failure, failure, GOOD) as endpoint:
        agent = agent_of(tmp_path, endpoint.url)
        assert ask(agent) == CLICK
    assert len(endpoint.asked) == 3
    assert (agent.usage["requests"], agent.usage["retries"]) == (1, 2)


@pytest.mark.parametrize(
    ("failure", "problem"),
    [
        (Raw(status=500), "InternalServerError"),
        (Raw(CUT), "not whole JSON"),
        (Raw(b'{"choices": []}'), "has no message"),
    ],
)
def test_what_does_not_pass_is_an_error_in_the_end(tmp_path, failure, problem):
    with serving(failure) as endpoint:
        agent = agent_of(tmp_path, endpoint.url)
        with pytest.raises(EndpointError, match=rf"{problem}.*\(tried 3 times\)"):
            ask(agent)
    assert len(endpoint.asked) == 3


@pytest.mark.parametrize("status", [400, 404, 413, 422])
def test_a_request_that_is_refused_is_not_sent_again(tmp_path, status):
    refused = Raw(b'{"error": {"message": "too many pictures"}}', status=status)
    with serving(refused) as endpoint, pytest.raises(EndpointError, match="too many pictures"):
        ask(agent_of(tmp_path, endpoint.url))
    assert len(endpoint.asked) == 1


@pytest.mark.parametrize("client", ["openai", "anthropic"])
def test_a_wrong_key_names_its_variable_and_is_not_shown(tmp_path, monkeypatch, client):
    monkeypatch.setenv("MY_KEY", "k-secret-7")
    output = b'{"error": {"message": "Incorrect key: k-secret-7", "type": "authentication_error"}}'
    with serving(Raw(output, status=401)) as endpoint:
        agent = agent_of(tmp_path, endpoint.url, client=client, api_key_env="MY_KEY")
        with pytest.raises(EndpointError, match="check the key in MY_KEY") as caught:
            ask(agent)
    assert "k-secret-7" not in str(caught.value)
    assert len(endpoint.asked) == 1


KEY = "k-secret/7"


@pytest.mark.parametrize(
    "answer",
    [
        Raw(json.dumps({"error": {"message": f"bad key: {KEY}"}}).encode(), status=401),
        Raw(f"<html>{KEY}".encode(), status=500),
        Raw(f'{{"choices": [{{"message": "{KEY}'.encode()),
        Raw(json.dumps([KEY]).encode()),
        Raw(json.dumps({"error": {"message": KEY}}).replace("/", "\\/").encode()),
        f"my key is {KEY}\n{GOOD}",
        f"```python\npyautogui.write('{KEY}')\n```",
    ],
)
@pytest.mark.parametrize("client", ["openai", "anthropic"])
def test_a_key_that_an_endpoint_repeats_is_written_nowhere(
    tmp_path, monkeypatch, caplog, capfd, client, answer
):
    """Not in the log of requests, the record, the steps, a traceback, or on the terminal."""
    monkeypatch.setenv("MY_KEY", KEY)
    caplog.set_level("DEBUG")
    run = ChatRun()
    run.recorder = RequestLog(tmp_path / "requests.jsonl", (KEY,))
    with serving(answer, answer, GOOD) as endpoint:
        agent = agent_of(
            tmp_path, endpoint.url, run=run, client=client, api_key_env="MY_KEY", retries=0
        )
        env, _ = make_env(log=tmp_path / "run")
        record = play(env, agent, JOB, 0, None)
        env.close()
        value = ""
        try:
            agent.predict("do it", picture())
        except EndpointError as error:
            value = "".join(traceback.format_exception(error))
    files = {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()}
    assert len(files) >= 3
    texts = [value, json.dumps(record), caplog.text, *capfd.readouterr()]
    for form in (KEY, KEY.replace("/", "\\/")):
        assert not [text for text in texts if form in text]
        assert not [path for path, data in files.items() if form.encode() in data]


def test_an_endpoint_that_is_down(tmp_path):
    with serving(GOOD) as endpoint:
        url = endpoint.url
    with pytest.raises(EndpointError, match=f"m at {url}: APIConnectionError.*tried 3 times"):
        ask(agent_of(tmp_path, url))


def test_an_endpoint_that_is_slow(tmp_path):
    with serving(Raw(json.dumps(chat(GOOD)).encode(), delay=1.0), GOOD) as endpoint:
        agent = agent_of(tmp_path, endpoint.url, timeout=0.2)
        assert ask(agent) == CLICK
    assert agent.usage["retries"] == 1
    slow = Raw(json.dumps(chat(GOOD)).encode(), delay=0.5)
    with serving(slow) as endpoint, pytest.raises(EndpointError, match="APITimeoutError"):
        ask(agent_of(tmp_path, endpoint.url, timeout=0.1, retries=0))


def test_an_endpoint_may_ask_for_a_wait_and_there_is_a_longest_one(tmp_path, monkeypatch):
    slept = []
    monkeypatch.setattr("tenacity.nap.time.sleep", slept.append)
    busy = Raw(status=429, headers={"retry-after": "7"})
    with serving(busy, Raw(status=500), busy, GOOD) as endpoint:
        agent = agent_of(tmp_path, endpoint.url, retries=3)
        agent._model._waits = RetryWaits(first=1.0, longest=5.0)
        ask(agent)
    waits = [seconds for seconds in slept if seconds]  # the server sleeps as well, for 0 s
    assert (waits[0], waits[2]) == (5.0, 5.0)
    assert 2.0 <= waits[1] <= 3.0, "twice the first one, and some chance"


def test_half_a_surrogate_pair_is_said_and_the_next_request_goes_out(tmp_path):
    with serving("click \ud83d here", GOOD) as endpoint:
        agent = agent_of(tmp_path, endpoint.url, retries=0)
        assert ask(agent) == ["click \ud83d here"]
        assert ask(agent) == CLICK
    assert "click \N{REPLACEMENT CHARACTER} here" in json.dumps(
        endpoint.asked[1], ensure_ascii=False
    )


@pytest.mark.parametrize(
    ("counts", "used"),
    [
        (None, (0, 0, None)),
        ({"prompt_tokens": True, "completion_tokens": 5}, (0, 5, None)),
        ({"prompt_tokens": 10**30, "completion_tokens": 5}, (0, 5, None)),
        ({"prompt_tokens": 7, "completion_tokens": 5}, (7, 5, 12e-6)),
    ],
)
def test_an_endpoint_that_does_not_count_is_not_free(tmp_path, counts, used):
    body = json.dumps({**chat(GOOD), "usage": counts}).encode()
    prices = "{input: 1, output: 1}"
    with serving(Raw(body)) as endpoint:
        agent = agent_of(tmp_path, endpoint.url, prices=prices)
        ask(agent)
    usage = agent.usage
    items = (usage["input_tokens"], usage["output_tokens"], usage["usd"])
    assert items == used


def test_an_answer_may_begin_with_a_mark_and_hold_what_json_does_not_have(tmp_path):
    body = json.dumps({**chat(GOOD), "logprobs": [float("-inf")]}).encode()
    with serving(Raw(b"\xef\xbb\xbf" + body)) as endpoint:
        agent = agent_of(tmp_path, endpoint.url, retries=0)
        agent._model._recorder = RequestLog(tmp_path / "requests.jsonl")
        assert ask(agent) == CLICK
    assert '"logprobs": [null]' in (tmp_path / "requests.jsonl").read_text()


# What the model says


@pytest.mark.parametrize(
    ("answer", "actions"),
    [
        ("", [""]),
        (Refusal("I cannot help with that."), ["I cannot help with that."]),
        (Refusal("DONE"), ["not an action of pyautogui: 'DONE'"]),
        ("Let me think about it.", ["Let me think about it."]),
        ("```python\nimport os\nos.remove('/')\n```", ["import os\nos.remove('/')"]),
        (f"{GOOD}\n```DONE```", [*CLICK, "DONE"]),
        ("```python\npyautogui.click(1, 2)\nDONE\n```", [*CLICK, "DONE"]),
        (
            f"{GOOD}\nand then\n```",
            [
                "unreadable action: the action holds 1 blocks in ``` fences and a fence of no block,"
                f" not one block; give one action at a time; the reply: {GOOD}\nand then\n```"
            ],
        ),
        ("```python\npyautogui.click('1', '2')\n```", ["pyautogui.click('1', '2')"]),
        ("```python\npyautogui.click(float('nan'), 2)\n```", ["pyautogui.click(float('nan'), 2)"]),
        (Call("click", {"x": 1}), ['{"name": "click", "arguments": {"x": 1}}']),
        ("<think>```DONE```</think>\n```WAIT```", ["WAIT"]),
        ("<|begin_of_box|>```WAIT```<|end_of_box|>", ["WAIT"]),
    ],
)
def test_what_is_said_in_pyautogui(tmp_path, answer, actions):
    with serving(answer) as endpoint:
        assert ask(agent_of(tmp_path, endpoint.url)) == actions


def qwen(**arguments):
    return json.dumps({"name": "computer_use", "arguments": arguments})


def call(text):
    return f"<tool_call>\n{text}\n</tool_call>"


CLICK_QWEN = {"action": "left_click", "coordinate": [500, 500]}
TYPED = [
    ("qwen3_vl", call(qwen(**CLICK_QWEN)), ["pyautogui.click(48, 27)"]),
    ("qwen3_vl", Call("computer_use", CLICK_QWEN), ["pyautogui.click(48, 27)"]),
    (
        "qwen3_vl",
        call(qwen(**CLICK_QWEN)) + call(qwen(action="terminate", status="success")),
        ["pyautogui.click(48, 27)", "DONE"],
    ),
    (
        "qwen3_vl",
        call(qwen(action="left_click", coordinate=["500", "500"])),
        ["pyautogui.click(48, 27)"],
    ),
    ("qwen3_vl", call(qwen(action="left_click", coordinate=["x", "500"])), None),
    ("qwen3_vl", call(qwen(action="left_click", coordinate=[-1, -1])), ["WAIT"]),
    ("qwen3_vl", "<think>" + call(qwen(**CLICK_QWEN)), None),
    (
        "qwen3_vl",
        "<think><tool_call></think>" + call(qwen(**CLICK_QWEN)),
        ["pyautogui.click(48, 27)"],
    ),
    ("qwen3_vl", call(qwen(action="left_click", coordinate=[5000, 5])), None),
    ("qwen3_vl", call(qwen(action="left_click", coordinate=[float("nan"), 5])), None),
    ("qwen3_vl", call(qwen(**CLICK_QWEN))[:-20], None),
    ("qwen3_vl", "DONE", None),
    ("qwen3_vl", GOOD, None),
    (
        "ui_tars",
        "Thought: x\nAction: click(start_box='[490, 490, 510, 510]')",
        ["pyautogui.click(48, 27)"],
    ),
    ("ui_tars_1.5", "Thought: I am done.\nAction: finished(content='yes')", ["DONE"]),
    ("ui_tars_1.5", "Action: click(start_box='<|box_start|>(a,b)<|box_end|>')", None),
    ("ui_tars_1.5", "Action: press(key='a')", None),
    ("ui_tars_1.5", "", None),
    (
        "ui_tars_1.5",
        "Action: hotkey(key='ctrl s')\n\nwait()",
        ["pyautogui.hotkey('ctrl', 's')", "WAIT"],
    ),
    ("computer_13", '```json\n{"action_type": "PRESS", "key": "a"}\n```', ["pyautogui.press('a')"]),
    ("computer_13", '[{"action_type": "DONE"}, "WAIT"]', ["DONE", "WAIT"]),
    ("computer_13", '{"action_type": "CLICK", "x": "5", "y": 5}', None),
    ("computer_13", "5", None),
    ("computer_13", "FAIL", ["FAIL"]),
]


@pytest.mark.parametrize(("dialect", "answer", "actions"), TYPED)
def test_what_is_said_in_a_typed_dialect(tmp_path, dialect, answer, actions):
    with serving(answer) as endpoint:
        result = ask(agent_of(tmp_path, endpoint.url, prompt=dialect, parser=dialect))
    if actions is not None:
        assert result == actions
        return
    env, _ = make_env()
    env.reset(seed=0)
    [malformed] = result
    env.step(malformed)
    env.step("DONE")
    assert (env.record["malformed"], env.record["steps"]) == (1, 2)


CLICKS = {
    "ui_tars": "Action: click(point='<point>500 500</point>')",
    "seed": "<seed:tool_call><function=click><parameter=point><point>500 500</point></parameter>"
    "</function></seed:tool_call>",
    "qwen3_vl": "<tool_call><function=computer_use><parameter=action>left_click</parameter>"
    "<parameter=coordinate>[500, 500]</parameter></function></tool_call>",
    "gui_owl": qwen(**CLICK_QWEN),
    "glm": "<|begin_of_box|>left_click(start_box='[500,500]', element_info='OK')<|end_of_box|>",
    "cogagent": "Grounded Operation: CLICK(box=[[490,490,510,510]], element_info='OK')",
    "autoglm": '<think>x</think><answer>do(action="Tap", element=[500,500])</answer>',
    "showui": "{'action': 'CLICK', 'value': None, 'position': [0.5, 0.5]}",
    "internvl": "<ref>OK</ref><box>[[490, 490, 510, 510]]</box>",
    "holo2": '{"x": 500, "y": 500}',
    "gemini": Call("click_at", {"x": 500, "y": 500}),
    "opencua": "## Code:\n```python\npyautogui.click(x=42, y=27)\n```",
}


@pytest.mark.parametrize("dialect", CLICKS)
def test_the_middle_of_the_screen_in_every_dialect_of_2026(tmp_path, dialect):
    with serving(CLICKS[dialect]) as endpoint:
        result = ask(agent_of(tmp_path, endpoint.url, parser=dialect))
    # OpenCUA points at 84 x 56 pixels: (42.5, 27.5) of them is (48.57, 26.52) of 96 x 54.
    assert result == [
        "pyautogui.click(x=48, y=26)" if dialect == "opencua" else "pyautogui.click(48, 27)"
    ]


@pytest.mark.parametrize(
    ("dialect", "answer", "reason"),
    [
        ("ui_tars_1.5", "Action: press(key='a')", "UI-TARS has no action 'press'"),
        ("computer_13", '{"action_type": "done"}', "did you mean 'DONE'"),
        ("glm", "tap(start_box='[1,2]')", "the actions are left_click"),
        ("qwen3_vl", "<think>" + call(qwen(**CLICK_QWEN)), "<think> does not end"),
        ("pyautogui", "<think>\n" + GOOD, "<think> does not end"),
    ],
)
def test_a_malformed_answer_is_explained_in_the_words_of_its_dialect(
    tmp_path, dialect, answer, reason
):
    with serving(answer) as endpoint:
        [malformed] = ask(agent_of(tmp_path, endpoint.url, parser=dialect))
    with pytest.raises(ActionError, match=reason) as refused:
        read_action(malformed)
    assert "Python" not in str(refused.value)
    assert answer[:20] in malformed


def test_points_below_one_are_counted_and_told_in_the_report(tmp_path):
    with serving("```python\npyautogui.click(0.31, 0.42)\n```") as endpoint:
        agent = agent_of(tmp_path, endpoint.url)
        fractions = agent_of(tmp_path, endpoint.url, coordinates="fractions")
        env, _ = make_env()
        env.reset(seed=0)
        env.step(ask(agent)[0])
        assert ask(fractions) == ["pyautogui.click(30, 23)"]
    env.step("pyautogui.click(30, 20)")
    env.step("DONE")
    assert env.record["points"] == {"named": 2, "fractions": 1}
    message = list(
        fraction_note(SimpleNamespace(last_attempts=[env.record], is_scored=False, config={}))
    )
    assert message == [
        f"{env.record['agent']}: 1 of 2 points were below 1, and were read as pixels of the top"
        " left corner: is coordinates: fractions meant?"
    ]


@pytest.mark.parametrize(
    ("client", "parser", "answer", "actions"),
    [
        ("openai_computer", "openai", Refusal("No."), ["No."]),
        ("openai_computer", "openai", Refusal("DONE"), ["not an action of openai: 'DONE'"]),
        ("openai_computer", "openai", "", [""]),
        ("openai_computer", "openai", "FAIL it is not. I am DONE.", ["DONE"]),
        ("anthropic", "anthropic", Refusal("No."), ["No."]),
        ("anthropic", "anthropic", "Impossible, so FAIL", ["FAIL"]),
    ],
)
def test_a_tool_that_is_not_called(tmp_path, client, parser, answer, actions):
    with serving(answer) as endpoint:
        keys = {"client": client, "prompt": parser, "parser": parser}
        assert ask(agent_of(tmp_path, endpoint.url.removesuffix("/v1"), **keys)) == actions


@pytest.mark.parametrize(
    "arguments",
    [{"action": "left_click", "coordinate": "[1]"}, {"action": "fly"}, {}, "left_click"],
)
def test_a_tool_that_is_called_wrongly_gets_its_result_all_the_same(tmp_path, arguments):
    keys = {"client": "anthropic", "prompt": "anthropic", "parser": "anthropic"}
    with serving(Call("computer", arguments), "DONE") as endpoint:
        agent = agent_of(tmp_path, endpoint.url.removesuffix("/v1"), **keys)
        [malformed] = ask(agent)
        assert "computer" in malformed
        assert ask(agent) == ["DONE"]
    assert endpoint.asked[1]["messages"][-1]["content"][0]["type"] == "tool_result"


def test_points_outside_are_where_a_pointer_stops(tmp_path):
    keys = {"client": "anthropic", "prompt": "anthropic", "parser": "anthropic"}
    far = Call("computer", {"action": "left_click", "coordinate": [5000, -3]})
    with serving(far) as endpoint:
        actions = ask(agent_of(tmp_path, endpoint.url.removesuffix("/v1"), **keys))
    assert actions == [f"pyautogui.click({SIZE[1] - 1}, 0)"]


@pytest.mark.parametrize(
    ("coordinates", "code", "actions"),
    [
        ("resized", "pyautogui.click(x=966, y=546)", ["pyautogui.click(x=960, y=540)"]),
        ("thousandths", "pyautogui.click(500, 500)", ["pyautogui.click(960, 540)"]),
        ("resized", "computer.terminate(status='success')", ["DONE"]),
        ("resized", "computer.wait()", ["WAIT"]),
        ("resized", "computer.tripleClick(x=966, y=546)", ["pyautogui.tripleClick(x=960, y=540)"]),
        ("pixels", "computer.terminate(status='failure')", ["FAIL"]),
    ],
)
def test_code_in_other_coordinates(tmp_path, coordinates, code, actions):
    answer = f"Thought: x\nCode:\n```python\n{code}\n```"
    with serving(answer) as endpoint:
        agent = agent_of(tmp_path, endpoint.url, coordinates=coordinates)
        assert agent.predict("do it", picture(size=(1080, 1920)))[1] == actions


def test_code_that_cannot_be_mapped_is_never_run_in_the_wrong_coordinates(tmp_path):
    fractions = "```python\npyautogui.click(0.5, 0.5)\n```"  # and not the pixel in the corner
    answer = "```python\npyautogui.click(*f())\n```"
    with serving(fractions, answer) as endpoint:
        agent = agent_of(tmp_path, endpoint.url, coordinates="resized")
        assert "are fractions of the picture, not pixels" in ask(agent)[0]
        [malformed] = ask(agent)
    env, _ = make_env()
    env.reset(seed=0)
    env.step(malformed)
    env.step("DONE")
    assert env.record["malformed"] == 1


# In an episode


def test_a_failed_endpoint_is_an_error_of_the_episode_with_what_it_used(tmp_path):
    with serving(GOOD, Raw(status=500)) as endpoint:
        agent = agent_of(tmp_path, endpoint.url, prices="{input: 1, output: 1}")
        env, _ = make_env()
        record = play(env, agent, JOB, 0, None)
    assert (record["status"], record["cause"]) == ("error", "agent")
    assert record["problem"].startswith(f"the agent raised EndpointError: m at {endpoint.url}")
    assert record["usage"]["requests"] == 1
    assert len(record["usage"]["steps"]) == 2


def test_what_an_agent_used_is_in_its_record(tmp_path):
    with serving(GOOD, "```DONE```") as endpoint:
        agent = agent_of(tmp_path, endpoint.url, prices="{input: 1, output: 1}")
        env, _ = make_env()
        record = play(env, agent, JOB, 0, None)
    assert record["status"] == "ok"
    assert record["usage"] == json.loads(json.dumps(agent.usage))
    assert record["usage"]["input_tokens"] == 2000


class Counter:
    """An agent that counts in its own way."""

    def __init__(self, usage):
        self.usage = usage

    def predict(self, instruction, obs):
        return "", ["DONE"]


@pytest.mark.parametrize(
    ("usage", "kept"),
    [
        ({"tokens": 5}, {"tokens": 5}),
        ("much", None),
        ({"tokens": float("nan")}, {"problem": "usage cannot be kept: Out of range float"}),
        ({"tokens": object()}, {"problem": "usage cannot be kept: Object of type object"}),
        ({"log": "x" * 2**20}, {"problem": "usage cannot be kept: 1048587 characters"}),
    ],
)
def test_any_agent_may_count(usage, kept):
    env, _ = make_env()
    value = play(env, Counter(usage), JOB, 0, None)["usage"]
    if kept is not None and "problem" in kept:
        assert value["problem"].startswith(kept["problem"])
    else:
        assert value == kept


def test_the_fake_answers_are_those_of_the_apis():
    from anthropic.types import Message
    from openai.types.chat import ChatCompletion

    ChatCompletion.model_validate(chat((GOOD, Call("a", {}))))
    Message.model_validate(messages((GOOD, Call("a", {}))))


FRAGMENTS = st.lists(
    st.sampled_from(
        [
            "```",
            "```python\n",
            "\n",
            "DONE",
            "pyautogui.click(1, 2)",
            "Action: ",
            "Thought: ",
            "click(start_box='(1,2)')",
            "<tool_call>",
            "</tool_call>",
            '{"action_type": "CLICK"',
            '"name": "computer_use"',
            "{",
            "}",
            "[",
            "]",
            '"x": 1e999',
            "NaN",
            "'",
            '"',
            "\\",
            "<think>",
            "</think>",
            "computer.wait()",
            "\0",
            "\ud800",
            "(" * 300,
            "é",
            " ",
        ]
    ),
    max_size=12,
)
ARGUMENTS = st.recursive(
    st.none() | st.integers() | st.floats() | st.text(max_size=5),
    lambda inner: (
        st.lists(inner, max_size=3)
        | st.dictionaries(
            st.sampled_from(["action", "type", "coordinate", "x", "y", "path"]), inner
        )
    ),
    max_leaves=6,
)


@settings(max_examples=300, deadline=None)
@given(
    dialect=st.sampled_from(DIALECTS),
    coordinates=st.sampled_from(COORDINATES),
    parts=FRAGMENTS,
    arguments=st.lists(ARGUMENTS, max_size=2),
)
def test_nothing_that_a_model_says_is_an_exception(dialect, coordinates, parts, arguments):
    calls = tuple({"name": "computer_use", "arguments": argument} for argument in arguments)
    parser = ReplyParser(dialect=dialect, coordinates=coordinates)
    actions = parser.read(Reply(text="".join(parts), calls=calls), (108, 192))
    assert all(isinstance(action, str) for action in actions)


@pytest.mark.parametrize(
    ("text", "actions"),
    [
        ("It is done. ```DONE```", ["DONE"]),
        ("Next: ```python\npyautogui.click(1, 2)\n```", CLICK),
        ("I press it.\n```\npyautogui.click(1, 2)\n```", CLICK),
        ("```DONE``` it is not", ["```DONE``` it is not"]),
    ],
)
def test_fences_behind_prose(text, actions):
    assert ReplyParser(dialect="pyautogui").read(Reply(text=text), SIZE) == actions
