"""Reports of builds and of checks, as text and as exit codes."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

from hijack_data.errors import quantity

MAX_SHOWN_INPUTS = 5
MAX_SHOWN_PROBLEMS = 20


@dataclass
class Findings:
    """The result of a check.

    Args:
        folder: the folder that was checked.
        problems: the problems found; empty if there are none.
    """

    folder: str
    problems: list[str] = field(default_factory=list[str])

    @property
    def ok(self) -> bool:
        """Whether no problem was found."""
        return not self.problems

    @property
    def exit_code(self) -> int:
        """0 if no problem was found, otherwise 1."""
        return 0 if self.ok else 1

    def listed(self) -> list[str]:
        """Return the first problems as lines of text, then the number of the remaining ones."""
        text = [f"  {problem}" for problem in self.problems[:MAX_SHOWN_PROBLEMS]]
        hidden = len(self.problems) - MAX_SHOWN_PROBLEMS
        if hidden > 0:
            text.append(f"  and {hidden} more")
        return text


def transparency_note(count: int) -> Iterator[str]:
    """Yield the remark about `count` pictures with transparent pixels, if there are any."""
    if count:
        yield (
            f"{quantity(count, 'picture')} with transparent pixels, which are read in the colours"
            " that they hide; save screenshots without an alpha channel"
        )


@dataclass(frozen=True, kw_only=True)
class BuildReport:
    """The result of a build.

    Args:
        out: the folder of the dataset.
        rows: number of rows by label, in the order of the build.
        rejected: number of inputs that were left out; `quarantine.jsonl` lists all of them.
        examples: the first rejected inputs, as text.
        not_applicable: for each label, the number of samples on which the corruption could not be
            placed, by reason.
        dropped: number of samples that the label policy dropped, by label.
        shards: number of files, newly written or kept.
        kept: number of files that an earlier run had finished.
        notes: further remarks for the user.
        dry_run: whether nothing was written, so that the report describes what a build would write.
    """

    out: str
    rows: Mapping[str, int]
    rejected: int
    examples: tuple[str, ...]
    not_applicable: Mapping[str, Mapping[str, int]]
    dropped: Mapping[str, int]
    shards: int
    kept: int
    notes: tuple[str, ...] = ()
    dry_run: bool = False

    @property
    def total(self) -> int:
        """All rows."""
        return sum(self.rows.values())

    @property
    def exit_code(self) -> int:
        """0 if every input was read and there are rows, otherwise 1."""
        return 1 if self.rejected or not self.total else 0

    def to_data(self) -> dict[str, Any]:
        """Return the report as JSON data."""
        reasons = {label: dict(counts) for label, counts in self.not_applicable.items()}
        return {
            "out": self.out,
            "rows": self.total,
            "rows_by_corruption": dict(self.rows),
            "rejected": self.rejected,
            "not_applicable": reasons,
            "dropped": dict(self.dropped),
            "shards": self.shards,
            "kept": self.kept,
            "notes": list(self.notes),
            "dry_run": self.dry_run,
        }

    def lines(self) -> list[str]:
        """Return the report as lines of text."""
        text = [self._head()]
        for label, count in self.rows.items():
            text.append(f"  {label}: {count}")
        if not self.total:
            text.append("  there is no row: load_dataset refuses an empty dataset")
        text += self._left_out()
        text += self._rejected()
        text += [f"  note: {note}" for note in self.notes]
        return text

    def _head(self) -> str:
        would = "nothing was written; it would be " if self.dry_run else ""
        kept_text = f", {self.kept} of them kept from before" if self.kept else ""
        size = f"{quantity(self.total, 'row')} in {quantity(self.shards, 'file')}"
        return f"{self.out}: {would}{size}{kept_text}"

    def _left_out(self) -> list[str]:
        """Return the samples that gave no row, by label and reason."""
        text: list[str] = []
        for label, reasons in self.not_applicable.items():
            for reason, count in reasons.items():
                text.append(f"  {label}: not applicable to {quantity(count, 'step')}: {reason}")
        for label, count in self.dropped.items():
            text.append(f"  {label}: {count} dropped, their target does not show")
        return text

    def _rejected(self) -> list[str]:
        if not self.rejected:
            return []
        location = "" if self.dry_run else f", see {self.out}/quarantine.jsonl"
        text = [f"  {quantity(self.rejected, 'input')} rejected{location}:"]
        text += [f"    {example}" for example in self.examples]
        if self.rejected > len(self.examples):
            text.append("    ...")
        return text
