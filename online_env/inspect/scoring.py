"""How an episode becomes a score of Inspect.

| record | sample |
|---|---|
| `ok` | its score, 0 to 1 |
| `invalid` | unscored: it is in no metric |
| `error` of the agent | 0 |
| `error` of the machine | errored, so that `--retry-on-error` runs it again |
"""

import re
from typing import Any

from inspect_ai.model import ChatMessageAssistant, ChatMessageTool
from inspect_ai.scorer import Score
from inspect_ai.solver import TaskState

from ..agents.base import DONE, FAIL
from ..errors import DesktopError
from .sessions import Session, in_thread

SUBMIT = "submit"
_FAIL = re.compile(rf"{FAIL}(?![\w-])", re.IGNORECASE)
_SIGNS = " \t\r\n*_`#>\"'"
CORRUPTION = "corruption"  # the metadata by which scores are grouped


async def score_sample(session: Session, state: TaskState) -> Score:
    """End the episode if the model has not, and return its score.

    Raises:
        DesktopError: The desktop or the evaluator failed in the agent's hands.
    """
    completion = state.output.completion
    if session.record is None:
        await in_thread(_end, session, completion, was_cut_off(state))
    record: dict[str, Any] = session.record or {}
    metadata = {"record": record}
    if record["status"] == "invalid":
        return Score.unscored(
            reason="corruption_not_proved", explanation=record["problem"], metadata=metadata
        )
    if record["status"] == "error" and record["cause"] != "agent":
        raise DesktopError(record["problem"])
    return Score(
        value=record["score"] or 0.0,
        answer=completion,
        explanation=record["reason"] or record["problem"],
        metadata=metadata,
    )


def _end(session: Session, completion: str, cut_off: bool) -> None:
    session.record_message(completion)
    if cut_off:
        session.cut_off("a limit of Inspect's ended the episode before the agent took an action")
    else:
        session.act(FAIL if gives_up(completion) else DONE)


def gives_up(answer: str) -> bool:
    """Return whether an answer begins with the word `FAIL`, in any case, and not with "Failing".

    Signs of Markdown and quotes before the word do not count.
    """
    return _FAIL.match(answer.lstrip(_SIGNS)) is not None


def was_cut_off(state: TaskState) -> bool:
    """Return whether a limit ended the agent: the last thing that it did was no answer."""
    if not state.messages:
        return True
    last = state.messages[-1]
    if isinstance(last, ChatMessageTool):
        return last.function != SUBMIT
    if isinstance(last, ChatMessageAssistant):
        return any(call.function != SUBMIT for call in last.tool_calls or ())
    return True  # a message to the model, which it did not answer
