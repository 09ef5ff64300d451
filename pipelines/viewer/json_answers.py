"""The answers to the page, as JSON data: the source, a page of rows, one row and its neighbours."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from hijack_data.errors import HijackError

from .index import Index, RowNumbers
from .source import INSERTED, Detail, ViewerSource

PAGE_ROWS = 48
# Longer lists of choices are cut; the search finds the rest.
CHOICES = 500
NOT_FILTERS = ("page", "q", "row")


def about(source: ViewerSource) -> dict[str, Any]:
    """Return the title, the facts and the filters of the source."""
    return {
        "title": source.title,
        "facts": source.facts,
        "problems": source.problems,
        "rows": len(source.index),
        "filters": source.labels,
    }


def rows(source: ViewerSource, query: Mapping[str, str]) -> dict[str, Any]:
    """Return a page of the rows that match, and the number of rows of each choice of each filter.

    Args:
        source: the dataset or the run.
        query: a value for each filter, `q` (text) and `page` (from 1). An unknown filter is an
            `UnknownNameError`.
    """
    filters, text = _filters(query)
    found = source.index.select(filters, text)
    pages = max(1, -(-len(found) // PAGE_ROWS))
    page = min(max(1, _number(query.get("page", ""), 1)), pages)
    start = (page - 1) * PAGE_ROWS
    shown = found[start : start + PAGE_ROWS]
    counts = source.index.counts(filters, text, source.labels)
    return {
        "found": len(found),
        "page": page,
        "pages": pages,
        "rows": [_glance(source, place) for place in shown.tolist()],
        "filters": {name: _choices(values, filters.get(name)) for name, values in counts.items()},
    }


def row(source: ViewerSource, query: Mapping[str, str]) -> dict[str, Any]:
    """Return one row and its neighbours: matching rows, and rows of its trajectory and step.

    Args:
        source: the dataset or the run.
        query: that of `rows`, and `row`: a number or an id. An unknown row is a `HijackError`.
    """
    index = source.index
    place = _place(source, query.get("row", ""))
    filters, text = _filters(query)
    found = index.select(filters, text)
    at = int(np.searchsorted(found, place))
    matches = at < len(found) and bool(found[at] == place)
    following = at + 1 if matches else at
    steps = index.trajectory(place)
    step = int(np.flatnonzero(steps == place)[0])
    return {
        **_tile(source, place),
        "trajectory": index.value("trajectory", place),
        "found": len(found),
        "position": at if matches else None,
        "page": at // PAGE_ROWS + 1 if matches else None,
        "back": _row_at(source, found, at - 1),
        "next": _row_at(source, found, following),
        "step_back": _row_at(source, steps, step - 1),
        "step_next": _row_at(source, steps, step + 1),
        "steps": [_step_link(index, other) for other in steps.tolist()],
        "same_step": [_corruption_link(index, other) for other in index.same_step(place).tolist()],
        "detail": vars(_detail(source, int(index.rows[place]))),
    }


def _step_link(index: Index, place: int) -> list[Any]:
    return [int(index.rows[place]), f"{_mark(index, place)}{index.steps[place]}"]


def _corruption_link(index: Index, place: int) -> list[Any]:
    return [int(index.rows[place]), _mark(index, place) + index.value("corruption", place)]


def _detail(source: ViewerSource, number: int) -> Detail:
    try:
        return source.detail(number)
    except HijackError as error:
        return Detail(problem=str(error), no_before="the row cannot be read")


def _tile(source: ViewerSource, place: int) -> dict[str, Any]:
    index = source.index
    chips = {name: index.value(name, place) for name in source.chips}
    return {
        "row": int(index.rows[place]),
        "id": index.ids[place],
        "title": f"{index.value('trajectory', place)} \u00b7 step {index.steps[place]}",
        "instruction": index.value("instruction", place),
        "chips": {name: value for name, value in chips.items() if value},
    }


def _glance(source: ViewerSource, place: int) -> dict[str, Any]:
    """Return what a tile shows of a row: the action, and its place on the picture."""
    try:
        detail = source.glance(int(source.index.rows[place]))
    except HijackError:  # its picture says why, in its place
        detail = Detail()
    action = detail.action or detail.code
    return {
        **_tile(source, place),
        "action": action,
        "size": detail.size,
        "box": detail.box,
        "points": detail.points,
    }


def _mark(index: Index, place: int) -> str:
    """Return the mark of a step that an event inserted before the recorded step of its number."""
    if "inserted" in index.columns and index.value("inserted", place) == INSERTED:
        return "+"
    return ""


def _filters(query: Mapping[str, str]) -> tuple[dict[str, str], str]:
    """Return the filters and the text of a query."""
    filters = {name: value for name, value in query.items() if name not in NOT_FILTERS}
    return filters, query.get("q", "")


def _choices(counts: Mapping[str, int], chosen: str | None) -> dict[str, Any]:
    values: list[list[Any]] = []
    for value, count in counts.items():
        if value and (count or value == chosen):
            values.append([value, count])
    kept = [choice for k, choice in enumerate(values) if k < CHOICES or choice[0] == chosen]
    return {"values": kept, "more": len(values) - len(kept)}


def _place(source: ViewerSource, name: str) -> int:
    # return the place in the index of a row, named by its number or its id
    index = source.index
    number = _number(name, -1)
    place = None
    if number >= 0:
        place = index.at(number)
    elif name in index.ids:
        place = index.ids.index(name)
    if place is None:
        raise HijackError(f"there is no row {name!r} here; give a number from 0 or an id")
    return place


def _number(text: str, otherwise: int) -> int:
    if text.isascii() and text.isdigit() and len(text) < 10:
        return int(text)
    return otherwise


def _row_at(source: ViewerSource, places: RowNumbers, at: int) -> int | None:
    if not 0 <= at < len(places):
        return None
    return int(source.index.rows[places[at]])
