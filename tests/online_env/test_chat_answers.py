"""Answers that lack what the next request needs, keys that cannot be sent, and logs that are odd."""

import json
from functools import reduce

import pytest

pytest.importorskip("gymnasium", reason="needs the extra [online]")
pytest.importorskip("openai", reason="needs the extra [agents]")
pytest.importorskip("anthropic", reason="needs the extra [agents]")

from online_env.agents.agent_files import read_agent
from online_env.agents.chat.endpoint import RetryWaits
from online_env.agents.chat.parsing import ReplyParser
from online_env.agents.chat.prompts import Prompt
from online_env.agents.chat.query import ModelQuery, ScreenPicture, Turn, request_digest, wired
from online_env.agents.chat.request_log import RequestLog, RequestReplay
from online_env.agents.chat.wires import make_wire
from online_env.agents.settings import ModelSettings
from online_env.errors import AgentSetupError, EndpointError, ReplayError

from support.chatting import SIZE, agent_of, file, picture
from support.endpoints import Call, Raw, Refusal, chat, messages, responses, serving

pytestmark = pytest.mark.usefixtures("no_waiting")
GOOD = "```python\npyautogui.click(1, 2)\n```"
WAITS = {"action": "wait", "duration": 1}
TOOLS = {
    "openai": {},
    "anthropic": {"client": "anthropic", "prompt": "anthropic", "parser": "anthropic"},
    "openai_computer": {"client": "openai_computer", "prompt": "openai", "parser": "openai"},
}


def full_answer(client):
    """An answer of an API with all that it may have."""
    if client == "openai":
        return chat(("x", Call("n", {"a": 1}), Refusal("no")))
    if client == "anthropic":
        return messages(("x", Call("computer", WAITS)))
    return responses(("x", Call("computer", {"type": "wait"}), Refusal("no")))


def playing(tmp_path, client, url, **keys):
    address = url.removesuffix("/v1") if client == "anthropic" else url
    return agent_of(tmp_path, address, **TOOLS[client], **keys)


def places(value, path=()):
    """The path of each part of a JSON value."""
    entries = value.items() if isinstance(value, dict) else enumerate(value)
    for key, inner in entries:
        yield (*path, key)
        if isinstance(inner, dict | list):
            yield from places(inner, (*path, key))


def damaged(value, path, junk):
    """A copy of a JSON value with something else in one place; `...` takes the place away."""
    copy = json.loads(json.dumps(value))
    holder = reduce(lambda inner, key: inner[key], path[:-1], copy)
    if junk is ...:
        del holder[path[-1]]
    else:
        holder[path[-1]] = junk
    return copy


# Answers


@pytest.mark.parametrize("client", TOOLS)
def test_whatever_is_wrong_in_an_answer_it_is_an_error_of_the_endpoint_or_can_be_gone_on_from(
    client,
):
    wire = make_wire(client)
    dialect = TOOLS[client].get("parser", "pyautogui")
    screen_picture = ScreenPicture(picture()["screenshot"])
    tool = {"anthropic": "computer_20251124", "openai_computer": "computer"}.get(client)
    settings = ModelSettings(model="m", client=client, tool=tool)
    went_on = 0
    for path in places(full_answer(client)):
        for junk in (None, True, 0, 1.5, "", "x", {}, [], [1], ["x"], {"a": 1}, ...):
            try:
                reply = wire.read(damaged(full_answer(client), path, junk))
            except EndpointError:
                continue
            ReplyParser(dialect=dialect).read(reply, SIZE)
            turn = Turn(picture=screen_picture, answer=reply.transcript, raw=reply.raw)
            body = wire.body(
                ModelQuery(prompt=Prompt(), picture=screen_picture, turns=(turn,)), settings
            )
            body_text = json.dumps(wired(body))
            assert '_id": null' not in body_text, (path, junk)
            went_on += 1
    assert went_on > 100


@pytest.mark.parametrize(
    ("client", "path", "said"),
    [
        ("anthropic", ("content", 1, "id"), "the answer has a part without id"),
        ("openai_computer", ("id",), "the answer has a part without id"),
        ("openai_computer", ("output", 1, "call_id"), "the answer has a part without call_id"),
    ],
)
def test_a_part_that_the_next_request_cannot_name_is_asked_for_again(tmp_path, client, path, said):
    options = {
        "anthropic": messages(("x", Call("computer", WAITS))),
        "openai_computer": responses(("x", Call("computer", {"type": "wait"}))),
    }[client]
    nameless = Raw(json.dumps(damaged(options, path, ...)).encode())
    whole_one = Raw(json.dumps(options).encode())
    with serving(nameless, whole_one) as endpoint:
        agent = playing(tmp_path, client, endpoint.url)
        assert agent.predict("do it", picture())[1] == ["WAIT"]
        assert agent.usage["retries"] == 1
    with serving(nameless) as endpoint, pytest.raises(EndpointError, match=f"^{said}: "):
        playing(tmp_path, client, endpoint.url).predict("do it", picture())


def test_safety_checks_that_are_no_list_are_asked_for_again(tmp_path):
    options = responses(("x", Call("computer", {"type": "wait"})))
    odd = Raw(json.dumps(damaged(options, ("output", 1, "pending_safety_checks"), 5)).encode())
    with serving(odd) as endpoint:
        agent = playing(tmp_path, "openai_computer", endpoint.url)
        problem = r"^the answer has no list pending_safety_checks: 5 \(tried 3 times\)$"
        with pytest.raises(EndpointError, match=problem):
            agent.predict("do it", picture())


def test_an_answer_in_other_words_than_json_objects_says_what_came(tmp_path):
    with serving(Raw(b'"<html>"')) as endpoint:
        agent = agent_of(tmp_path, endpoint.url, retries=0)
        with pytest.raises(EndpointError) as caught:
            agent.predict("do it", picture())
    assert str(caught.value) == f"m at {endpoint.url}: the answer is no JSON object: '<html>'"


def test_an_endpoint_that_wants_a_key_although_the_file_names_none(tmp_path):
    with (
        serving(Raw(b'{"error": {"message": "who are you?"}}', status=401)) as endpoint,
        pytest.raises(EndpointError, match=r"who are you\?; name its key by api_key_env$"),
    ):
        agent_of(tmp_path, endpoint.url).predict("do it", picture())
    assert len(endpoint.asked) == 1


@pytest.mark.parametrize(
    ("asked", "least", "most"),
    [
        ("-5", 0.0, 0.0),
        ("nan", 0.0, 0.0),
        ("inf", 5.0, 5.0),
        ("Wed, 21 Oct 2026 07:28:00 GMT", 1.0, 2.0),
        ("", 1.0, 2.0),
    ],
)
def test_a_wait_that_makes_no_sense_is_never_slept(tmp_path, monkeypatch, asked, least, most):
    slept = []
    monkeypatch.setattr("tenacity.nap.time.sleep", slept.append)
    with serving(Raw(status=429, headers={"retry-after": asked}), GOOD) as endpoint:
        agent = agent_of(tmp_path, endpoint.url)
        agent._model._waits = RetryWaits(first=1.0, longest=5.0)
        agent.predict("do it", picture())
    waited = max(slept, default=0.0)
    assert least <= waited <= most


@pytest.mark.parametrize(
    ("client", "ending"),
    [
        ("anthropic", {"stop_reason": "max_tokens"}),
        (
            "openai_computer",
            {"status": "incomplete", "incomplete_details": {"reason": "max_output_tokens"}},
        ),
    ],
)
def test_a_computer_tools_answer_that_was_cut_off_is_malformed_and_not_done(
    tmp_path, client, ending
):
    make = {"anthropic": messages, "openai_computer": responses}[client]
    for answer in ("Let me see. The window", ("x", Call("computer", WAITS))):
        with serving(Raw(json.dumps({**make(answer), **ending}).encode())) as endpoint:
            (action,) = playing(tmp_path, client, endpoint.url).predict("do it", picture())[1]
        assert "the answer was cut off (max_" in action
        assert action not in ("DONE", "WAIT")


def test_an_answer_that_says_that_the_model_failed_is_asked_for_again(tmp_path):
    overloaded = {"message": "overloaded", "code": 502}
    choice = {**chat("")["choices"][0], "finish_reason": "error", "error": overloaded}
    failures = {
        "openai": {**chat(""), "choices": [choice]},
        "openai_computer": {**responses(""), "status": "failed", "error": overloaded},
    }
    for client, failure in failures.items():
        failed = Raw(json.dumps(failure).encode())
        with serving(failed) as endpoint, pytest.raises(EndpointError, match="overloaded"):
            playing(tmp_path, client, endpoint.url).predict("do it", picture())


def test_tokens_that_are_free_cost_nothing_even_if_nobody_counts_them(tmp_path):
    uncounted = Raw(json.dumps({**chat(GOOD), "usage": None}).encode())
    with serving(uncounted) as endpoint:
        agent = agent_of(tmp_path, endpoint.url, prices="{input: 0, output: 0}")
        agent.predict("do it", picture())
    assert agent.usage["usd"] == 0.0


@pytest.mark.parametrize("usage", [None, {"prompt_tokens": 9, "completion_tokens": -1}])
def test_one_step_of_unknown_price_makes_the_price_of_all_unknown(tmp_path, usage):
    uncounted = Raw(json.dumps({**chat(GOOD), "usage": usage}).encode())
    with serving(GOOD, uncounted, GOOD) as endpoint:
        agent = agent_of(tmp_path, endpoint.url, prices="{input: 1, output: 1}")
        for _ in range(3):
            agent.predict("do it", picture())
    usage = agent.usage
    assert usage["usd"] is None
    assert [step["usd"] for step in usage["steps"]] == [0.00102, None, 0.00102]
    assert (usage["requests"], usage["output_tokens"]) == (3, 40)


def test_a_summary_without_words_leaves_the_agents_own(tmp_path):
    def voices(body):
        is_summary = "A GUI agent works on a task." in json.dumps(body)
        return " \n" if is_summary else GOOD

    with serving(voices) as endpoint:
        agent = agent_of(tmp_path, endpoint.url, "onlooker: {check: false}")
        for shade in range(2):
            agent.predict("do it", picture(shade))
    texts = [part.get("text") for part in endpoint.asked[-1]["messages"][-1]["content"]]
    assert len(endpoint.asked) == 3
    assert f"Step 1: {GOOD}" in texts


# Keys


@pytest.mark.parametrize("key", ["k-secret-7\n", "k-secret-7\r", " k-secret-7", "k-secret-\xfc"])
@pytest.mark.parametrize("client", ["openai", "anthropic"])
def test_a_key_that_no_request_can_carry_is_told_before_the_first_one(
    tmp_path, monkeypatch, client, key
):
    monkeypatch.setenv("MY_KEY", key)
    output = (
        "the key in MY_KEY has a space or a line break around it, or a character that is not"
        " ASCII; run: export MY_KEY=..."
    )
    with serving(GOOD) as endpoint:
        with pytest.raises(AgentSetupError) as caught:
            agent_of(tmp_path, endpoint.url, client=client, api_key_env="MY_KEY")
        assert str(caught.value) == f"m: {output}"
    assert endpoint.asked == []
    settings = read_agent(str(file(tmp_path, "http://127.0.0.1:1", api_key_env="MY_KEY")))
    with pytest.raises(AgentSetupError) as caught:
        settings.check_keys({"MY_KEY": key})
    assert str(caught.value) == f"{tmp_path / 'agent.yaml'}: {output}"
    settings.check_keys({"MY_KEY": "k-secret-7"})


# Logs


def logged(tmp_path, *answers, steps=1):
    """The path of the log of some steps, and what the agent answered."""
    path = tmp_path / "requests.jsonl"
    with serving(*answers) as endpoint:
        agent = agent_of(tmp_path, endpoint.url, retries=0)
        agent._model._recorder = RequestLog(path)
        options = [agent.predict("do it", picture(shade)) for shade in range(steps)]
    return path, options


def test_a_run_in_which_half_a_character_was_said_can_be_replayed(tmp_path):
    path, options = logged(tmp_path, "odd \ud83d\n\u2028 one", GOOD, steps=2)
    assert options[0][0] == "odd \ud83d\n\u2028 one"
    again = agent_of(tmp_path, "http://127.0.0.1:1")
    again._model._recorder = RequestReplay(path)
    assert [again.predict("do it", picture(shade)) for shade in range(2)] == options


def test_a_replay_says_which_picture_is_another_one(tmp_path):
    path, _ = logged(tmp_path, GOOD, steps=2)
    again = agent_of(tmp_path, "http://127.0.0.1:1")
    again._model._recorder = RequestReplay(path)
    again.predict("do it", picture(0))
    with pytest.raises(ReplayError) as caught:
        again.predict("do it", picture(7))
    assert str(caught.value) == (
        f"{path}: step 1 (act): this request is not in the log, which has step 1 (act) here; they"
        " differ in the request.messages[3].content[1].image_url.url (a picture)"
    )


LINE = {
    "step": 0,
    "role": "act",
    "sha256": "x",
    "request": {},
    "seconds": 0.5,
    "tries": 1,
    "response": {},
}


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"response": None}, "it has neither a response, which is an object, nor a problem"),
        ({"response": [1]}, "it has neither a response, which is an object, nor a problem"),
        ({"seconds": "long"}, "seconds is no number from 0 on: 'long'"),
        ({"seconds": -1}, "seconds is no number from 0 on: -1"),
        ({"tries": 0}, "tries is no whole number from 1 on: 0"),
        ({"tries": 1.5}, "tries is no whole number from 1 on: 1.5"),
        ({"tries": None}, "tries is no whole number from 1 on: None"),
    ],
)
def test_a_line_of_a_log_with_a_wrong_value_is_named(tmp_path, changes, said):
    path = tmp_path / "requests.jsonl"
    path.write_text("".join(json.dumps(line) + "\n" for line in (LINE, {**LINE, **changes})))
    with pytest.raises(ReplayError) as caught:
        RequestReplay(path)
    assert str(caught.value) == f"{path}:2: is damaged ({said})"
    path.write_text(json.dumps({**LINE, **changes, "tries": 1, "seconds": 0, "problem": "no"}))
    RequestReplay(path)


def test_a_line_of_a_log_that_is_nested_without_end_is_named(tmp_path):
    path = tmp_path / "requests.jsonl"
    path.write_text("[" * 100_000)
    with pytest.raises(ReplayError, match=r"requests\.jsonl:1: is damaged \("):
        RequestReplay(path)


def test_the_digest_of_a_request_knows_pictures_by_their_pixels():
    def body(*pixels):
        query = ModelQuery(prompt=Prompt(first="a"), picture=ScreenPicture(*pixels))
        return make_wire("openai").body(query, ModelSettings(model="m"))

    plain = picture(5)["screenshot"]
    copied = plain.copy()
    copied[-1, -1, 2] ^= 1
    assert request_digest(body(plain)) == request_digest(body(plain[::-1][::-1]))
    assert request_digest(body(plain)) != request_digest(body(copied))
    assert request_digest(body(plain)) != request_digest(body(plain.reshape(96, 54, 3)))
