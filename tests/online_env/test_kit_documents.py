"""What the judges of text documents see, and what they forgive: one change at a time."""

import io
from collections.abc import Callable
from functools import cache
from typing import Any

import pytest

from support import needs

pytest.importorskip("starlette", reason=needs.ONLINE)
pytest.importorskip("docx", reason=needs.ONLINE)

from docx.enum.section import WD_ORIENT
from docx.opc.constants import RELATIONSHIP_TYPE
from docx.oxml import OxmlElement, parse_xml
from docx.oxml.ns import nsdecls, qn
from docx.shared import Pt, RGBColor
from PIL import Image

from online_env.tasks.kit import documents
from online_env.tasks.kit.office import dump


def made_text() -> Any:
    return documents.document("Title", ["One.", "Two."])


@cache
def text_before() -> documents.TextContent:
    return documents.read_text(dump(made_text()))


def changed_text(change: Callable[[Any], object]) -> documents.TextContent:
    """Return what is read of a text in which something was changed."""
    result = made_text()
    change(result)
    return documents.read_text(dump(result))


def text_changes(change: Callable[[Any], object]) -> list[str]:
    """Return what is told of a text in which something was changed."""
    return list(documents.text_changes(changed_text(change), text_before()))


def first_of(made: Any) -> documents.ParagraphContent:
    """Return what is read of the first paragraph below the title."""
    return documents.read_text(dump(made)).paragraphs[1]


@pytest.mark.parametrize(
    ("name", "change", "told"),
    [
        ("tables", lambda made: made.add_table(1, 1), "the tables are ((('',),),), not ()"),
        (
            "headers",
            lambda made: setattr(made.sections[0].header.paragraphs[0], "text", "x"),
            "the headers are ('x',), not ('',)",
        ),
        (
            "footers",
            lambda made: setattr(made.sections[0].footer.paragraphs[0], "text", "x"),
            "the footers are ('x',), not ('',)",
        ),
        (
            "bold",
            lambda made: setattr(made.paragraphs[1].runs[0], "bold", True),
            "the bold of paragraph 2 is ('One.',), not ()",
        ),
        (
            "spacing",
            lambda made: setattr(made.paragraphs[2].paragraph_format, "line_spacing", 2.0),
            "the spacing of paragraph 3 is 2.0, not 1.15",
        ),
        (
            "alignment",
            lambda made: setattr(made.paragraphs[2], "alignment", 1),
            "the alignment of paragraph 3 is 'center', not ''",
        ),
        (
            "marker",
            lambda made: setattr(
                made.paragraphs[2]._p.get_or_add_pPr().get_or_add_numPr()._add_numId(), "val", 1
            ),
            "the marker of paragraph 3 is 'bullet', not ''",
        ),
        (
            "text",
            lambda made: setattr(made.paragraphs[0], "text", "title"),
            "the text of paragraph 1 is 'title', not 'Title'",
        ),
    ],
)
def test_each_change_of_a_text_is_told_unless_it_was_asked_for(
    name: str, change: Callable[[Any], object], told: str
) -> None:
    now = changed_text(change)
    assert list(documents.text_changes(now, text_before())) == [told]
    assert list(documents.text_changes(now, text_before(), {name})) == []


def test_a_paragraph_too_many_is_told_and_empty_ones_at_the_end_are_not() -> None:
    assert text_changes(lambda made: made.add_paragraph("")) == []
    assert text_changes(lambda made: made.add_paragraph("x")) == [
        "the document has 4 paragraphs, not 3"
    ]
    assert text_changes(lambda made: documents.remove_paragraph(made, "One.")) == [
        "the document has 2 paragraphs, not 3"
    ]


def test_a_paragraph_that_is_not_there_cannot_be_removed() -> None:
    with pytest.raises(ValueError, match=r"the document has no paragraph 'Three\.'"):
        documents.remove_paragraph(made_text(), "Three.")


def test_an_alignment_has_one_name_in_both_kinds_of_docx() -> None:
    names = {
        "left": "",
        "start": "",
        "right": "right",
        "end": "right",  # as LibreOffice says it in the format of Word 2010
        "center": "center",
        "both": "both",
    }
    result = documents.document("Title", list(names))
    for paragraph in result.paragraphs[1:]:
        paragraph._p.get_or_add_pPr()._add_jc().set(qn("w:val"), paragraph.text)
    read = documents.read_text(dump(result)).paragraphs[1:]
    assert {paragraph.text: paragraph.alignment for paragraph in read} == names


def test_line_spacing_comes_from_the_paragraph_its_style_or_the_style_below() -> None:
    result = made_text()
    assert first_of(result).spacing == 1.15  # of the whole document
    result.styles["Normal"].paragraph_format.line_spacing = 1.5
    result.paragraphs[1].style = result.styles["List Bullet"]  # it is based on Normal
    assert first_of(result).spacing == 1.5
    result.paragraphs[1].paragraph_format.line_spacing = 2.0
    assert first_of(result).spacing == 2.0


def test_line_spacing_in_points_is_not_one_in_lines() -> None:
    result = made_text()
    result.paragraphs[1].paragraph_format.line_spacing = Pt(24)  # stored as the number of two lines
    assert first_of(result).spacing == 0.0


def test_a_mark_counts_if_it_shows() -> None:
    cases = (
        ("highlight", {"val": "yellow"}, True),
        ("highlight", {"val": "none"}, False),
        ("shd", {"val": "clear", "fill": "FFFF00"}, True),
        ("shd", {"val": "clear", "fill": "auto"}, False),
        ("u", {"val": "single"}, True),
        ("u", {"val": "none"}, False),
        ("i", {}, True),
        ("i", {"val": "0"}, False),
        ("strike", {"val": "false"}, False),
        ("vertAlign", {"val": "baseline"}, False),
        ("color", {"val": "auto"}, False),
    )
    result = documents.document("Title", ["text"] * len(cases))
    for paragraph, (mark, attributes, _) in zip(result.paragraphs[1:], cases, strict=True):
        element = OxmlElement(f"w:{mark}")
        for key, value in attributes.items():
            element.set(qn(f"w:{key}"), value)
        paragraph.runs[0]._r.get_or_add_rPr().append(element)
        paragraph.add_run(" ").font.superscript = True  # nobody sees it of a space
    read = documents.read_text(dump(result)).paragraphs[1:]
    expected = [(mark,) if is_seen else () for mark, _, is_seen in cases]
    assert [paragraph.marks for paragraph in read] == expected


def test_size_and_colour_count_with_their_values() -> None:
    result = made_text()
    font = result.paragraphs[1].runs[0].font
    font.size = Pt(14)
    font.color.rgb = RGBColor(255, 0, 0)
    assert first_of(result).marks == ("color FF0000", "sz 28")


def test_pictures_count_once_though_a_file_holds_them_twice() -> None:
    result = made_text()
    run = result.paragraphs[1].runs[0]
    picture = io.BytesIO()
    Image.new("RGB", (8, 8)).save(picture, "PNG")
    run.add_picture(picture)
    run._r.append(parse_xml(f"<w:object {nsdecls('w')}/>"))
    twice = (
        '<mc:AlternateContent xmlns:mc="http://schemas.openxmlformats.org/markup-compatibility/2006"'
        f" {nsdecls('w')}><mc:Choice><w:drawing/></mc:Choice>"
        "<mc:Fallback><w:pict/></mc:Fallback></mc:AlternateContent>"
    )
    run._r.append(parse_xml(twice))
    now = documents.read_text(dump(result))
    assert now.pictures == 3
    assert list(documents.text_changes(now, text_before())) == ["the pictures are 3, not 0"]


def test_what_a_list_puts_before_its_items_is_read() -> None:
    result = made_text()
    for paragraph in result.paragraphs[1:]:
        paragraph.style = result.styles["List Number"]
    result.paragraphs[2]._p.get_or_add_pPr().get_or_add_numPr()._add_numId().val = 0
    _, item, taken_out = documents.read_text(dump(result)).paragraphs
    assert (item.marker, taken_out.marker) == ("decimal", "")


def test_a_list_that_the_document_does_not_define_is_none() -> None:
    result = made_text()
    result.paragraphs[1]._p.get_or_add_pPr().get_or_add_numPr()._add_numId().val = 3
    rels = result.part.rels
    for key in [key for key in rels if rels[key].reltype == RELATIONSHIP_TYPE.NUMBERING]:
        del rels[key]
    assert first_of(result).marker == ""


def test_what_comes_after_a_table_is_what_comes_after_the_last_one() -> None:
    result = made_text()
    assert text_before().after_table == ""
    result.add_table(1, 1)
    result.add_paragraph("between")
    result.add_table(1, 1)
    assert documents.read_text(dump(result)).after_table == ""
    result.add_paragraph("one")
    result.add_paragraph("two")
    assert documents.read_text(dump(result)).after_table == "one\ntwo"


def test_pages_that_were_turned_have_their_sides_changed() -> None:
    result = made_text()
    section = result.sections[0]
    section.orientation = WD_ORIENT.LANDSCAPE
    section.page_width, section.page_height = section.page_height, section.page_width
    text = documents.read_text(dump(result))
    assert (text.landscape, text.sizes) == ((True,), ((11.0, 8.5),))


def test_only_the_paragraph_with_the_whole_text_is_changed() -> None:
    before = documents.read_text(dump(documents.document("One. Two.", ["One.", "Two."])))
    now = documents.replace_paragraph(before, "One.", bold=("One.",))
    assert [paragraph.bold for paragraph in now.paragraphs] == [(), ("One.",), ()]
