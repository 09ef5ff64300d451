"""What tasks on office documents share: reading and comparing workbooks, texts and slides."""

import io
import zipfile
from dataclasses import replace

import pytest

from support import needs

pytest.importorskip("starlette", reason=needs.ONLINE)
pytest.importorskip("openpyxl", reason=needs.ONLINE)
pytest.importorskip("docx", reason=needs.ONLINE)
pytest.importorskip("pptx", reason=needs.ONLINE)

from hijack_data.rng import Stream
from online_env.tasks import get
from online_env.tasks.folder import FolderDesktop
from online_env.tasks.kit import documents, sheets, slides
from online_env.tasks.kit.office import dump
from online_env.tasks.kit.prose import report
from online_env.tasks.kit.talks import talk
from online_env.tasks.machine import Machine

ROWS = [("Item", "Price"), ("lamp", 2.5), ("rope", 4)]


def made_book(**cells):
    made = sheets.book({"Stock": ROWS, "Other": [("Only",)]})
    for address, value in cells.items():
        made["Stock"][address] = value
    return made


def content(made) -> sheets.BookContent:
    return sheets.read_book(dump(made))


def test_a_workbook_is_read_as_it_was_made() -> None:
    found = content(made_book())
    assert found.sheets == ("Stock", "Other")
    assert found.rows() == ROWS
    assert found.rows("Other") == [("Only",)]
    assert found.cells["Stock", "A1"].bold
    assert not found.cells["Stock", "A2"].bold
    assert found.value("Z9") is None


def test_a_formula_has_a_value_only_if_one_was_stored() -> None:
    data = dump(made_book(B4="=SUM(B2:B3)"))
    assert sheets.read_book(data).value("B4") is None
    found = sheets.read_book(sheets.with_values(data, {"B4": 6.5}))
    assert (found.entry("B4"), found.value("B4")) == ("=SUM(B2:B3)", 6.5)


def test_changes_names_the_cell_and_leaves_out_what_may_differ() -> None:
    before = content(made_book())
    now = content(made_book(B2=3, C1="new"))
    assert [line.partition(" ")[0] for line in sheets.changes(now, before)] == ["B2", "C1"]
    assert list(sheets.changes(now, before, {"B2", "Stock!C1"})) == []
    assert list(sheets.changes(before, before)) == []


def test_changes_sees_formats_freezing_hiding_and_sheets() -> None:
    before = content(made_book())
    for change in (
        lambda book: setattr(book["Stock"]["B2"], "number_format", "0%"),
        lambda book: setattr(book["Stock"], "freeze_panes", "A2"),
        lambda book: setattr(book["Stock"].row_dimensions[2], "hidden", True),
        lambda book: book.create_sheet("New"),
        lambda book: book.remove(book["Other"]),
    ):
        made = made_book()
        change(made)
        assert list(sheets.changes(content(made), before)) != []


@pytest.mark.parametrize("found", ["2.5", None, True, 2.51])
def test_what_is_no_number_or_another_one(found: sheets.CellValue) -> None:
    assert not sheets.is_number(found, 2.5)
    assert sheets.is_number(2.5 + 1e-9, 2.5)


def test_a_text_is_read_as_it_was_made() -> None:
    found = documents.read_text(dump(documents.document("Title of it", ["One.", "Two.", ""])))
    assert [paragraph.text for paragraph in found.paragraphs] == ["Title of it", "One.", "Two."]
    assert [paragraph.style for paragraph in found.paragraphs] == ["Title", "Normal", "Normal"]
    assert found.landscape == (False,)
    assert found.sizes == ((8.5, 11.0),)


def test_a_text_shows_bold_parts_list_items_tables_and_headers() -> None:
    made = documents.document("T", ["One.", "Two."])
    made.paragraphs[1].add_run(" bold").bold = True
    made.paragraphs[1].add_run(" words").bold = True
    made.paragraphs[2].style = made.styles["List Bullet"]
    made.sections[0].footer.paragraphs[0].text = "page"
    made.add_table(1, 2).cell(0, 1).text = "x"
    made.add_paragraph("below")
    found = documents.read_text(dump(made))
    assert found.paragraphs[1].bold == (" bold words",)
    assert [paragraph.marker for paragraph in found.paragraphs] == ["", "", "bullet", ""]
    assert (found.headers, found.footers) == (("",), ("page",))
    assert found.tables == ((("", "x"),),)
    assert found.after_table == "below"


def test_text_changes_says_what_differs() -> None:
    before = documents.read_text(dump(documents.document("T", ["One.", "Two."])))
    assert list(documents.text_changes(before, before)) == []
    now = documents.changed(before, "One.", style="Heading 1")
    assert list(documents.text_changes(now, before)) == [
        "the style of paragraph 2 is 'Heading 1', not 'Normal'"
    ]
    assert list(documents.text_changes(now, before, {"style"})) == []
    turned = replace(before, landscape=(True,))
    assert list(documents.text_changes(turned, before)) == [
        "the landscape are (True,), not (False,)"
    ]


def test_slides_are_read_as_they_were_made() -> None:
    made = slides.presentation([("A", "one\ntwo"), ("B", "")])
    made.slides[1].notes_slide.notes_text_frame.text = "slowly"
    slides.order_slides(made, [1, 0])
    assert slides.read_slides(dump(made)) == (
        slides.SlideContent(title="B", notes="slowly"),
        slides.SlideContent(title="A", texts=("one\ntwo",)),
    )


def test_slide_changes_says_what_differs() -> None:
    before = (slides.SlideContent(title="A"), slides.SlideContent(title="B"))
    assert list(slides.slide_changes(before, before)) == []
    assert len(list(slides.slide_changes(before[:1], before))) == 1
    noted = (before[0], replace(before[1], notes="x"))
    assert list(slides.slide_changes(noted, before)) == ["the notes of slide 2 are 'x'"]


@pytest.mark.parametrize("data", [b"", b"text", b"zip of another kind"])
def test_a_result_that_cannot_be_read_is_a_problem_and_no_error(tmp_path, data: bytes) -> None:
    if data.startswith(b"zip"):
        stream = io.BytesIO()
        with zipfile.ZipFile(stream, "w") as other:
            other.writestr("content.xml", "<a/>")
        data = stream.getvalue()
    for name in ("sum_column", "style_heading", "add_slide"):
        task = get(name)
        machine = Machine(FolderDesktop(tmp_path))
        task.prepare(machine)
        machine.remember()
        machine.write(task.drawn.path, data)
        assert "another format" in next(task.problems(machine))


def test_what_seeds_draw_differs() -> None:
    for draw in (report, talk):
        assert len({repr(draw(Stream(seed, "test"))) for seed in range(20)}) == 20


def test_lines_of_a_report_can_be_found_by_their_text() -> None:
    for seed in range(20):
        drawn = report(Stream(seed, "test"))
        whole = "\n".join([drawn["title"], *drawn["paragraphs"]]).lower()
        for text in (*drawn["lines"], *drawn["bodies"], *drawn["items"]):
            assert whole.count(text.lower()) == 1
