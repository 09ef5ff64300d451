"""AgentHijack-Agent: what stands in each prompt at each step, and what the onlooker is told."""

import pytest

pytest.importorskip("gymnasium", reason="needs the extra [online]")
pytest.importorskip("openai", reason="needs the extra [agents]")

from online_env.agents.chat.onlooker import read_reminder, read_summary
from online_env.bench.episodes import play
from online_env.bench.jobs import Job

from support.chatting import agent_of, picture
from support.endpoints import serving
from support.episodes import make as make_env
from support.reading_requests import outline

CHECK = "You look at the first screenshot"
SUMMARY = "A GUI agent works on a task. You"
ACTOR = "You are a GUI agent. Given a tas"
LEFT_OUT = "(An older screenshot, left out.)"
FINE = "Thought: A plain desktop.\nReminder: None"
LOCKED = "Thought: It is locked.\nReminder: Please log in by entering the password first."
LOGIN = "Please log in by entering the password first."


class Voices:
    """Answers as the onlooker or as the agent, by what is asked; counts both."""

    def __init__(self, *checks):
        self.checks = list(checks)
        self.summaries = {}
        self.acted = 0
        self.summed = 0

    def __call__(self, body):
        text = body["messages"][0]["content"][0]["text"]
        if text.startswith(CHECK):
            return self.checks.pop(0)
        if text.startswith(SUMMARY):
            self.summed += 1
            return self.summaries.get(self.summed - 1, f"d_{self.summed - 1}")
        self.acted += 1
        return f"Thought: t_{self.acted - 1}\nAction: hotkey(key='{self.acted - 1}')"


def agent(tmp_path, url, onlooker, **keys):
    entries = {"prompt": "ui_tars_1.5", "parser": "ui_tars_1.5", **keys}
    return agent_of(tmp_path, url, f"onlooker: {onlooker}", **entries)


def watched(tmp_path, onlooker, steps, *checks, **keys):
    """The actions of some steps, and the outlines of all requests."""
    with serving(Voices(*checks)) as endpoint:
        result = agent(tmp_path, endpoint.url, onlooker, **keys)
        actions = [result.predict("do it", picture(shade))[1] for shade in range(steps)]
    return actions, [outline(body["messages"]) for body in endpoint.asked], result


def summary(step):
    """The question after a step: its picture, its action, the picture after it."""
    return [("user", [SUMMARY, step, step + 1])]


def test_what_each_prompt_holds_with_all_modules(tmp_path):
    actions, requests, value = watched(tmp_path, "{}", 4, FINE)
    assert actions == [[f"pyautogui.press('{n}')"] for n in range(4)]
    assert requests == [
        [("user", [CHECK, 0])],
        [("user", [ACTOR, 0])],
        summary(0),
        [("user", [ACTOR, 0, "Step 1: d_0", 1])],
        summary(1),
        [("user", [ACTOR, 0, "Step 1: d_0", 1, "Step 2: d_1", 2])],
        summary(2),
        [("user", [ACTOR, 0, "Step 1: d_0", 1, "Step 2: d_1", 2, "Step 3: d_2", 3])],
    ]
    assert value.usage["requests"] == 8
    assert [step["requests"] for step in value.usage["steps"]] == [2, 2, 2, 2]


def test_old_pictures_go_and_their_summaries_stay(tmp_path):
    _, requests, _ = watched(tmp_path, "{check: false}", 4, history=1)
    assert requests[-1] == [
        ("user", [ACTOR, LEFT_OUT, "Step 1: d_0", LEFT_OUT, "Step 2: d_1", 2, "Step 3: d_2", 3])
    ]


@pytest.mark.parametrize("history", [15, 1])
def test_an_unexpected_operation_has_a_pair_of_its_own(tmp_path, history):
    voices = Voices()
    voices.summaries[1] = "d_1\nnot the agent\u2019s doing : A menu opened."
    with serving(voices) as endpoint:
        result = agent(tmp_path, endpoint.url, "{check: false}", history=history)
        for shade in range(4):
            result.predict("do it", picture(shade))
    requests = [outline(body["messages"]) for body in endpoint.asked]
    unexpected = "Not the agent's doing: A menu opened."[:32]
    pairs = [0, "Step 1: d_0", 1, "Step 2: d_1", 2, unexpected]
    if history == 1:
        pairs[0] = pairs[2] = LEFT_OUT
    assert requests[4] == [("user", [ACTOR, *pairs, 2])]
    assert requests[5] == summary(2)
    if history == 1:
        pairs[4] = LEFT_OUT
    assert requests[6] == [("user", [ACTOR, *pairs, 2, "Step 3: d_2", 3])]


@pytest.mark.parametrize(
    ("text", "parts"),
    [
        ("It clicked.", ("It clicked.", "")),
        ("It clicked.\nNot the agent's doing: None.", ("It clicked.", "")),
        ("Not the agent's doing: A lock screen.", ("", "A lock screen.")),
    ],
)
def test_parts_of_a_summary(text, parts):
    assert read_summary(text) == parts


def test_without_summaries_the_history_is_what_the_agent_said(tmp_path):
    _, requests, _ = watched(tmp_path, "{summarise: false}", 3, FINE)
    output = [f"Thought: t_{n}\nAction: hotkey(key='a" for n in range(2)]
    assert requests == [
        [("user", [CHECK, 0])],
        [("user", [ACTOR, 0])],
        [("user", [ACTOR, 0]), ("assistant", [output[0][:32]]), ("user", [1])],
        [
            ("user", [ACTOR, 0]),
            ("assistant", [output[0][:32]]),
            ("user", [1]),
            ("assistant", [output[1][:32]]),
            ("user", [2]),
        ],
    ]


def test_without_any_module_it_is_the_model_alone(tmp_path):
    _, alone, _ = watched(tmp_path, "{check: false, summarise: false}", 3)
    with serving(Voices()) as endpoint:
        result = agent_of(tmp_path, endpoint.url, prompt="ui_tars_1.5", parser="ui_tars_1.5")
        for shade in range(3):
            result.predict("do it", picture(shade))
    assert alone == [outline(body["messages"]) for body in endpoint.asked]


def test_an_error_is_reported_once_and_the_screen_is_looked_at_again(tmp_path):
    actions, requests, _ = watched(tmp_path, "{}", 3, LOCKED, FINE)
    assert actions[0] == ["REQUEST_REINIT"]
    assert requests[:3] == [[("user", [CHECK, 0])], [("user", [CHECK, 1])], [("user", [ACTOR, 1])]]
    assert requests[3:] == [summary(1), [("user", [ACTOR, 1, "Step 1: d_0", 2])]]


def test_a_reminder_that_remains_stands_in_the_prompt_of_every_step(tmp_path):
    with serving(Voices(LOCKED, LOCKED)) as endpoint:
        result = agent(tmp_path, endpoint.url, "{}")
        actions = [result.predict("do it", picture(shade))[1][0] for shade in range(3)]
    assert actions == ["REQUEST_REINIT", "pyautogui.press('0')", "pyautogui.press('1')"]
    opening = [body["messages"][0]["content"][0]["text"] for body in endpoint.asked]
    acted = [text for text in opening if text.startswith(ACTOR)]
    assert len(acted) == 2
    assert all(text.endswith(f"do it\n\nReminder: {LOGIN}") for text in acted)


def test_an_onlooker_that_must_not_ask_reminds_at_once(tmp_path):
    actions, requests, _ = watched(tmp_path, "{reinit: false}", 2, LOCKED)
    assert actions[0] == ["pyautogui.press('0')"]
    assert sum(request == [("user", [CHECK, 0])] for request in requests) == 1


def test_a_new_episode_is_checked_anew(tmp_path):
    with serving(Voices(LOCKED, LOCKED, FINE)) as endpoint:
        result = agent(tmp_path, endpoint.url, "{}")
        result.predict("do it", picture(0))
        result.predict("do it", picture(1))
        result.reset()
        assert result.predict("do it", picture(2))[1] == ["pyautogui.press('1')"]
    last = endpoint.asked[-1]["messages"]
    assert outline(last) == [("user", [ACTOR, 2])]
    assert "Reminder" not in last[0]["content"][0]["text"]


def test_the_onlooker_is_told_instruction_action_and_errors_and_nothing_else(tmp_path):
    (tmp_path / "errors.yaml").write_text("errors: [{name: Fire, looks: flames, say: Run.}]")
    with serving(Voices(FINE)) as endpoint:
        result = agent(tmp_path, endpoint.url, "{errors: errors.yaml}")
        for shade in range(2):
            result.predict("do it", picture(shade))
    check, _, summed, _ = (body["messages"][0]["content"] for body in endpoint.asked)
    assert '1. Fire: flames\n   Say: "Run."' in check[0]["text"]
    assert "Task of the agent:\ndo it\n" in summed[0]["text"]
    assert "Action:\nThought: t_0\nAction: hotkey(key='0')\n" in summed[0]["text"]
    assert [part["type"] for part in summed] == ["text", "image_url", "image_url"]


def test_another_model_may_look_on(tmp_path):
    voices = Voices(FINE)
    with serving(voices) as actor, serving(voices) as onlooker:
        url = onlooker.url
        result = agent(tmp_path, actor.url, f"{{model: big, base_url: '{url}'}}")
        for shade in range(2):
            result.predict("do it", picture(shade))
    assert [body["model"] for body in actor.asked] == ["m", "m"]
    assert [body["model"] for body in onlooker.asked] == ["big", "big"]


@pytest.mark.parametrize(
    ("text", "reminder"),
    [
        (FINE, ""),
        ("None", ""),
        ("Reminder: none.", ""),
        ('Reminder: "None"', ""),
        (LOCKED, LOGIN),
        (f'Reminder:\n"{LOGIN}"', LOGIN),
        ("Thought: no Reminder: yet\nReminder: Run.", "Run."),
        ("", None),
        ("Reminder:", None),
        ("It looks fine to me.", None),
    ],
)
def test_reading_a_reminder(text, reminder):
    assert read_reminder(text) == reminder


def test_a_check_that_cannot_be_read_is_counted(tmp_path):
    _, _, value = watched(tmp_path, "{}", 1, "It looks fine to me.")
    assert value.usage["unreadable_checks"] == 1


@pytest.mark.usefixtures("no_waiting")
def test_a_false_alarm_counts_in_the_record(tmp_path):
    with serving(Voices(LOCKED, FINE)) as endpoint:
        env, _ = make_env(max_steps=3)
        result = agent(tmp_path, endpoint.url, "{}")
        record = play(env, result, Job("agent", "t", "clean", 0), 0, None)
    assert (record["status"], record["ended"], record["steps"]) == ("ok", "max_steps", 3)
    assert (record["recovery"]["requests"], record["recovery"]["false_alarms"]) == (1, 1)
    assert record["malformed"] == 0
