"""Charts of the measurements, as HTML that follows the theme and fits a phone.

Every number is read from benchmarks/RESULTS.md or from the paper's table; none is written here.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from html import escape

from tables import number, paper, table

import hijack_data as hj


@dataclass(frozen=True)
class Bar:
    """One bar: its name, its value, how the value is written, and whether it stands out."""

    name: str
    value: float
    text: str
    strong: bool = False


@dataclass(frozen=True)
class Legend:
    """What the two colours of a chart mean; the page draws a swatch of each beside its name."""

    strong: str
    plain: str


SUCCESS_LEGEND = Legend("clean", "corrupted")
LEVELS_LEGEND = Legend("level 3, the default", "other levels")


def chart(title: str, bars: Sequence[Bar], note: str = "", legend: Legend | None = None) -> str:
    """Return a chart of horizontal bars from 0; those of negative values grow to the left.

    A legend shows the colours themselves, so its text holds in every theme.

    Raises:
        ValueError: Bars have two colours and there is no legend.
    """
    low = min([0.0, *(bar.value for bar in bars)])
    high = max([0.0, *(bar.value for bar in bars)])
    span = (high - low) or 1
    zero = -100 * low / span  # percent of the width
    kinds = {bar.strong for bar in bars}
    if legend is None and len(kinds) > 1:
        raise ValueError(f"{title}: has bars of two colours and no legend; give one")
    rows: list[str] = []
    for bar in bars:
        width = 100 * abs(bar.value) / span
        left = zero - width if bar.value < 0 else zero
        kind = (" strong" if bar.strong else "") + (" negative" if bar.value < 0 else "")
        rows.append(
            f'<div class="bar{kind}" role="listitem"><span class="what">{escape(bar.name)}</span>'
            f'<span class="track" style="--zero:{zero:.1f}%">'
            f'<i style="margin-left:{left:.1f}%;width:{width:.1f}%"></i></span>'
            f'<span class="value">{escape(bar.text)}</span></div>'
        )
    keys = ""
    if legend is not None:
        swatches = ((" strong", legend.strong), ("", legend.plain))
        keys = "".join(
            f'<span class="key{kind}"><i></i>{escape(name)}</span>' for kind, name in swatches
        )
        keys = f'<div class="keys">{keys}</div>'
    below = f"<p>{escape(note)}</p>" if note else ""
    body = "".join(rows)
    axis = " signed" if low < 0 else ""
    return (
        f'<figure class="chart{axis}"><figcaption>{escape(title)}</figcaption>{keys}'
        f'<div role="list">{body}</div>{below}</figure>\n'
    )


def success(agent: str) -> str:
    """What the paper measured for one agent, under each corruption."""
    (row,) = [row for row in paper() if row["agent"] == agent]
    bars = [
        Bar(condition, float(value), f"{value} %", condition == "clean")
        for condition, value in row.items()
        if condition != "agent"
    ]
    note = "Success on OSWorld's tasks as the paper reports it; not measured by this repository."
    return chart(f"{agent}: tasks solved", bars, note, SUCCESS_LEGEND)


def hidden_targets() -> str:
    """How often a level hides a target, over the corruptions."""
    rows = table("Severity levels, measured", "target hidden", "level").rows
    bars: list[Bar] = []
    for row in rows:
        share = number(row["target hidden"])
        name = f"{row['corruption']}, level {row['level']}"
        bars.append(Bar(name, share, f"{share:g} %", row["level"] == "3"))
    ordered = sorted(bars, key=lambda bar: -bar.value)
    note = "Share of targets of which less than half stays visible; level 3 is the paper's default."
    return chart("Targets hidden, by corruption and level", ordered, note, LEVELS_LEGEND)


def levels(corruption: str) -> str:
    """How much of the screen the levels of one corruption change; empty if it has none."""
    rows = table("Severity levels, measured", "changed", "level").rows
    bars = [
        Bar(
            f"level {row['level']}",
            number(row["changed"]),
            row["changed"].replace("%", " %"),
            row["level"] == "3",
        )
        for row in rows
        if row["corruption"] == corruption
    ]
    return chart("Share of the screen that changes", bars, legend=LEVELS_LEGEND) if bars else ""


def drawing() -> str:
    """Drawing in place, against a copy of the picture."""
    rows = table("Drawing in place, against one memcpy of the picture", "draw / memcpy").rows
    bars = [
        Bar(
            f"{row['corruption']}, {row['backend']}",
            number(row["draw / memcpy"]),
            row["draw / memcpy"],
            "NumPy" in row["backend"],
        )
        for row in rows
    ]
    return chart(
        "Drawing, in copies of the picture (memcpy = 1)",
        bars,
        "Less is faster.",
        Legend("NumPy", "torch and JAX"),
    )


def resizing() -> str:
    """Resizing to one half, against Pillow and torch."""
    rows = table("Resizing, against torch and Pillow", "scale", "who", "time").rows
    bars = [
        Bar(
            row["who"],
            number(row["time"]),
            f"{number(row['time']):.1f} ms",
            row["who"].startswith("ours"),
        )
        for row in rows
        if row["scale"] == "0.5"
    ]
    return chart(
        "Resizing 1920x1080 to one half, one thread",
        bars,
        "Least of 15 runs.",
        Legend("this library", "others"),
    )


def building() -> str:
    """Rows a second of a full rebuild, ours and with Pillow."""
    rows = table("Building and reading datasets", "ours", "Pillow", "ratio").rows
    bars = [Bar(row["corruption"], number(row["ratio"]), row["ratio"]) for row in rows]
    note = "Decode, corrupt, encode, write to Parquet: how many times as fast as Pillow alone."
    return chart("Building a dataset, against Pillow", bars, note)


def peers() -> str:
    """Augmentation, against other libraries."""
    title = "Training-time augmentation, against other libraries"
    rows = table(title, "who", "work", "peer / ours").rows
    bars: list[Bar] = []
    for row in rows:
        ratio = row["peer / ours"]
        if not ratio.endswith("x"):
            continue
        name = f"{row['who'].rpartition(' ')[0]}: {row['work']}"
        bars.append(Bar(name, number(ratio), ratio, number(ratio) < 1))
    ordered = sorted(bars, key=lambda bar: -bar.value)
    note = "Time of the other library over ours, for one 1080p picture."
    legend = Legend("faster than ours (below 1x)", "slower than ours")
    return chart("Augmentation, against other libraries", ordered, note, legend)


def desktop() -> str:
    """How soon an embedded desktop is ready."""
    rows = table("The embedded desktop", "what", "min / median / max").rows
    bars: list[Bar] = []
    for row in rows:
        cell = row["min / median / max"]
        if not row["what"].startswith(("up", "reset", "down")):
            continue
        seconds = number(cell) * (0.001 if cell.endswith("ms") else 1)
        bars.append(Bar(row["what"], seconds, f"{seconds:.3g} s"))
    return chart("An embedded desktop, until it is ready", bars, "Least of the runs.")


def proof() -> str:
    """What training with some corruptions gives."""
    result = table("Is the augmentation worth using?", "evaluated on", "difference in points")
    bars = [
        Bar(
            f"{row['evaluated on']}: {row['corruption'].strip('*')}",
            number(row["difference in points"]),
            row["difference in points"],
            number(row["difference in points"]) > 0,
        )
        for row in result.rows
    ]
    note = "Points of clicks inside the right control, with 95 % intervals."
    return chart(result.said.replace("*", ""), bars, note, Legend("gain", "loss or no change"))


def page() -> str:
    """The page of charts."""
    parts = [
        "# Figures\n",
        "Made from the tables of [benchmarks/RESULTS.md](results.md), which name the machine, the"
        " versions and the command that repeats each measurement.\n",
        "## What corruptions cost agents\n",
        "The paper's own measurement, in percent of tasks.\n",
        success("UI-TARS-1.5-7B"),
        success("Gemini-2.5-Pro"),
        success("AgentHijack-Agent"),
        "## Which corruption hides targets most\n",
        "Measured for the four corruptions of the picture. Of the others, a lock screen and a"
        " minimised window hide everything.\n",
        hidden_targets(),
        "## Speed\n",
        drawing(),
        resizing(),
        building(),
        peers(),
        desktop(),
        "## Training\n",
        proof(),
        "[How this was measured](proof.md).\n",
    ]
    return "\n".join(parts)


def results_of_the_paper() -> str:
    """The page with the paper's table."""
    rows = paper()
    head = " | ".join(rows[0])
    rule = "|".join(["---"] * len(rows[0]))
    lines = [f"| {' | '.join(row.values())} |" for row in rows]
    named = ", ".join(f"`{name}`" for name in hj.corruption_names()[:9])
    return "\n".join(
        [
            "# The paper's table\n",
            "The table is the paper's: success in percent on OSWorld's tasks, clean and under each"
            f" of the nine ({named}). This repository has not run these models.\n",
            f"| {head} |",
            f"|{rule}|",
            *lines,
            "",
            "To measure your own agent, see [Score my agent](score_my_agent.md) and"
            " [Score my model](score_my_model.md); [the benchmark](benchmark.md) says how its"
            " intervals and tests are made. [All results](results/index.md).\n",
        ]
    )
