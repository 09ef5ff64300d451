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

from openpyxl.styles import Font, PatternFill
from openpyxl.worksheet.formula import ArrayFormula
from PIL import Image

from hijack_data.rng import Stream
from online_env.tasks import get
from online_env.tasks.folder_desktop import FolderDesktop
from online_env.tasks.kit import documents, sheets, slides
from online_env.tasks.kit.office import dump
from online_env.tasks.kit.sample_reports import report
from online_env.tasks.kit.sample_talks import talk
from online_env.tasks.machine import Machine

ROWS = [("Item", "Price"), ("lamp", 2.5), ("rope", 4)]


def made_book(**cells):
    result = sheets.book({"Stock": ROWS, "Other": [("Only",)]})
    for address, value in cells.items():
        result["Stock"][address] = value
    return result


def content(made) -> sheets.BookContent:
    return sheets.read_book(dump(made))


def test_a_workbook_is_read_as_it_was_made() -> None:
    result = content(made_book())
    assert result.sheets == ("Stock", "Other")
    assert result.values("Stock")["B2"] == 2.5
    assert result.values("Other") == {"A1": "Only"}
    assert result.cells["Stock", "A1"].marks == ("bold",)
    assert result.cells["Stock", "A2"].marks == ()
    assert result.value("Z9") is None


def test_a_formula_has_a_value_only_if_one_was_stored() -> None:
    data = dump(made_book(B4="=SUM(B2:B3)"))
    assert sheets.read_book(data).value("B4") is None
    book = sheets.read_book(sheets.with_values(data, {"B4": 6.5}))
    assert (book.entry("B4"), book.value("B4")) == ("=SUM(B2:B3)", 6.5)


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
        lambda book: setattr(book["Stock"]["A2"], "font", Font(italic=True)),
        lambda book: setattr(book["Stock"]["A2"], "fill", PatternFill("solid", "FFFF00")),
        lambda book: setattr(book["Stock"].row_dimensions[2], "hidden", True),
        lambda book: setattr(book["Stock"].column_dimensions["B"], "hidden", True),
        lambda book: setattr(book["Other"], "sheet_state", "hidden"),
        lambda book: book["Stock"].merge_cells("B5:C6"),
        lambda book: book.create_sheet("New"),
        lambda book: book.remove(book["Other"]),
    ):
        result = made_book()
        change(result)
        assert list(sheets.changes(content(result), before)) != []


def test_the_format_of_numbers_does_not_count_where_a_text_is() -> None:
    result = made_book()
    result["Stock"]["B1"].number_format = "0%"
    assert list(sheets.changes(content(result), content(made_book()))) == []


def test_frozen_is_where_the_view_was_split_and_not_to_where_it_was_scrolled() -> None:
    result = made_book()
    result["Stock"].freeze_panes = "A2"
    view = result["Stock"].sheet_view
    view.pane.topLeftCell = "A30"
    view.topLeftCell = "C1"
    assert content(result).frozen == {"Stock": "A2", "Other": None}
    view.topLeftCell = "A9"  # row 9 is frozen, and not row 1
    assert content(result).frozen["Stock"] == "A9:A2"
    view.pane.state = "split"
    assert content(result).frozen["Stock"] is None


def test_a_cell_far_below_is_read_at_once() -> None:
    result = content(made_book(XFD1048576=1))
    assert result.values("Stock")["XFD1048576"] == 1


@pytest.mark.parametrize(
    ("entry", "is_used"),
    [
        ("=B3*C3", True),
        ("=$C$3*B3+0", True),
        ("=PRODUCT(B3:C3)", True),
        ("=Stock!B3*Stock!C3", True),
        ("=B:B*C:C", True),
        ("=Pieces*Price", True),
        ("=12*3.5", False),
        ("=B3*3.5", False),
        ("=B3*C2", False),
        ("=B13*C13", False),
        ("B3*C3", False),
        (4.5, False),
        (None, False),
    ],
)
def test_cells_that_a_formula_uses(entry: sheets.CellValue, is_used: bool) -> None:
    assert sheets.uses(entry, "B3", "C3") == is_used


def test_a_formula_that_was_entered_for_several_cells_is_in_each_of_them() -> None:
    formula = ArrayFormula("C2:C3", "=B2:B3*2")
    result = content(made_book(C2=formula, C3=8))
    assert [result.entry(cell) for cell in ("C2", "C3")] == ["=B2:B3*2"] * 2
    assert result.value("C3") == 8


@pytest.mark.parametrize("found", ["2.5", None, True, 2.51])
def test_what_is_no_number_or_another_one(found: sheets.CellValue) -> None:
    assert not sheets.is_number(found, 2.5)
    assert sheets.is_number(2.5 + 1e-9, 2.5)


def test_a_text_is_read_as_it_was_made() -> None:
    text = documents.read_text(dump(documents.document("Title of it", ["One.", "Two.", ""])))
    assert [paragraph.text for paragraph in text.paragraphs] == ["Title of it", "One.", "Two."]
    assert [paragraph.style for paragraph in text.paragraphs] == ["Title", "Normal", "Normal"]
    assert text.landscape == (False,)
    assert text.sizes == ((8.5, 11.0),)


def test_a_text_shows_bold_parts_list_items_tables_and_headers() -> None:
    result = documents.document("T", ["One.", "Two."])
    result.paragraphs[1].add_run(" bold").bold = True
    result.paragraphs[1].add_run(" ")
    result.paragraphs[1].add_run("words").style = result.styles["Strong"]
    result.paragraphs[1].add_run(" plain").bold = False
    result.paragraphs[2].style = result.styles["List Bullet"]
    result.sections[0].footer.paragraphs[0].text = "page"
    result.add_table(1, 2).cell(0, 1).text = "x"
    result.add_paragraph("below")
    text = documents.read_text(dump(result))
    assert text.paragraphs[1].bold == ("bold words",)
    assert [paragraph.marker for paragraph in text.paragraphs] == ["", "", "bullet", ""]
    assert (text.headers, text.footers) == (("",), ("page",))
    assert text.tables == ((("", "x"),),)
    assert text.after_table == "below"


def test_a_text_is_read_as_it_was_typed() -> None:
    result = documents.document("T", ["Ada O\u2019Neill said \u201cno\u201d. "])
    jc = result.paragraphs[1]._p.get_or_add_pPr()._add_jc()
    jc.set(documents._WORD + "val", "start")  # LibreOffice's other docx
    text = documents.read_text(dump(result))
    assert text.paragraphs[1].text == 'Ada O\'Neill said "no".'
    assert text.paragraphs[1].alignment == ""


@pytest.mark.parametrize("mark", ["italic", "underline", "strike", "superscript"])
def test_text_changes_sees_what_else_was_done_to_letters(mark: str) -> None:
    before = documents.read_text(dump(documents.document("T", ["One."])))
    result = documents.document("T", ["One."])
    font = result.paragraphs[1].runs[0].font
    setattr(font, mark, False)
    assert list(documents.text_changes(documents.read_text(dump(result)), before)) == []
    setattr(font, mark, True)
    assert len(list(documents.text_changes(documents.read_text(dump(result)), before))) == 1


def test_text_changes_says_what_differs() -> None:
    before = documents.read_text(dump(documents.document("T", ["One.", "Two."])))
    assert list(documents.text_changes(before, before)) == []
    now = documents.replace_paragraph(before, "One.", style="Heading 1")
    assert list(documents.text_changes(now, before)) == [
        "the style of paragraph 2 is 'Heading 1', not 'Normal'"
    ]
    assert list(documents.text_changes(now, before, {"style"})) == []
    turned = replace(before, landscape=(True,))
    assert list(documents.text_changes(turned, before)) == [
        "the landscape are (True,), not (False,)"
    ]


def test_slides_are_read_as_they_were_made() -> None:
    result = slides.presentation([("A", "one\ntwo"), ("B", "")])
    result.slides[1].notes_slide.notes_text_frame.text = "slowly"
    slides.order_slides(result, [1, 0])
    assert slides.read_slides(dump(result)) == (
        slides.SlideContent(title="B", notes="slowly"),
        slides.SlideContent(title="A", texts=("one\ntwo",)),
    )


def test_slides_show_what_was_put_on_them_and_whether_they_are_hidden() -> None:
    result = slides.presentation([("Ada O\u2019Neill ", "one \n"), ("B", "two"), ("C", "")])
    result.slides[0].shapes.add_shape(1, 0, 0, 9, 9)
    result.slides[1]._element.set("show", "0")
    result.slides[1].placeholders[1].text_frame.paragraphs[0].runs[0].font.italic = True
    fill = result.slides[2].background.fill
    fill.solid()
    fill.fore_color.theme_color = 5
    assert slides.read_slides(dump(result)) == (
        slides.SlideContent(title="Ada O'Neill", texts=("one",), shapes=1),
        slides.SlideContent(title="B", texts=("two",), marks=("italic",), hidden=True),
        slides.SlideContent(title="C", background="of a theme"),
    )


def test_the_icon_that_impress_saves_for_an_empty_place_is_no_picture() -> None:
    result = slides.presentation([("A", "one")])
    for size, name in ((slides.PLACE_ICON, ""), (slides.PLACE_ICON, "Icon"), ((90, 71), "")):
        picture = io.BytesIO()
        Image.new("RGB", size).save(picture, "PNG")
        result.slides[0].shapes.add_picture(picture, 0, 0).name = name
    (read,) = slides.read_slides(dump(result))
    assert read.shapes == 2


def test_slide_changes_says_what_differs() -> None:
    before = (slides.SlideContent(title="A"), slides.SlideContent(title="B"))
    assert list(slides.slide_changes(before, before)) == []
    assert len(list(slides.slide_changes(before[:1], before))) == 1
    noted = (before[0], replace(before[1], notes="x"))
    assert list(slides.slide_changes(noted, before)) == ["the notes of slide 2 are 'x'"]


@pytest.mark.parametrize("data", [b"", b"text", b"zip of another kind", b"zip of no XML"])
def test_a_result_that_cannot_be_read_is_a_problem_and_no_error(tmp_path, data: bytes) -> None:
    if data.startswith(b"zip"):
        stream = io.BytesIO()
        with zipfile.ZipFile(stream, "w") as zip_file:
            name = "content.xml" if data.endswith(b"kind") else "[Content_Types].xml"
            zip_file.writestr(name, "<a/>" if data.endswith(b"kind") else "<a>")
        data = stream.getvalue()
    for name in ("sum_column", "style_heading", "add_slide"):
        task = get(name)
        machine = Machine(FolderDesktop(tmp_path))
        task.prepare(machine)
        machine.remember()
        machine.write(task.values.path, data)
        assert "another format" in next(task.problems(machine))


def test_what_seeds_draw_differs() -> None:
    for draw in (report, talk):
        assert len({repr(draw(Stream(seed, "test"))) for seed in range(20)}) == 20


def test_lines_of_a_report_can_be_found_by_their_text() -> None:
    for seed in range(20):
        variables = report(Stream(seed, "test"))
        full_text = "\n".join([variables["title"], *variables["paragraphs"]]).lower()
        for text in (*variables["lines"], *variables["bodies"], *variables["items"]):
            assert full_text.count(text.lower()) == 1
