"""The page of `hijack stats -o`: the figures, and a few pictures of each corruption, before and after, in one file."""

import html
import os
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from string import Template

from hijack_data.gallery.embed import embed, scale_for
from hijack_data.gallery.markup import Html, clean, join, wrap
from hijack_data.gallery.markup import source as gallery_source
from hijack_data.plan import CLEAN, Plan
from hijack_data.types import UInt8Array

from .columns import BASE
from .dataset import Dataset, open_dataset, shard_rows
from .lazy import decoded
from .stats import BINS, LabelStats, Stats, changed_text

PAIRS = 3
WIDTH = 720
_PAGE = Path(__file__).parent / "page"


@dataclass(frozen=True)
class Place:
    """Where a row is, and where the clean row of its step is, if there is one."""

    row: int
    clean: int | None


def page(folder: str | os.PathLike[str], found: Stats) -> str:
    """Return the page of a dataset: one file without a single outside request. The same dataset gives the same bytes.

    Raises `DatasetError` when a row that is shown is damaged.
    """
    rows = open_dataset(folder)
    head, *notes = found.lines()
    return _fill(
        "stats.html",
        title=Path(os.path.abspath(folder)).name,
        style=Html(gallery_source("page.css") + _source("stats.css")),
        lead=head.partition(": ")[2],
        rows=join([_line(label, stats) for label, stats in found.labels.items()]),
        legend=join([Html(f'<span class="k{k}">{name}</span>') for k, name in enumerate(BINS)]),
        notes=wrap("li", notes),
        sections=join([_section(rows, label, places) for label, places in _places(rows, found).items()]),
        content=rows.fingerprint[:16],
    )


def _line(label: str, found: LabelStats) -> Html:
    data = found.to_data()
    listed = (", ".join(f"{k} {n}" for k, n in data[name].items()) for name in ("severity", "fidelity", "source"))
    cells = wrap("td", [label, str(found.rows), changed_text(data), *listed])
    bars = "".join(
        f'<span class="b{k}" style="flex:{count}" title="{BINS[k]}: {count}"></span>'
        for k, count in enumerate(found.visible)
        if count
    )
    return Html(f'<tr>{cells}<td><div class="shows">{bars}</div></td></tr>')


def _places(rows: Dataset, found: Stats) -> dict[str, list[Place]]:
    """Choose some rows of each corruption, spread over the dataset."""
    wanted = {
        label: {stats.rows * k // PAIRS for k in range(PAIRS)}
        for label, stats in found.labels.items()
        if label != CLEAN and stats.rows
    }
    seen = dict.fromkeys(wanted, 0)
    places: dict[str, list[Place]] = {label: [] for label in wanted}
    for label, place in _indexed(rows):
        if seen[label] in wanted[label]:
            places[label].append(place)
        seen[label] += 1
    return places


def _indexed(rows: Dataset) -> Iterator[tuple[str, Place]]:
    number = 0
    clean_row: tuple[tuple[str, int], int] | None = None
    for shard in rows.manifest["shards"]:
        for row in shard_rows(rows.folder / shard["file"], ["trajectory_id", "step", "corruption"]):
            key = (row["trajectory_id"], row["step"])
            if row["corruption"] == CLEAN:
                clean_row = key, number
            else:
                yield row["corruption"], Place(number, clean_row[1] if clean_row and clean_row[0] == key else None)
            number += 1


def _section(rows: Dataset, label: str, places: list[Place]) -> Html:
    pairs = join([_pair(rows, place) for place in places])
    return Html(f'<section><div class="heading"><h2>{_escaped(label)}</h2></div>{pairs}</section>')


def _pair(rows: Dataset, place: Place) -> Html:
    row, after = rows.pixels(place.row)
    before = _before(rows, place)
    scale = scale_for(
        max([after.shape[:2], *([] if before is None else [before.shape[:2]])], key=lambda s: s[1]), WIDTH
    )
    seen = row["target_visible"]
    facts = "" if seen is None else f", {100 * seen:.0f} % of the target shows"
    notes = "".join(f"; {note}" for note in Plan.from_json(row["plan"]).notes)
    if row["event"]:
        notes = f"; {row['fidelity']}: {row['event']} Action: {row['action_code'] or row['action']['type']}{notes}"
    figures = [] if before is None else [_figure(before, scale, "before")]
    figures.append(_figure(after, scale, f"{row['id']}: {row['changed_pixels']} pixels changed{facts}{notes}"))
    return Html(f'<div class="pair">{join(figures)}</div>')


def _before(rows: Dataset, place: Place) -> UInt8Array | None:
    stored = rows.reader[place.row]
    if BASE in stored:
        return decoded(stored, BASE)
    return None if place.clean is None else rows.pixels(place.clean)[1]


def _figure(picture: UInt8Array, scale: float, caption: str) -> Html:
    shown = embed(picture, scale)
    size = f'width="{shown.size[1]}" height="{shown.size[0]}"'
    text = _escaped(caption)
    return Html(f'<figure><img src="{shown.uri}" {size} alt="{text}"><figcaption>{text}</figcaption></figure>')


def _escaped(text: str) -> str:
    return html.escape(clean(text))


def _fill(template: str, **values: str) -> str:
    safe = {name: value if isinstance(value, Html) else _escaped(value) for name, value in values.items()}
    return Template(_source(template)).substitute(safe)


@lru_cache(maxsize=8)
def _source(name: str) -> str:
    return (_PAGE / name).read_text(encoding="utf-8")
