"""JSON data for the page of a dataset: the source, a page of rows, one row and its neighbours."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from hijack_data.errors import HijackError

from .index import Index, RowNumbers
from .source import INSERTED, Detail, ViewerSource

ROWS_PER_PAGE = 48
# Longer lists of choices are cut; the search finds the rest.
MAX_CHOICES = 500
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
        query: a value for each filter, `q` (text) and `page` (from 1).

    Raises:
        UnknownNameError: there is no such filter.
    """
    filters, text = _filters(query)
    matches = source.index.select(filters, text)
    pages = max(1, -(-len(matches) // ROWS_PER_PAGE))
    page = min(max(1, _number(query.get("page", ""), 1)), pages)
    start = (page - 1) * ROWS_PER_PAGE
    page_positions = matches[start : start + ROWS_PER_PAGE]
    counts = source.index.counts(filters, text, source.labels)
    return {
        "found": len(matches),
        "page": page,
        "pages": pages,
        "rows": [_glance(source, position) for position in page_positions.tolist()],
        "filters": {name: _choices(values, filters.get(name)) for name, values in counts.items()},
    }


def row(source: ViewerSource, query: Mapping[str, str]) -> dict[str, Any]:
    """Return one row and its neighbours: matching rows, and rows of its trajectory and step.

    Args:
        source: the dataset or the run.
        query: that of `rows`, and `row`: a number or an id.

    Raises:
        UnknownNameError: there is no such filter.
        HijackError: there is no such row.
    """
    index = source.index
    position = _find_position(source, query.get("row", ""))
    filters, text = _filters(query)
    positions = index.select(filters, text)
    at = int(np.searchsorted(positions, position))
    matches = at < len(positions) and bool(positions[at] == position)
    following = at + 1 if matches else at
    steps = index.trajectory(position)
    step = int(np.flatnonzero(steps == position)[0])
    return {
        **_tile(source, position),
        "trajectory": index.value("trajectory", position),
        "found": len(positions),
        "position": at if matches else None,
        "page": at // ROWS_PER_PAGE + 1 if matches else None,
        "back": _row_at(source, positions, at - 1),
        "next": _row_at(source, positions, following),
        "step_back": _row_at(source, steps, step - 1),
        "step_next": _row_at(source, steps, step + 1),
        "steps": [_step_link(index, step_position) for step_position in steps.tolist()],
        "same_step": [
            _corruption_link(index, row_position)
            for row_position in index.same_step(position).tolist()
        ],
        "detail": vars(_detail(source, int(index.rows[position]))),
    }


def _step_link(index: Index, position: int) -> list[Any]:
    return [int(index.rows[position]), f"{_mark(index, position)}{index.steps[position]}"]


def _corruption_link(index: Index, position: int) -> list[Any]:
    return [int(index.rows[position]), _mark(index, position) + index.value("corruption", position)]


def _detail(source: ViewerSource, number: int) -> Detail:
    try:
        return source.detail(number)
    except HijackError as error:
        return Detail(problem=str(error), no_before="the row cannot be read")


def _tile(source: ViewerSource, position: int) -> dict[str, Any]:
    index = source.index
    chips = {name: index.value(name, position) for name in source.chips}
    return {
        "row": int(index.rows[position]),
        "id": index.ids[position],
        "title": f"{index.value('trajectory', position)} \u00b7 step {index.steps[position]}",
        "instruction": index.value("instruction", position),
        "chips": {name: value for name, value in chips.items() if value},
    }


def _glance(source: ViewerSource, position: int) -> dict[str, Any]:
    """Return what a tile shows of a row: the action, and its place on the picture."""
    try:
        detail = source.glance(int(source.index.rows[position]))
    except HijackError:  # the tile shows the error instead of the picture
        detail = Detail()
    action = detail.action or detail.code
    return {
        **_tile(source, position),
        "action": action,
        "size": detail.size,
        "box": detail.box,
        "points": detail.points,
    }


def _mark(index: Index, position: int) -> str:
    """Return the mark of a step that an event inserted before the recorded step of its number."""
    if "inserted" in index.columns and index.value("inserted", position) == INSERTED:
        return "+"
    return ""


def _filters(query: Mapping[str, str]) -> tuple[dict[str, str], str]:
    """Return the filters and the text of a query."""
    filters = {name: value for name, value in query.items() if name not in NOT_FILTERS}
    return filters, query.get("q", "")


def _choices(counts: Mapping[str, int], selected: str | None) -> dict[str, Any]:
    values: list[list[Any]] = []
    for value, count in counts.items():
        if value and (count or value == selected):
            values.append([value, count])
    choices = [
        choice for k, choice in enumerate(values) if k < MAX_CHOICES or choice[0] == selected
    ]
    return {"values": choices, "more": len(values) - len(choices)}


def _find_position(source: ViewerSource, name: str) -> int:
    # return the position of a row in the index, named by its number or its id
    index = source.index
    number = _number(name, -1)
    position = None
    if number >= 0:
        position = index.at(number)
    elif name in index.ids:
        position = index.ids.index(name)
    if position is None:
        raise HijackError(f"there is no row {name!r} here; give a number from 0 or an id")
    return position


def _number(text: str, otherwise: int) -> int:
    if text.isascii() and text.isdigit() and len(text) < 10:
        return int(text)
    return otherwise


def _row_at(source: ViewerSource, places: RowNumbers, at: int) -> int | None:
    if not 0 <= at < len(places):
        return None
    return int(source.index.rows[places[at]])
