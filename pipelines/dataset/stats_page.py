"""The page of `hijack stats -o`: the figures and a few pictures of each corruption, in one file."""

import html
import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from string import Template
from typing import Any

from hijack_data.errors import quantity
from hijack_data.gallery.data_uris import embed, scale_for
from hijack_data.gallery.markup import Html, clean, join, wrap
from hijack_data.gallery.markup import source as gallery_source
from hijack_data.plan import CLEAN, Plan
from hijack_data.types import UInt8Array

from .columns import BASE, VISIBLE
from .lazy_rows import decode_column
from .opening import Dataset, open_dataset, shard_rows
from .stats import BINS, LabelStats, Stats, changed_text, percent_text

PAIRS = 3
WIDTH = 720
NO_TARGET = "no target"
_PAGE = Path(__file__).parent / "page"


@dataclass(frozen=True)
class RowLinks:
    """The number of a row, that of its step's clean row, and the visible share of its target."""

    row: int
    clean: int | None
    visible: float | None = None


def page(folder: str | os.PathLike[str], stats: Stats) -> str:
    """Return the page of a dataset as HTML that makes no network requests.

    The same dataset gives the same bytes.

    Args:
        folder: the dataset.
        stats: its figures, from `stats.stats`.

    Raises:
        DatasetError: a row to be shown is damaged.
    """
    rows = open_dataset(folder)
    lines = [_line(label, label_stats) for label, label_stats in stats.labels.items()]
    names = enumerate((*BINS, NO_TARGET))
    legend = [Html(f'<span class="k{k}">{name}</span>') for k, name in names]
    row_links = _places(rows, stats)
    sections = [_section(rows, label, label_places) for label, label_places in row_links.items()]
    return _fill(
        "stats.html",
        title=f"Dataset {Path(os.path.abspath(folder)).name}",
        style=Html(gallery_source("page.css") + _source("stats.css")),
        figures=_figures(stats),
        rows=join(lines),
        legend=join(legend),
        left=_left_out(stats),
        sections=join(sections),
        content=rows.fingerprint[:16],
    )


def _figures(stats: Stats) -> Html:
    """Return the cards with the main figures of the dataset."""
    rejected = sum(stats.counts["rejected"].values())
    files = quantity(stats.shards, "file")
    trajectories = quantity(stats.trajectories, "trajectory", "trajectories")
    figures = [
        _number(quantity(stats.rows, "row"), f"{stats.output}, {files}"),
        _number(quantity(stats.steps, "step"), f"of {trajectories}"),
        _number(f"{stats.bytes / 1e6:,.1f} MB", "on disk"),
        _number(quantity(rejected, "input"), "rejected"),
    ]
    return join(figures)


def _number(figure: str, caption: str) -> Html:
    return Html(f"<li><strong>{_escape(figure)}</strong><span>{_escape(caption)}</span></li>")


def _line(label: str, label_stats: LabelStats) -> Html:
    if not label_stats.rows:
        name = _escape(label)
        return Html(f'<tr><td class="no">{name}</td><td class="no" colspan="6">no rows</td></tr>')
    data = label_stats.to_data()
    levels: dict[str, int] = {}
    for level, count in data["severity"].items():
        levels["no level" if level == "None" else f"level {level}"] = count
    changed_share = _changed_share(label, data)
    listed = (_counts_text(levels), _counts_text(data["fidelity"]), _counts_text(data["source"]))
    cells = wrap("td", [label, f"{label_stats.rows:,}", changed_share, *listed])
    bars = _bars([*label_stats.visible, data["without_target"]])
    return Html(f'<tr>{cells}<td><div class="shows">{bars}</div></td></tr>')


def _bars(shares: list[int]) -> str:
    """Return the bar of a corruption: one part for each visible share that occurs."""
    text = ""
    for k, name in enumerate((*BINS, NO_TARGET)):
        count = shares[k]
        if count:
            text += f'<span class="b{k}" style="flex:{count}" title="{name}: {count:,}"></span>'
    return text


def _changed_share(label: str, data: dict[str, Any]) -> str:
    if label == CLEAN:
        return "\u2013"
    if data["changed"]["min"] == 1:
        return "all"  # resized, or another screen
    return changed_text(data)


def _counts_text(counts: dict[str, int]) -> str:
    if list(counts) == ["no level"]:
        return "\u2013"
    if len(counts) == 1:
        return next(iter(counts))
    return ", ".join(f"{name}: {count:,}" for name, count in counts.items())


def _left_out(stats: Stats) -> Html:
    """Return a card for each corruption with events, and one for each with steps without a row."""
    cards: list[Html] = []
    for label, label_stats in stats.labels.items():
        cards += _card(f"{label}: what happened", _events(label_stats))
        cards += _card(f"{label}: steps without a row", _reasons(stats, label))
    return join(cards)


def _card(title: str, texts: list[str]) -> list[Html]:
    if not texts:
        return []
    items = wrap("li", texts)
    return [Html(f'<li class="tile"><h3>{_escape(title)}</h3><ul>{items}</ul></li>')]


def _events(stats: LabelStats) -> list[str]:
    events: list[str] = []
    for event, count in sorted(stats.event.items()):
        events.append(f"{quantity(count, 'row')}: {event}")
    if stats.inserted:
        events.append(f"{quantity(stats.inserted, 'step')} inserted")
    if stats.reminders:
        events.append(f"{quantity(stats.reminders, 'row')} with a reminder")
    return events


def _reasons(stats: Stats, label: str) -> list[str]:
    notes: list[str] = []
    for reason, count in stats.counts["not_applicable"].get(label, {}).items():
        notes.append(f"{quantity(count, 'step')}: {reason}")
    dropped = stats.counts["dropped"].get(label, 0)
    if dropped:
        notes.append(f"{quantity(dropped, 'row')} dropped: the target does not show")
    return notes


def _places(rows: Dataset, stats: Stats) -> dict[str, list[RowLinks]]:
    """Choose rows of each corruption: the one with the least visible target, and others spread."""
    spread: dict[str, list[int]] = {}
    for label, label_stats in stats.labels.items():
        if label != CLEAN and label_stats.rows:
            spread[label] = [label_stats.rows * k // PAIRS for k in range(PAIRS)]
    rows_passed = dict.fromkeys(spread, 0)
    row_links: dict[str, dict[int, RowLinks]] = {label: {} for label in spread}
    hidden: dict[str, tuple[int, RowLinks]] = {}
    for label, links in _index_rows(rows):
        number = rows_passed[label]
        rows_passed[label] += 1
        if number in spread[label]:
            row_links[label][number] = links
        least = hidden[label][1].visible if label in hidden else 1.0
        if links.visible is not None and least is not None and links.visible < least:
            hidden[label] = number, links
    for label, (number, links) in hidden.items():
        label_places = row_links[label]
        if number not in label_places:
            label_places.pop(max(label_places))
        row_links[label] = {number: links, **label_places}
    return {label: list(label_places.values()) for label, label_places in row_links.items()}


def _index_rows(rows: Dataset) -> Iterator[tuple[str, RowLinks]]:
    """Yield the label and the links of each corrupted row."""
    columns = ["trajectory_id", "step", "corruption", "target_visible"]
    number = 0
    clean_step: tuple[str, int] | None = None
    clean_row = 0
    for shard in rows.manifest["shards"]:
        for row in shard_rows(rows.folder / shard["file"], columns):
            step = (row["trajectory_id"], row["step"])
            if row["corruption"] == CLEAN:
                clean_step = step
                clean_row = number
            else:
                clean = clean_row if clean_step == step else None
                yield row["corruption"], RowLinks(number, clean, row["target_visible"])
            number += 1


def _section(rows: Dataset, label: str, row_links: list[RowLinks]) -> Html:
    pairs = join([_pair(rows, links) for links in row_links])
    heading = f'<div class="heading"><h2>{_escape(label)}</h2></div>'
    return Html(f'<section>{heading}<div class="cards">{pairs}</div></section>')


def _pair(rows: Dataset, links: RowLinks) -> Html:
    """Return the card of a row: its pictures and its facts."""
    row, after = rows.pixels(links.row)
    before = _before(rows, links)
    pictures = {"after": after} if before is None else {"before": before, "after": after}
    largest = max((picture.shape[:2] for picture in pictures.values()), key=_width)
    scale = scale_for(largest, WIDTH)
    figures = [_figure(picture, scale, name, row["id"]) for name, picture in pictures.items()]
    resized = before is not None and before.shape != after.shape
    name = _escape(row["id"])
    title = _escape(row["instruction"] or row["id"])
    facts = wrap("li", _facts(row, resized))
    head = f'<div class="head"><h3>{title}</h3>{_badge(row["target_visible"])}</div>'
    text = f'<p class="id">{name}</p><ul class="facts">{facts}</ul>'
    body = f'<div class="pair">{join(figures)}</div><div class="told">{text}</div>'
    return Html(f'<article class="tile">{head}{body}</article>')


def _width(size: tuple[int, int]) -> int:
    return size[1]


def _badge(share: float | None) -> str:
    """Return a mark for a target that is not wholly visible."""
    if share is None or share >= 1:
        return ""
    kind = "hidden" if share < VISIBLE else "partly"
    return f'<span class="chip {kind}">{percent_text(share)} shows</span>'


def _facts(row: Mapping[str, Any], resized: bool) -> list[str]:
    change = f"all pixels, resized to {row['width']}\u00d7{row['height']}"
    if not resized:
        change = f"{quantity(row['changed_pixels'], 'pixel')} changed"
    share = row["target_visible"]
    if share is not None:
        change += f", {percent_text(share)} of the target shows"
    facts = [change]
    if row["event"]:
        facts.append(f"{row['fidelity']}: {row['event']}")
    action = row["action_code"] or row["action"]["type"]
    facts.append(f"Action: {action}")
    return [*facts, *Plan.from_json(row["plan"]).notes]


def _before(rows: Dataset, links: RowLinks) -> UInt8Array | None:
    stored = rows.reader[links.row]
    if BASE in stored:
        return decode_column(stored, BASE)
    if links.clean is None:
        return None
    return rows.pixels(links.clean)[1]


def _figure(picture: UInt8Array, scale: float, caption: str, name: str) -> Html:
    image = embed(picture, scale)
    size = f'width="{image.size[1]}" height="{image.size[0]}"'
    alt = _escape(f"{name}: {caption}")
    return Html(
        f'<figure><img src="{image.uri}" {size}'
        f' alt="{alt}"><figcaption>{caption}</figcaption></figure>'
    )


def _escape(text: str) -> str:
    return html.escape(clean(text))


def _fill(template: str, **values: str) -> str:
    safe: dict[str, str] = {}
    for name, value in values.items():
        safe[name] = value if isinstance(value, Html) else _escape(value)
    return Template(_source(template)).substitute(safe)


@lru_cache(maxsize=8)
def _source(name: str) -> str:
    return (_PAGE / name).read_text(encoding="utf-8")
