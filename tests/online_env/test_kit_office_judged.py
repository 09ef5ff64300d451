"""What the judges of workbooks and slides see, and what they forgive: one change at a time."""

import tracemalloc
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from typing import Any

import pytest

from support import needs

pytest.importorskip("starlette", reason=needs.ONLINE)
pytest.importorskip("openpyxl", reason=needs.ONLINE)
pytest.importorskip("pptx", reason=needs.ONLINE)

from openpyxl.styles import Font, PatternFill
from openpyxl.worksheet.formula import ArrayFormula

from online_env.tasks.kit import sheets, slides
from online_env.tasks.kit.office import dump

ROWS = [("Item", "Price"), ("lamp", 2.5), ("rope", 4)]


def made_book() -> Any:
    return sheets.book({"Stock": ROWS, "Other": [("Only",)]})


@cache
def book_before() -> sheets.BookContent:
    return sheets.read_book(dump(made_book()))


def book_changes(change: Callable[[Any], object], *but: str, **options: bool) -> list[str]:
    """Return what is told of a workbook in which something was changed."""
    result = made_book()
    change(result)
    return list(sheets.changes(sheets.read_book(dump(result)), book_before(), but, **options))


# Workbooks


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (lambda book: book["Stock"].merge_cells("A5:B6"), "cells of Stock were merged"),
        (lambda book: setattr(book["Other"], "freeze_panes", "A2"), "rows or columns of Other are"),
        (lambda book: setattr(book["Other"], "sheet_state", "hidden"), "hidden in Other: ('all',)"),
        (lambda book: book["Stock"].delete_cols(2), "B1 of Stock is None, not 'Price'"),
        (lambda book: setattr(book["Stock"]["B3"], "value", "4"), "B3 of Stock is '4', not 4"),
        (lambda book: setattr(book["Stock"]["B3"], "value", True), "B3 of Stock is True, not 4"),
        (lambda book: setattr(book["Other"]["A1"], "font", Font()), "A1 of Other looks otherwise"),
        (lambda book: book.move_sheet("Other", -1), "the sheets are Other, Stock"),
    ],
)
def test_each_change_of_a_workbook_is_told(change: Callable[[Any], object], told: str) -> None:
    assert book_changes(change)[0].startswith(told)


def test_a_number_may_be_stored_as_one_with_a_point() -> None:
    assert book_changes(lambda book: setattr(book["Stock"]["B3"], "value", 4.0)) == []


def test_rows_may_be_frozen_where_that_was_asked() -> None:
    def freeze(book: Any) -> None:
        book["Stock"].freeze_panes = "A2"

    assert book_changes(freeze, frozen=True) == []
    assert book_changes(freeze) == ["rows or columns of Stock are frozen"]


@pytest.mark.parametrize("place", [0, 1, 2])
def test_a_sheet_that_may_be_there_excuses_nothing_else(place: int) -> None:
    def add_and_spoil(book: Any) -> None:
        book.create_sheet("New", place)["A1"] = "anything"
        book["Stock"]["B2"] = 3
        book["Stock"]["B3"] = 5

    assert book_changes(add_and_spoil, "New", "B3") == ["B2 of Stock is 3, not 2.5"]


@pytest.mark.parametrize(
    ("look", "mark"),
    [
        ({"font": Font(bold=True)}, "bold"),
        ({"font": Font(italic=True)}, "italic"),
        ({"font": Font(underline="double")}, "underlined"),
        ({"font": Font(strike=True)}, "struck"),
        ({"fill": PatternFill("solid", "FFFF00")}, "filled"),
    ],
)
def test_what_was_done_to_the_look_of_a_cell_is_read(look: dict[str, Any], mark: str) -> None:
    result = made_book()
    for name, value in look.items():
        setattr(result["Stock"]["A2"], name, value)
    assert sheets.read_book(dump(result)).cells["Stock", "A2"].marks == (mark,)


@pytest.mark.parametrize(
    ("found", "wanted", "is_it"),
    [
        (10**12 + 1, 10**12, True),  # of 15 digits, these are the same
        (10**6 + 2, 10**6, False),
        (1e-7, 0, True),
        (1e-5, 0, False),
        (float("nan"), 0, False),
        (float("inf"), 4, False),
        (False, 0, False),
    ],
)
def test_numbers_are_as_exact_as_they_are_stored(
    found: sheets.CellValue, wanted: float, is_it: bool
) -> None:
    assert sheets.is_number(found, wanted) == is_it


def test_a_formula_for_a_whole_column_takes_no_room_for_its_empty_cells() -> None:
    result = made_book()
    result["Stock"]["C1"] = ArrayFormula("C1:C1048576", "=B1:B1048576*2")
    result["Stock"]["C3"] = 8
    data = dump(result)
    tracemalloc.start()
    book = sheets.read_book(data)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 2**24
    assert (book.entry("C1"), book.entry("C3")) == ("=B1:B1048576*2",) * 2
    assert book.entry("C2") is None


def test_cells_of_other_sheets_are_asked_for_by_name() -> None:
    result = book_before()
    assert (result.value("A1"), result.value("A1", "Other")) == ("Item", "Only")
    assert (result.entry("B2"), result.entry("B2", "Other")) == (2.5, None)


# Slides


def made_slides() -> Any:
    return slides.presentation([("A", "one"), ("B", "two")])


@cache
def slides_before() -> tuple[slides.SlideContent, ...]:
    return slides.read_slides(dump(made_slides()))


def slide_changes(change: Callable[[Any], object]) -> list[str]:
    """Return what is told of slides of which the second was changed."""
    result = made_slides()
    change(result.slides[1])
    return list(slides.slide_changes(slides.read_slides(dump(result)), slides_before()))


def first_run(slide: Any) -> Any:
    return slide.placeholders[1].text_frame.paragraphs[0].runs[0]


def paint(slide: Any) -> None:
    slide.background.fill.solid()
    slide.background.fill.fore_color.rgb = slides_color("FFCC00")


def slides_color(code: str) -> Any:
    from pptx.dml.color import RGBColor

    return RGBColor.from_string(code)


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (lambda slide: setattr(first_run(slide), "text", "three"), "the texts of slide 2 are "),
        (paint, "the background of slide 2 are 'FFCC00'"),
        (lambda slide: slide.background.fill.gradient(), "the background of slide 2 are "),
        (lambda slide: slide.shapes.add_shape(1, 0, 0, 9, 9), "the shapes of slide 2 are 1"),
        (lambda slide: slide.shapes.add_table(1, 1, 0, 0, 9, 9), "the shapes of slide 2 are 1"),
        (lambda slide: setattr(first_run(slide).font, "bold", True), "('bold',)"),
        (lambda slide: setattr(first_run(slide).font, "underline", True), "('underlined',)"),
        (lambda slide: slide._element.set("show", "false"), "the hidden of slide 2 are True"),
        (lambda slide: setattr(slide.shapes.title, "text", "C"), "the slides are ['A', 'C'], not "),
    ],
)
def test_each_change_of_a_slide_is_told(change: Callable[[Any], object], told: str) -> None:
    (problem,) = slide_changes(change)
    assert told in problem


def test_a_bold_space_changes_nothing_that_shows() -> None:
    def make_space_bold(slide: Any) -> None:
        run = slide.placeholders[1].text_frame.paragraphs[0].add_run()
        run.text, run.font.bold = " ", True

    assert slide_changes(make_space_bold) == []


def test_the_number_of_slides_counts_even_where_titles_do_not() -> None:
    before = slides_before()
    second = replace(before[0], title="other")
    assert list(slides.slide_changes((second, before[1]), before, {"title"})) == []
    items = list(slides.slide_changes(before[:1], before, {"title"}))
    assert items == ["there are 1 slides, not 2"]


def test_slides_are_put_in_order_and_left_out() -> None:
    result = slides.presentation([("A", ""), ("B", ""), ("C", "")])
    slides.order_slides(result, [2, 0])
    assert [slide.title for slide in slides.read_slides(dump(result))] == ["C", "A"]
