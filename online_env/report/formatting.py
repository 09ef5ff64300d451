"""Format values in the same way everywhere: percent, points, intervals, amounts."""

from collections.abc import Iterable, Sequence

MAX_LINE = 300  # characters of a line on a terminal
# p values below this show a difference.
SIGNIFICANT_P = 0.05
_INPUT_WORDS = {
    "task": "the task",
    "plan": "the plan",
    "process": "the runner's process",
    "tree": "the tree",
    "devtools": "DevTools",
}


def percent(share: float | None, sign: str = "") -> str:
    """Return a share as percent with one digit, or nothing; `sign` may be `+`."""
    return "" if share is None else f"{100 * share:{sign}z.1f}"


def interval(low: float | None, high: float | None, sign: str = "") -> str:
    """Return the ends of an interval in percent, or nothing if one is missing."""
    if low is None or high is None:
        return ""
    return f"[{percent(low, sign)}, {percent(high, sign)}]"


def retention_interval(low: float | None, high: float | None) -> str:
    """Return the interval of a retention, which may have no upper end."""
    if low is not None and high is None:
        return f"[{percent(low)}, …)"
    return interval(low, high)


def p_value(value: float | None) -> str:
    """Return a p value with three digits; the smallest as `<0.001`."""
    if value is None:
        return ""
    return "<0.001" if value < 0.0005 else f"{value:.3f}"


def number(value: float | None, digits: int = 1) -> str:
    """Return a number with `digits` digits; empty without a number."""
    return "" if value is None else f"{value:.{digits}f}"


def count(value: int | None) -> str:
    """Return a count in short form, such as 14k or 3.3M; empty without a count."""
    if value is None:
        return ""
    for size, unit in ((10**9, "G"), (10**6, "M"), (10**3, "k")):
        if value >= 0.9995 * size:  # else it would be 1e+03 of the smaller unit
            return f"{max(value / size, 1):.3g}{unit}"
    return str(value)


def money(value: float | None) -> str:
    """Return USD with two digits; empty without a value."""
    return "" if value is None else f"{value:.2f}"


def worst(labels: Sequence[str], success: float | None) -> str:
    """Return the worst conditions and the success there; `none` if none is worse than another."""
    if success is None:
        return ""
    return f"{', '.join(labels)} {percent(success)}" if labels else "none"


def privileged_inputs(kinds: Iterable[str] | None) -> str:
    """Return what an agent was given besides instruction and pictures; empty if unknown."""
    return " and ".join(_INPUT_WORDS[kind] for kind in kinds or ())


def shorten(text: str) -> str:
    """Return a text as one line of at most `MAX_LINE` characters; records hold the whole text."""
    line = " ".join(text.split("\n"))
    return line if len(line) <= MAX_LINE else line[: MAX_LINE - 4] + " ..."
