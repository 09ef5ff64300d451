"""Results of a scoring run for which the report's main table has no column.

These are the parts of a step that are right, and the precision and recall of reminders.
"""

from collections.abc import Iterable, Mapping, Sequence
from statistics import fmean
from typing import Any, TypeAlias

from .reading import ResultRecord
from .scores import counts, latest

PARTS = ("type", "place", "end", "text", "keys", "direction")
STEP_COLUMNS = (*PARTS, "malformed", "hidden")
REMINDER_COLUMNS = ("precision", "recall", "f1", "false_alarms")
PartsRow: TypeAlias = dict[str, Any]
_HIDDEN = 0.5  # a target of which less shows counts as hidden


def part_rows(records: Iterable[ResultRecord]) -> list[PartsRow]:
    """Return these results by agent and corruption.

    Rows about reminders also come for each agent over all corruptions, under `"all"`: with and
    without a reminder are different corruptions, so precision needs them together.
    """
    groups: dict[tuple[str, str], list[ResultRecord]] = {}
    for record in latest(records).values():
        if not counts(record):
            continue
        groups.setdefault((record["agent"], record["corruption"]), []).append(record)
        if record.get("question") == "reminders":
            groups.setdefault((record["agent"], "all"), []).append(record)
    return [
        {"agent": agent, "corruption": label, "n": len(cell), **_part_values(cell)}
        for (agent, label), cell in groups.items()
    ]


def _part_values(records: Sequence[ResultRecord]) -> PartsRow:
    if records[0].get("question") == "reminders":
        return _reminders(records)
    if records[0].get("question") == "summaries":
        return {}
    return _steps(records)


def _steps(records: Sequence[ResultRecord]) -> PartsRow:
    """Return the share of steps in which each part is right, of those that have the part.

    An agent that failed at a row has no part right; which parts the row has is not known then, so
    it counts in `type` alone.
    """
    row: PartsRow = {}
    for name in PARTS:
        values = [_part(record, name) for record in records]
        row[name] = _mean([value for value in values if value is not None])
    row["malformed"] = fmean(bool(record.get("malformed")) for record in records)
    shares = [record["target_visible"] for record in records if _has_target(record)]
    row["hidden"] = sum(share < _HIDDEN for share in shares)
    return row


def _part(record: ResultRecord, name: str) -> float | None:
    parts: Mapping[str, bool] | None = record.get("parts")
    if parts is None:
        return 0.0 if name == "type" else None
    return float(parts[name]) if name in parts else None


def _has_target(record: ResultRecord) -> bool:
    return isinstance(record.get("target_visible"), int | float)


def _reminders(records: Sequence[ResultRecord]) -> PartsRow:
    """Return precision, recall, F1 and the rate of false alarms.

    An onlooker that failed at a row is taken to have given no reminder.
    """
    needing = [record for record in records if _is(record, "needed")]
    reminded = [record for record in records if _is(record, "given")]
    hits = [record for record in needing if _is(record, "given")]
    alarms = len(reminded) - len(hits)
    return {
        "precision": _share(len(hits), len(reminded)),
        "recall": _share(len(hits), len(needing)),
        "f1": _share(2 * len(hits), len(reminded) + len(needing)),
        "false_alarms": _share(alarms, len(records) - len(needing)),
    }


def _share(part: int, total: int) -> float | None:
    return part / total if total else None


def _is(record: ResultRecord, name: str) -> bool:
    return record.get(name) is True


def _mean(values: Sequence[float]) -> float | None:
    return fmean(values) if values else None
