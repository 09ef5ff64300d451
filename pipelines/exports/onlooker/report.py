"""What an export for an onlooker did."""

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any


@dataclass
class OnlookerReport:
    """The result of an export.

    Args:
        out: the folder.
        dialect: how actions are written.
        balance: frames without a reminder that were asked for, for each that has one.
        reminders: frames with a reminder, by corruption.
        none: frames without one, by why they were drawn: `same_step`, `clean`, `picture`, `event`.
        short: frames without a reminder that were asked for and are not there.
        summaries: summaries by corruption.
        recovery: recovery steps by corruption.
        hidden: recovery steps that were left out because their target does not show, by corruption.
        skipped: what else was left out, by reason.
    """

    out: str
    dialect: str
    balance: float
    reminders: Counter[str] = field(default_factory=Counter[str])
    none: Counter[str] = field(default_factory=Counter[str])
    short: int = 0
    summaries: Counter[str] = field(default_factory=Counter[str])
    recovery: Counter[str] = field(default_factory=Counter[str])
    hidden: Counter[str] = field(default_factory=Counter[str])
    skipped: Counter[str] = field(default_factory=Counter[str])

    to = "onlooker"

    @property
    def total(self) -> int:
        """All examples."""
        return sum(sum(part.values()) for part in (self.reminders, self.none, self.summaries, self.recovery))

    @property
    def exit_code(self) -> int:
        """0 when there are examples, else 1."""
        return 0 if self.total else 1

    def to_data(self) -> dict[str, Any]:
        """JSON data of the report."""
        names = ("reminders", "none", "summaries", "recovery", "hidden", "skipped")
        counts = {name: dict(getattr(self, name)) for name in names}
        about_it = {"out": self.out, "to": self.to, "dialect": self.dialect, "total": self.total}
        return {**about_it, "balance": self.balance, "short": self.short, **counts}

    def lines(self) -> list[str]:
        """The report as lines of text."""
        with_, without = sum(self.reminders.values()), sum(self.none.values())
        text = [f"{self.out}: {self.total} examples ({self.to}, actions in {self.dialect})"]
        text.append(f"  reminders: {with_} frames with one ({_listed(self.reminders)})")
        text.append(f"  reminders: {without} frames without ({_listed(self.none)})")
        if self.short:
            text.append(f"  reminders: {self.short} more frames without one were asked for and are not in the dataset")
        text += [f"  {name}: {_listed(getattr(self, name)) or 0}" for name in ("summaries", "recovery")]
        text += [f"  {label}: {count} recovery step(s) left out, target hidden" for label, count in self.hidden.items()]
        return text + [f"  left out {count}: {reason}" for reason, count in self.skipped.items()]


def _listed(counts: Mapping[str, int]) -> str:
    return ", ".join(f"{name} {count}" for name, count in counts.items())
