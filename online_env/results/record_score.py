"""What one record says about its agent: whether it counts, and its score."""

from typing import Any, TypeAlias

from hijack_data.runs.run_log import episode_slug

ResultRecord: TypeAlias = dict[str, Any]


def counts(record: ResultRecord) -> bool:
    """Return whether an episode counts for the agent.

    An episode whose desktop died is repeated, and counts if the desktop dies again: once is the
    machine's failure, but an agent must not escape a bad episode by killing its desktop. An error
    without a cause counts.
    """
    if record["status"] != "error":
        return record["status"] == "ok"
    cause = record.get("cause", "agent")
    return cause == "agent" or (cause == "machine" and (record.get("attempt") or 0) > 0)


def score_value(record: ResultRecord) -> float:
    """Return the score (0..1) of a record that counts; that of an error is 0."""
    return float(record["score"]) if record["status"] == "ok" else 0.0


def first_id(record: ResultRecord) -> str:
    """Return the id of the first attempt at the episode of a record."""
    return episode_slug(record["task"], record["corruption"], record["seed"], record["agent"], 0)
