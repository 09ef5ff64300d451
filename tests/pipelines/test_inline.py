import pytest

import hijack_data as hj
from hijack_data.errors import UnknownNameError
from pipelines.building.inline_corruptions import parse
from pipelines.errors import BuildError


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("marks", {"marks": hj.Marks()}),
        (" marks , subtitle,", {"marks": hj.Marks(), "subtitle": hj.Subtitle()}),
        (
            "marks:number=10,severity=4,subtitle",
            {"marks": hj.Marks.at(4, number=10), "subtitle": hj.Subtitle()},
        ),
        (
            "marks: number = 10 ; subtitle",
            {"marks": hj.Marks(number=10), "subtitle": hj.Subtitle()},
        ),
        ("marks:as=few,number=3,marks", {"few": hj.Marks(number=3), "marks": hj.Marks()}),
        (
            'subtitle:subtitle_text="a, b; c=d",marks',
            {"subtitle": hj.Subtitle("a, b; c=d"), "marks": hj.Marks()},
        ),
        ("subtitle:subtitle_text=it's fine", {"subtitle": hj.Subtitle("it's fine")}),
        (r"subtitle:subtitle_text=a\nb", {"subtitle": hj.Subtitle("a\nb")}),
        ("none", {}),
    ],
)
def test_a_line_of_corruptions(text: str, expected: dict[str, hj.plugin.Corruption]) -> None:
    result = parse(text)
    assert result.planners == expected
    assert list(result.planners) == list(expected)
    assert not result.clean


def test_the_clean_rows_are_named() -> None:
    assert parse("clean") == parse(" clean ")
    assert (parse("clean").planners, parse("clean").clean) == ({}, True)
    assert (list(parse("marks,clean").planners), parse("marks,clean").clean) == (["marks"], True)


@pytest.mark.parametrize(
    ("text", "place", "reason"),
    [
        ("marks:nmber=3", 7, "did you mean 'number'"),
        ("subtitle,marks:number=3,nmber=3", 25, "did you mean 'number'"),
        ("marks,number=3", 7, "belongs to no corruption; write NAME:number=3"),
        ("number=3", 1, "belongs to no corruption"),
        ("marks:number=3;severity=2", 16, "belongs to no corruption"),
        ("marks:number", 7, "must be KEY=VALUE, such as marks:number=VALUE"),
        ("marks:", 7, "must be KEY=VALUE"),
        ("marks:number=1,number=2", 16, "given twice"),
        ("marks:number=x", 1, "must be an integer"),
        ("marks:severity=9", 7, "severity must be 1 to 5"),
        ("marks:number=[1", 16, "']' is missing"),
        ('subtitle:subtitle_text="a', 26, "is missing"),
        ("clean:number=3", 1, "takes no settings"),
        ("marks,everyday", 7, "name missed_input,repeated_input,slipped_pointer"),
    ],
)
def test_mistakes_say_where_they_are(text: str, place: int, reason: str) -> None:
    with pytest.raises(BuildError) as caught:
        parse(text)
    assert f"at character {place}: " in str(caught.value)
    assert reason in str(caught.value)


def test_names_that_are_wrong() -> None:
    with pytest.raises(UnknownNameError, match="did you mean 'marks'"):
        parse("markz:number=3")
    with pytest.raises(
        BuildError, match="'marks' is given twice; label one of them, such as marks:as=marks_2"
    ):
        parse("marks,marks")
