"""The page of `hijack stats -o`: the figures and a few pictures of each corruption, in one file."""

import html
import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from string import Template
from typing import Any

from hijack_data.errors import counted
from hijack_data.gallery.data_uris import embed, scale_for
from hijack_data.gallery.markup import Html, clean, join, wrap
from hijack_data.gallery.markup import source as gallery_source
from hijack_data.plan import CLEAN, Plan
from hijack_data.types import UInt8Array

from .columns import BASE, VISIBLE
from .lazy_rows import decode_column
from .opening import Dataset, open_dataset, shard_rows
from .stats import BINS, LabelStats, Stats, changed_text

PAIRS = 3
WIDTH = 720
NO_TARGET = "no target"
_PAGE = Path(__file__).parent / "page"


@dataclass(frozen=True)
class RowLinks:
    """The number of a row, that of its step's clean row, and the visible share of its target."""

    row: int
    clean: int | None
    seen: float | None = None


def page(folder: str | os.PathLike[str], found: Stats) -> str:
    """Return the page of a dataset as HTML that makes no network requests.

    The same dataset gives the same bytes. Raises `DatasetError` if a row to be shown is damaged.
    """
    rows = open_dataset(folder)
    lines = [_line(label, stats) for label, stats in found.labels.items()]
    names = enumerate((*BINS, NO_TARGET))
    legend = [Html(f'<span class="k{k}">{name}</span>') for k, name in names]
    places = _places(rows, found)
    sections = [_section(rows, label, chosen) for label, chosen in places.items()]
    return _fill(
        "stats.html",
        title=f"Dataset {Path(os.path.abspath(folder)).name}",
        style=Html(gallery_source("page.css") + _source("stats.css")),
        figures=_figures(found),
        rows=join(lines),
        legend=join(legend),
        left=_left_out(found),
        sections=join(sections),
        content=rows.fingerprint[:16],
    )


def _figures(found: Stats) -> Html:
    """Return the cards with the main figures of the dataset."""
    rejected = sum(found.counts["rejected"].values())
    files = counted(found.shards, "file")
    trajectories = counted(found.trajectories, "trajectory", "trajectories")
    figures = [
        _number(counted(found.rows, "row"), f"{found.output}, {files}"),
        _number(counted(found.steps, "step"), f"of {trajectories}"),
        _number(f"{found.bytes / 1e6:,.1f} MB", "on disk"),
        _number(counted(rejected, "input"), "rejected"),
    ]
    return join(figures)


def _number(much: str, what: str) -> Html:
    return Html(f"<li><strong>{_escaped(much)}</strong><span>{_escaped(what)}</span></li>")


def _line(label: str, found: LabelStats) -> Html:
    if not found.rows:
        name = _escaped(label)
        return Html(f'<tr><td class="no">{name}</td><td class="no" colspan="6">no rows</td></tr>')
    data = found.to_data()
    levels: dict[str, int] = {}
    for level, count in data["severity"].items():
        levels["no level" if level == "None" else f"level {level}"] = count
    changed = _changed(label, data)
    listed = (_listed(levels), _listed(data["fidelity"]), _listed(data["source"]))
    cells = wrap("td", [label, f"{found.rows:,}", changed, *listed])
    bars = _bars([*found.visible, data["without_target"]])
    return Html(f'<tr>{cells}<td><div class="shows">{bars}</div></td></tr>')


def _bars(shares: list[int]) -> str:
    """Return the bar of a corruption: one part for each visible share that occurs."""
    text = ""
    for k, name in enumerate((*BINS, NO_TARGET)):
        count = shares[k]
        if count:
            text += f'<span class="b{k}" style="flex:{count}" title="{name}: {count:,}"></span>'
    return text


def _changed(label: str, data: dict[str, Any]) -> str:
    if label == CLEAN:
        return "\u2013"
    if data["changed"]["min"] == 1:
        return "all, resized"
    return changed_text(data)


def _listed(counts: dict[str, int]) -> str:
    if list(counts) == ["no level"]:
        return "\u2013"
    if len(counts) == 1:
        return next(iter(counts))
    return ", ".join(f"{name}: {count:,}" for name, count in counts.items())


def _left_out(found: Stats) -> Html:
    """Return a card for each corruption with events, and one for each with steps without a row."""
    cards: list[Html] = []
    for label, stats in found.labels.items():
        cards += _card(f"{label}: what happened", _events(stats))
        cards += _card(f"{label}: steps without a row", _reasons(found, label))
    return join(cards)


def _card(title: str, texts: list[str]) -> list[Html]:
    if not texts:
        return []
    items = wrap("li", texts)
    return [Html(f'<li class="tile"><h3>{_escaped(title)}</h3><ul>{items}</ul></li>')]


def _events(stats: LabelStats) -> list[str]:
    events: list[str] = []
    for event, count in sorted(stats.event.items()):
        events.append(f"{counted(count, 'row')}: {event}")
    if stats.inserted:
        events.append(f"{counted(stats.inserted, 'step')} inserted")
    if stats.reminders:
        events.append(f"{counted(stats.reminders, 'row')} with a reminder")
    return events


def _reasons(found: Stats, label: str) -> list[str]:
    notes: list[str] = []
    for reason, count in found.counts["not_applicable"].get(label, {}).items():
        notes.append(f"{counted(count, 'step')}: {reason}")
    dropped = found.counts["dropped"].get(label, 0)
    if dropped:
        notes.append(f"{counted(dropped, 'row')} dropped: the target does not show")
    return notes


def _places(rows: Dataset, found: Stats) -> dict[str, list[RowLinks]]:
    """Choose rows of each corruption: the one with the least visible target, and others spread."""
    spread: dict[str, list[int]] = {}
    for label, stats in found.labels.items():
        if label != CLEAN and stats.rows:
            spread[label] = [stats.rows * k // PAIRS for k in range(PAIRS)]
    seen = dict.fromkeys(spread, 0)
    places: dict[str, dict[int, RowLinks]] = {label: {} for label in spread}
    hidden: dict[str, tuple[int, RowLinks]] = {}
    for label, place in _indexed(rows):
        number = seen[label]
        seen[label] += 1
        if number in spread[label]:
            places[label][number] = place
        least = hidden[label][1].seen if label in hidden else 1.0
        if place.seen is not None and least is not None and place.seen < least:
            hidden[label] = number, place
    for label, (number, place) in hidden.items():
        chosen = places[label]
        if number not in chosen:
            chosen.pop(max(chosen))
        places[label] = {number: place, **chosen}
    return {label: list(chosen.values()) for label, chosen in places.items()}


def _indexed(rows: Dataset) -> Iterator[tuple[str, RowLinks]]:
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


def _section(rows: Dataset, label: str, places: list[RowLinks]) -> Html:
    pairs = join([_pair(rows, place) for place in places])
    heading = f'<div class="heading"><h2>{_escaped(label)}</h2></div>'
    return Html(f'<section>{heading}<div class="cards">{pairs}</div></section>')


def _pair(rows: Dataset, place: RowLinks) -> Html:
    """Return the card of a row: its pictures and its facts."""
    row, after = rows.pixels(place.row)
    before = _before(rows, place)
    pictures = {"after": after} if before is None else {"before": before, "after": after}
    largest = max((picture.shape[:2] for picture in pictures.values()), key=_width)
    scale = scale_for(largest, WIDTH)
    figures = [_figure(picture, scale, name, row["id"]) for name, picture in pictures.items()]
    resized = before is not None and before.shape != after.shape
    name = _escaped(row["id"])
    title = _escaped(row["instruction"] or row["id"])
    facts = wrap("li", _facts(row, resized))
    head = f'<div class="head"><h3>{title}</h3>{_badge(row["target_visible"])}</div>'
    text = f'<p class="id">{name}</p><ul class="facts">{facts}</ul>'
    body = f'<div class="pair">{join(figures)}</div><div class="told">{text}</div>'
    return Html(f'<article class="tile">{head}{body}</article>')


def _width(size: tuple[int, int]) -> int:
    return size[1]


def _badge(seen: float | None) -> str:
    """Return a mark for a target that is not wholly visible."""
    if seen is None or seen >= 1:
        return ""
    kind = "hidden" if seen < VISIBLE else "partly"
    return f'<span class="chip {kind}">{100 * seen:.0f} % shows</span>'


def _facts(row: Mapping[str, Any], resized: bool) -> list[str]:
    changed = f"all pixels, resized to {row['width']}\u00d7{row['height']}"
    if not resized:
        changed = f"{counted(row['changed_pixels'], 'pixel')} changed"
    seen = row["target_visible"]
    if seen is not None:
        changed += f", {100 * seen:.0f} % of the target shows"
    facts = [changed]
    if row["event"]:
        facts.append(f"{row['fidelity']}: {row['event']}")
    action = row["action_code"] or row["action"]["type"]
    facts.append(f"Action: {action}")
    return [*facts, *Plan.from_json(row["plan"]).notes]


def _before(rows: Dataset, place: RowLinks) -> UInt8Array | None:
    stored = rows.reader[place.row]
    if BASE in stored:
        return decode_column(stored, BASE)
    if place.clean is None:
        return None
    return rows.pixels(place.clean)[1]


def _figure(picture: UInt8Array, scale: float, caption: str, name: str) -> Html:
    shown = embed(picture, scale)
    size = f'width="{shown.size[1]}" height="{shown.size[0]}"'
    alt = _escaped(f"{name}: {caption}")
    return Html(
        f'<figure><img src="{shown.uri}" {size}'
        f' alt="{alt}"><figcaption>{caption}</figcaption></figure>'
    )


def _escaped(text: str) -> str:
    return html.escape(clean(text))


def _fill(template: str, **values: str) -> str:
    safe: dict[str, str] = {}
    for name, value in values.items():
        safe[name] = value if isinstance(value, Html) else _escaped(value)
    return Template(_source(template)).substitute(safe)


@lru_cache(maxsize=8)
def _source(name: str) -> str:
    return (_PAGE / name).read_text(encoding="utf-8")
