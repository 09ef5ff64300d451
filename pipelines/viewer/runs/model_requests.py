"""The requests to models in an episode: the onlooker's words, and the tokens of each turn.

`RUN/requests/<id>.jsonl` is written by agents behind an API (`online_env.agents.chat`). A turn is
one question to the agent; it may have several actions, and so several lines of the log.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, cast

from hijack_data.runs.run_log import REQUESTS

from ...readers.fields import FieldError, listed
from ...readers.safe_files import inside, lines

CHECK = "check"  # of the first screens, before the agent acts
SUMMARY = "summarise"  # the paper's d_t: what happened since the turn before
_TEXT_KEYS = ("choices", "message", "output", "content", "text", "refusal")
_USAGE_KEYS = ("input_tokens", "output_tokens", "usd", "seconds", "requests", "retries")


@dataclass
class TurnMessages:
    """The onlooker's words and the usage of one turn."""

    onlooker: list[tuple[str, str]] = field(default_factory=list[tuple[str, str]])
    usage: Mapping[str, Any] = field(default_factory=dict[str, Any])


def read_turns(
    folder: Path, name: str, record: Mapping[str, Any]
) -> tuple[dict[int, TurnMessages], str]:
    """Return what is known of each turn, and what is wrong with the log of requests, or "".

    Args:
        folder: of the run.
        name: the id of the episode.
        record: of the episode; its `usage` has the tokens.
    """
    turns: dict[int, TurnMessages] = {}
    usage = record.get("usage")
    step_usages = usage.get("steps") if isinstance(usage, dict) else None
    for turn, turn_usage in enumerate(listed(step_usages)):
        if isinstance(turn_usage, dict):
            figures = {
                key: turn_usage[key] for key in _USAGE_KEYS if turn_usage.get(key) is not None
            }
            turns[turn] = TurnMessages(usage=figures)
    problem = ""
    try:
        for turn, role, text in _onlooker_texts(folder, name):
            turns.setdefault(turn, TurnMessages()).onlooker.append((role, text))
    except FieldError as error:
        problem = f"{REQUESTS}/{name}.jsonl: {error}"
    except OSError as error:
        problem = f"{REQUESTS}/{name}.jsonl: cannot be read ({error.strerror or error})"
    return turns, problem


def turn_numbers(lines_of_log: Sequence[Mapping[str, Any]]) -> list[int | None]:
    """Return the turn that each line begins; `None` for one that continues a turn, or has none."""
    numbers: list[int | None] = []
    turn = -1
    # each action of an agent that says nothing is a turn
    spoken = any(line.get("said") is not None for line in lines_of_log)
    for line in lines_of_log:
        begins = line.get("said") is not None if spoken else line.get("raw") is not None
        turn += begins
        numbers.append(turn if begins else None)
    return numbers


def _onlooker_texts(folder: Path, name: str) -> Iterator[tuple[int, str, str]]:
    if not (folder / REQUESTS / f"{name}.jsonl").exists():
        return
    for line in lines(inside(folder / REQUESTS, f"{name}.jsonl", REQUESTS)):
        data = line.record()
        role = data.get("role")
        turn = data.get("step")
        if role not in (CHECK, SUMMARY) or not isinstance(turn, int):
            continue
        text = "\n".join(_answer_texts(data.get("response"))) or str(data.get("problem") or "")
        yield turn, role, text


def _answer_texts(response: object) -> Iterator[str]:
    """Yield the texts of an answer of any API, in their order."""
    if isinstance(response, str):
        yield response
    for part in listed(response):
        yield from _answer_texts(part)
    if isinstance(response, dict):
        answer = cast("dict[str, object]", response)
        for key in _TEXT_KEYS:
            if key in answer:
                yield from _answer_texts(answer[key])
