"""The entry of an episode in the list of a run, and the outcomes that it can have."""

from dataclasses import dataclass

SUCCESS = "success"
PARTIAL = "partial"
FAILURE = "failure"
AGENT_ERROR = "agent error"
MACHINE_ERROR = "machine error"
INVALID = "invalid"
UNFINISHED = "unfinished"
UNREADABLE = "unreadable"
# In the order in which the page lists them.
OUTCOMES = (SUCCESS, PARTIAL, FAILURE, AGENT_ERROR, MACHINE_ERROR, INVALID, UNFINISHED, UNREADABLE)


@dataclass(slots=True)
class EpisodeEntry:
    """The entry of an episode in the list.

    Args:
        id: that of the episode; empty if it is not known.
        agent: its name.
        task: its id.
        corruption: its label.
        seed: of the corruption, and of the task where that is another, as text.
        attempt: from 0.
        outcome: one of `OUTCOMES`.
        score: 0..1, or `None`.
        steps: actions that the agent took.
        seconds: how long it took.
        tokens: read and written by models.
        usd: what they cost.
        instruction: of the task.
        note: why it ended as it did.
        said: the agent's last words, cut off.
        number: of its line in the journal, from 1; 0 if it has none.
        counts: whether the report counts it.
        problem: what is wrong with the files, or "".
        given: what the agent was given beside instruction and pictures, in words; "" for nothing.
    """

    id: str
    agent: str = ""
    task: str = ""
    corruption: str = ""
    seed: str = ""
    attempt: int = 0
    outcome: str = UNREADABLE
    score: float | None = None
    steps: int | None = None
    seconds: float | None = None
    tokens: int | None = None
    usd: float | None = None
    instruction: str = ""
    note: str = ""
    said: str = ""
    number: int = 0
    counts: bool = False
    problem: str = ""
    given: str = ""
