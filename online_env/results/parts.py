"""What a scoring run says beside the table of the report: parts of steps, reminders, summaries."""

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
    """Return what is known beside the success, by agent and corruption.

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
        {"agent": agent, "corruption": label, "n": len(found), **_of(found)}
        for (agent, label), found in groups.items()
    ]


def _of(found: Sequence[ResultRecord]) -> PartsRow:
    if found[0].get("question") == "reminders":
        return _reminders(found)
    if found[0].get("question") == "summaries":
        return {}
    return _steps(found)


def _steps(found: Sequence[ResultRecord]) -> PartsRow:
    """Return the share of steps in which each part is right, of those that have the part.

    An agent that failed at a row has no part right; which parts the row has is not known then, so
    it counts in `type` alone.
    """
    row: PartsRow = {}
    for name in PARTS:
        right = [_part(record, name) for record in found]
        row[name] = _mean([value for value in right if value is not None])
    row["malformed"] = fmean(bool(record.get("malformed")) for record in found)
    shown = [record["target_visible"] for record in found if _has_target(record)]
    row["hidden"] = sum(share < _HIDDEN for share in shown)
    return row


def _part(record: ResultRecord, name: str) -> float | None:
    parts: Mapping[str, bool] | None = record.get("parts")
    if parts is None:
        return 0.0 if name == "type" else None
    return float(parts[name]) if name in parts else None


def _has_target(record: ResultRecord) -> bool:
    return isinstance(record.get("target_visible"), int | float)


def _reminders(found: Sequence[ResultRecord]) -> PartsRow:
    """Return precision, recall, F1 and the rate of false alarms.

    An onlooker that failed at a row is taken to have given no reminder.
    """
    needed = [record for record in found if _is(record, "needed")]
    given = [record for record in found if _is(record, "given")]
    hits = [record for record in needed if _is(record, "given")]
    alarms = len(given) - len(hits)
    return {
        "precision": _share(len(hits), len(given)),
        "recall": _share(len(hits), len(needed)),
        "f1": _share(2 * len(hits), len(given) + len(needed)),
        "false_alarms": _share(alarms, len(found) - len(needed)),
    }


def _share(part: int, whole: int) -> float | None:
    return part / whole if whole else None


def _is(record: ResultRecord, name: str) -> bool:
    return record.get(name) is True


def _mean(values: Sequence[float]) -> float | None:
    return fmean(values) if values else None
