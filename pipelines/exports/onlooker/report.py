"""The report of an export for an onlooker."""

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from hijack_data.errors import quantity


@dataclass
class OnlookerReport:
    """The result of an export.

    Args:
        out: the folder.
        dialect: how actions are written.
        balance: frames without a reminder that were asked for, for each that has one.
        reminders: frames with a reminder, by corruption.
        none: frames without one, by the reason for drawing them: `same_step`, `clean`, `picture`,
            `event`.
        short: frames without a reminder that were asked for but are not in the dataset.
        summaries: summaries by corruption.
        recovery: recovery steps by corruption.
        hidden: recovery steps that were left out because their target does not show, by corruption.
        skipped: other examples that were left out, by reason.
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
        """Number of examples."""
        parts = (self.reminders, self.none, self.summaries, self.recovery)
        return sum(part.total() for part in parts)

    @property
    def exit_code(self) -> int:
        """0 if there are examples, otherwise 1."""
        return 0 if self.total else 1

    def to_data(self) -> dict[str, Any]:
        """Return the report as JSON data."""
        names = ("reminders", "none", "summaries", "recovery", "hidden", "skipped")
        counts = {name: dict(getattr(self, name)) for name in names}
        return {
            "out": self.out,
            "to": self.to,
            "dialect": self.dialect,
            "total": self.total,
            "balance": self.balance,
            "short": self.short,
            **counts,
        }

    def lines(self) -> list[str]:
        """Return the report as lines of text."""
        lines = [
            f"{self.out}: {self.total} examples ({self.to}, actions in {self.dialect})",
            f"  reminders: {self.reminders.total()} frames with one"
            f" ({_counts_text(self.reminders)})",
            f"  reminders: {self.none.total()} frames without ({_counts_text(self.none)})",
        ]
        if self.short:
            lines.append(
                f"  reminders: {self.short} more frames without one were asked for and are not in"
                " the dataset"
            )
        lines.append(f"  summaries: {_counts_text(self.summaries) or 0}")
        lines.append(f"  recovery: {_counts_text(self.recovery) or 0}")
        for label, count in self.hidden.items():
            lines.append(f"  {label}: {quantity(count, 'recovery step')} left out, target hidden")
        for reason, count in self.skipped.items():
            lines.append(f"  left out {count}: {reason}")
        return lines


def _counts_text(counts: Mapping[str, int]) -> str:
    return ", ".join(f"{name} {count}" for name, count in counts.items())
