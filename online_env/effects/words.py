"""What a probe saw, as one line for people; the facts themselves are in the record."""

import json
from collections.abc import Callable, Mapping
from typing import Any

Facts = Mapping[str, Any]
LONGEST = 60  # characters of a name or a title


def in_words(kind: str, facts: Facts, problem: str = "") -> str:
    """Say what the facts of a probe of `kind` mean; a probe that failed says its `problem`."""
    if problem:
        return problem
    say = _SAY.get(kind)
    return say(facts) if say else json.dumps(dict(facts), ensure_ascii=False)


def undone_in_words(kind: str, facts: Facts, problem: str = "") -> str:
    """Say how an effect of `kind` was taken back, or the `problem`."""
    say = _UNDONE.get(kind)
    return problem or (say(facts) if say else json.dumps(dict(facts), ensure_ascii=False))


def _launched(facts: Facts) -> str:
    attempt, window = facts["attempts"][-1], facts["window"]
    stand_in = f" ({attempt['stand_in']})" if attempt["stand_in"] else ""
    x1, y1, x2, y2 = window["frame"]
    return f"a new window, {_short(window['title'])}, is drawn at x {x1}-{x2}, y {y1}-{y2}{stand_in}"


def _touched(facts: Facts) -> str:
    attempt = facts["attempts"][-1]
    element, (x, y) = attempt["element"], attempt["point"]
    tries = f", at attempt {len(facts['attempts'])}" if len(facts["attempts"]) > 1 else ""
    named = " ".join([element["role"], *([_short(element["name"])] if element["name"].strip() else [])])
    return (
        f"the pointer is at {x}, {y}; the click reached the {named} of {element['app']} and changed the screen{tries}"
    )


def _minimised(facts: Facts) -> str:
    return f"no window is on the screen, {facts['hidden']} went to the panel"


def _closed(facts: Facts) -> str:
    who = " and ".join(f"{_target(target)}" for target in facts["before"]) or "nothing"
    answered = "was closed already" if facts["already"] else f"{who} answered before and do not now"
    return f"{answered}; our rules dropped {facts['dropped']} packets"


def _target(target: Facts) -> str:
    return f"{'name server' if target['kind'] == 'dns' else 'site'} {target['host']}"


def _locked(facts: Facts) -> str:
    parts = ["its window covers the screen"] * bool(facts["covers"]) + ["it holds the keyboard"] * bool(
        facts["keyboard"]
    )
    return f"{facts['locker']} says locked, {' and '.join(parts)}; a typed key reached no application"


_SAY: dict[str, Callable[[Facts], str]] = {
    "launch_app": _launched,
    "touch": _touched,
    "minimise": _minimised,
    "firewall": _closed,
    "lock": _locked,
}


def _short(text: str) -> str:
    line = " ".join(text.split())
    return repr(line if len(line) <= LONGEST else line[: LONGEST - 3] + "...")


_NOT_LOCKED = "it is not locked: it never was, somebody unlocked it, or the locker ended"
_UNDONE: dict[str, Callable[[Facts], str]] = {
    "launch_app": lambda facts: "the window is closed" if facts["closed"] else facts["why"],
    "touch": lambda facts: facts["why"],
    "minimise": lambda facts: f"{facts['restored']} windows are back",
    "firewall": lambda facts: "our rules are gone" + (", what answered before answers again" if facts["now"] else ""),
    "lock": lambda facts: f"unlocked, by {facts['by']}" if facts["by"] in ("password", "force") else _NOT_LOCKED,
}
