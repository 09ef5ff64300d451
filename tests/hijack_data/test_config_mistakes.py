"""Every mistake in a configuration is reported at its place, all at once, and no input raises
anything else."""

import re
import time
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hijack_data.config import load_config
from hijack_data.errors import ConfigError

from support.config import problems, write

ROOT = Path(__file__).resolve().parents[2]


# Every mistake, at its place

MISTAKES = [
    # the file as a whole
    ("", "1:1: the file is empty; write corruptions:"),
    ("# nothing\n", "1:1: the file is empty"),
    ("---\n...\n", "1:1: the file is empty"),
    ("\n- marks\n", "2:1: a configuration is a mapping with the key corruptions, got a list"),
    ("marks", "1:1: a configuration is a mapping with the key corruptions, got 'marks' (str)"),
    ("seed: 1", "1:1: the key corruptions is missing"),
    ("corruptions: [marks]\n---\na: b\n", "2:1: a second document starts here"),
    # what is not YAML
    ("corruptions:\n\t- marks\n", "2:1: a tab cannot indent or separate here; use spaces"),
    ("corruptions: [marks\nseed: 1\n", "2:5: not valid YAML: while parsing a flow sequence"),
    (
        "corruptions:\n  - marks: a: b\n",
        "2:13: not valid YAML: mapping values are not allowed here; put a text that",
    ),
    (
        "a: %x",
        (
            "1:4: not valid YAML: while scanning for the next token, found character '%' that"
            " cannot start any toke"
        ),
    ),
    ('a: "\\U00110000"', "1:7: not valid YAML: a character code or version number is out of range"),
    ('a: "\\UFFFFFFFF"', "1:7: not valid YAML: a character code or version number is out of range"),
    ('corruptions: [marks: {color: "\\ud800"}]', "1:30: a \\u escape holds half a character"),
    ("corruptions: [marks]\na: é\x00\n", "2:5: the character U+0000 is not allowed"),
    ("a: b\r\nc: \x07", "2:4: the character U+0007 is not allowed"),
    (b"a: b\nc: d\xff\n", "2:5: byte 0xff is not UTF-8; save the file as UTF-8"),
    (b"\xef\xbb\xbfa: \xfe\n", "1:4: byte 0xfe is not UTF-8"),
    ("corruptions: [marks]\n".encode("utf-16"), "1:1: byte 0xff is not UTF-8"),
    # what we refuse of YAML
    (
        "corruptions: !!python/object/apply:os.system [ls]",
        "1:14: the tag '!!python/object/apply:os.system' is refused",
    ),
    ("corruptions: [!x marks]", "1:15: the tag '!x' is refused"),
    (
        "corruptions: [marks]\nseed: 1\nseed: 2\n",
        "3:1: the key 'seed' appears twice (first in line 2); remove one",
    ),
    (
        "corruptions:\n  - marks: {number: 1, color: red, number: 1}",
        "2:36: the key 'number' appears twice",
    ),
    ("a: &a {b: c}\nd:\n  <<: *a\n", "3:3: merge keys (<<) are not read"),
    ("corruptions: [marks]\n? [a]\n: b\n", "2:3: a key must be a name, not a list"),
    ("corruptions: [*a]", "1:15: the alias *a has no finished anchor &a before it"),
    ("corruptions: &a [*a]", "1:18: the alias *a has no finished anchor"),
    ("corruptions: " + "[" * 40, "1:46: nested more than 32 levels deep"),
    ("corruptions: [" + "a, " * 10_000 + "]", "1:30006: more than 10000 values"),
    # the top
    ("corruptions: [marks]\nsed: 7\n", "2:1: unknown key 'sed'; did you mean 'seed'?"),
    (
        "corruptions: [marks]\nsubtitle: {}\n",
        "2:1: 'subtitle' is a corruption; put it under corruptions:",
    ),
    ("corruptions: [marks]\nseed: -1\n", "2:7: seed must be int in [0, "),
    ("corruptions: [marks]\nseed: 18446744073709551616\n", "2:7: seed must be int in [0, "),
    (
        "corruptions: [marks]\nseed: " + "9" * 5000,
        "2:7: a whole number of 5000 digits; the limit is 40",
    ),
    (
        "corruptions: [marks]\nclean: yes\n",
        "2:8: clean must be true or false, got 'yes' (str); write true",
    ),
    (
        "corruptions: [marks]\nlabel_policy: kep\n",
        "2:15: label_policy must be one of keep, avoid, drop, recover, got ",
    ),
    (
        "corruptions: [marks]\noutput: [lazy]\n",
        "2:9: output must be one of materialised, lazy, got ['lazy']",
    ),
    (
        "corruptions: [marks]\nsplits: {train: .5, test: .4}",
        "2:9: splits: the shares must sum to 1, got 0.9",
    ),
    (
        "corruptions: [marks]\nsplits: {train: 1.5, test: -.5}",
        "2:9: splits.train must be float in [0, 1], got 1.5",
    ),
    ("corruptions: [marks]\nsplits: {../x: 1}", "2:9: splits: '../x' cannot name a split"),
    (
        "corruptions: [marks]\nsplits: train",
        "2:9: splits must be a mapping such as {train: 0.9, test: 0.1}, got 'trai",
    ),
    (
        "paper_compat: maybe\ncorruptions: [marks]",
        "1:15: paper_compat must be true or false, got 'maybe'",
    ),
    # entries
    (
        "corruptions: marks",
        "1:14: corruptions must be a list of corruptions, got 'marks' (str); write [marks, subtitl",
    ),
    ("corruptions:\n", "1:13: corruptions must be a list of corruptions, got nothing"),
    ("corruptions: []", "1:14: corruptions is empty; name at least one corruption"),
    ("corruptions: {}", "1:14: corruptions is empty"),
    ("corruptions: [sub]", "1:15: unknown corruption 'sub'; did you mean 'subtitle'?"),
    ("corruptions: [xyzzy]", "1:15: unknown corruption 'xyzzy'; known: accidental_touch, "),
    ("corruptions: [marks-v2]", "1:15: marks is at version 1 here, not 2"),
    ("corruptions: [Pop UPs]", "1:15: unknown corruption 'Pop UPs'; did you mean 'pop_ups'?"),
    (
        "corruptions: [clean]",
        "1:15: 'clean' is not a corruption; to keep the clean rows write clean: true",
    ),
    ("corruptions: [marks, 5]", "1:22: an entry of corruptions names one corruption, got 5 (int)"),
    ("corruptions: [[marks]]", "1:15: an entry of corruptions names one corruption, got a list"),
    ("corruptions: [{}]", "1:15: an entry of corruptions names one corruption, got a mapping"),
    (
        "corruptions:\n- marks:\n  number: 3\n",
        "2:3: an entry of corruptions names one corruption, got the keys marks,",
    ),
    (
        "corruptions:\n- marks\n- marks: {number: 3}\n",
        "3:3: 'marks' appears twice (first in line 2); label one of the",
    ),
    (
        "corruptions: [marks: {as: m}, subtitle: {as: m}]",
        "1:46: 'm' appears twice (first in line 1)",
    ),
    ("corruptions: [marks: {as: a b}]", "1:27: as must be 1 to 64 letters, digits"),
    ("corruptions: [marks: {as: 5}]", "1:27: as must be 1 to 64 letters, digits"),
    ("corruptions: [marks: {as: subtitle}]", "1:27: as: 'subtitle' already means something else"),
    ("corruptions: [marks: {as: clean}]", "1:27: as: 'clean' already means something else"),
    (
        "corruptions: [marks: 5]",
        "1:22: the parameters of marks must be a mapping {key: value}, got 5 (int)",
    ),
    # parameters
    (
        "corruptions: [marks: {colr: red}]",
        "1:23: marks has no parameter 'colr'; did you mean 'color'?",
    ),
    (
        "corruptions: [marks: {svrity: 2}]",
        "1:23: marks has no parameter 'svrity'; did you mean 'severity'?",
    ),
    ("corruptions: [marks: {number: -1}]", "1:31: marks.number must be int in [0, 100000], got -1"),
    (
        "corruptions: [marks: {mark_type: str}]",
        "1:34: marks.mark_type must be one of star, circle, rectangle, got 'st",
    ),
    (
        "corruptions: [pop_ups: {window_string: '{z}'}]",
        "1:40: pop_ups.window_string may hold {x} and {y} only",
    ),
    ("corruptions: [marks: {severity: 6}]", "1:33: marks: severity must be in 1..5, got 6"),
    (
        "corruptions: [marks: {severity: '2'}]",
        "1:33: marks: severity must be an integer in 1..5, got '2'; remove the",
    ),
    (
        "corruptions: [verification: {severity: 2}]",
        "1:40: verification: verification has no severity scale",
    ),
    (
        "corruptions: [app_minimization: {step: [1, x]}]",
        "1:40: app_minimization.step[1] must be an integer, got 'x' (",
    ),
    ("corruptions: [resolution: {scale: .nan}]", "1:35: resolution.scale must be finite"),
    ("corruptions: [resolution: {scale: 1e999}]", "1:35: resolution.scale must be finite"),
    # what YAML reads otherwise than people mean it
    (
        "corruptions: [marks: {number: 1e3}]",
        "1:31: marks.number must be an integer, got 1000.0 (float); write 1000",
    ),
    ("corruptions: [marks: {number: 010}]", "got '010' (str); write 10 (octal is not read)"),
    ("corruptions: [marks: {number: 1_000}]", "got '1_000' (str); write 1000"),
    (
        "corruptions: [marks: {number: 1:30}]",
        "got '1:30' (str); numbers to the base of 60 are not read",
    ),
    (
        "corruptions: [resolution: {scale: 1:30}]",
        "got '1:30' (str); numbers to the base of 60 are not read",
    ),
    ("corruptions: [marks: {number: '5'}]", "got '5' (str); remove the quotes"),
    ("corruptions: [marks: {color: 000000}]", "1:30: marks.color is not a colour: '000000'"),
    ("corruptions: [marks: {color: 000000}]", "; write '#000000' in quotes"),
    ("corruptions: [marks: {color: 123456}]", "got 123456 (int); write '#123456' in quotes"),
    ("corruptions: [marks: {color: 1e1000}]", "write '#1e1000' in quotes"),
    (
        "corruptions:\n- marks: {color: #fff\n  }",
        "2:17: marks.color must be a colour name, '#rrggbb' or [r, g, b], go",
    ),
    (
        "corruptions:\n- marks: {color: #fff\n  }",
        "an unquoted # starts a comment: write '#rrggbb' in quotes",
    ),
    (
        "corruptions: [pop_ups: {button_string: 12}]",
        "1:40: pop_ups.button_string must be a string, got 12 (int); for ",
    ),
    ("corruptions: [pop_ups: {button_string: }]", "for the text write '' in quotes"),
    ("corruptions: [pop_ups: {random_position: off}]", "got 'off' (str); write false"),
    # the paper's keys where they are not asked for
    (
        "corruptions: [marks: {overlap: true}]",
        "1:23: marks has no parameter 'overlap'; it is the paper's key for avoi",
    ),
    (
        "corruptions: [marks: {overlap: true}]",
        "write that with the opposite value, or set paper_compat: true",
    ),
    (
        "corruptions: [pop_ups: {overlap: true}]",
        "for avoid_elements: write that, or set paper_compat: true",
    ),
    ("corruptions: [accidental_touch: {w/o_app: true}]", "it is the paper's key for without_app"),
    # combinators
    ("corruptions: [one_of]", "1:15: one_of needs options: one_of: {options: [marks, subtitle]}"),
    ("corruptions: [one_of: {options: []}]", "1:33: one_of.options is empty"),
    (
        "corruptions: [one_of: {options: [marks], p_clean: 2}]",
        "1:51: one_of.p_clean must be float in [0, 1], got 2.0",
    ),
    (
        "corruptions: [one_of: {options: [marks], weights: 2}]",
        "1:51: one_of.weights must be a list of numbers, got 2",
    ),
    (
        "corruptions: [one_of: {options: [marks], weights: [a]}]",
        "1:52: one_of.weights[0] must be a number, got 'a'",
    ),
    (
        "corruptions: [one_of: {options: [marks], weights: [1, 2]}]",
        "1:51: OneOf: weights must be 1 numbers >= 0",
    ),
    (
        "corruptions: [one_of: {options: [marks], pclean: 0}]",
        "1:42: one_of has no key 'pclean'; did you mean 'p_clean",
    ),
    (
        "corruptions: [one_of: {options: [marks: {as: m}]}]",
        "1:42: as labels entries of corruptions only; remove it he",
    ),
    (
        "corruptions: [one_of: {options: [marks: {numbr: 1}]}]",
        "1:42: marks has no parameter 'numbr'; did you mean 'nu",
    ),
    ("corruptions: [one_of: 5]", "1:23: one_of must be a mapping {key: value}, got 5 (int)"),
    ("corruptions: [sequence: []]", "1:25: sequence.parts is empty"),
    (
        "corruptions: [sequence: {part: [marks]}]",
        "1:26: sequence has no key 'part'; did you mean 'parts'?",
    ),
]


@pytest.mark.parametrize(("text", "expected"), MISTAKES, ids=[f"{i}" for i in range(len(MISTAKES))])
def test_mistake_is_reported_at_its_place(tmp_path, text, expected):
    result = problems(tmp_path, text)
    placed = re.match(r"\d+:\d+: ", expected) is not None
    assert any(p.startswith(expected) if placed else expected in p for p in result), result


def test_all_mistakes_at_once_in_the_order_of_the_file(tmp_path):
    text = """\
corruptions:
  - marks: {number: x, colr: red, number: 1, mark_size: 0}
  - pop_ups: {width: 0, window_string: "{z}"}
  - nonsense
  - sequence: [one_of: {options: [resolution: {scale: -1}]}, !t marks]
sed: 1
clean: 5
"""
    result = problems(tmp_path, text)
    places = [p.partition(": ")[0] for p in result]
    assert places == [
        "2:21",
        "2:24",
        "2:35",
        "2:57",
        "3:22",
        "3:40",
        "4:5",
        "5:55",
        "5:62",
        "6:1",
        "7:8",
    ]


def test_messages_are_one_printable_line_of_bounded_length(tmp_path):
    (long,) = problems(tmp_path, f"corruptions: [{'z' * 100_000}]")
    assert len(long) < 500
    (odd,) = problems(tmp_path, 'corruptions: [{"a\\nb": 1, c: 2}]')
    assert "\n" not in odd


def test_alias_bombs_end_at_once(tmp_path):
    wide = "a: &a0 [1, 1]\n" + "".join(
        f"a{i}: &a{i} [*a{i - 1}, *a{i - 1}]\n" for i in range(1, 60)
    )
    deep = "a: &a0 [1]\n" + "".join(
        f"a{i}: &a{i} [[[[[[[[[*a{i - 1}]]]]]]]]]\n" for i in range(1, 60)
    )
    start = time.perf_counter()
    assert "more than 10000 values, those behind aliases included" in problems(tmp_path, wide)[0]
    assert "nested more than 32 levels deep" in problems(tmp_path, deep)[0]
    assert time.perf_counter() - start < 2


# Anything at all

PIECES = st.sampled_from(
    [
        "corruptions:",
        "\n",
        "  - ",
        "- ",
        "  ",
        "marks",
        ": ",
        "{",
        "}",
        "[",
        "]",
        ", ",
        "number",
        "5",
        "&a ",
        "*a",
        "!t ",
        '"',
        "'",
        "#",
        "\t",
        "|",
        ">",
        "%YAML 1.1",
        "---\n",
        "...\n",
        "? ",
        "<<",
        "as",
        "severity",
        "one_of",
        "options",
        "weights",
        "paper_compat: true\n",
        "overlap",
        "\\",
        "\\ud800",
        "\x00",
        "\x85",
        "\r",
        "~",
        ".nan",
        "1e999",
        "9" * 50,
    ]
)


def outcome(path: Path) -> list[str]:
    """The problems of a file, none when it loads."""
    try:
        assert load_config(path).corruptions
    except ConfigError as error:
        return list(error.problems)
    return []


@settings(max_examples=400, deadline=None)
@given(
    st.one_of(st.lists(PIECES, max_size=25).map("".join).map(str.encode), st.binary(max_size=60))
)
def test_any_bytes_load_or_raise_a_config_error(tmp_path_factory, data):
    path = write(tmp_path_factory.getbasetemp(), data)
    assert all(
        re.fullmatch(re.escape(str(path)) + r":\d+:\d+: .+", problem) for problem in outcome(path)
    )


@settings(max_examples=100, deadline=None)
@given(st.data())
def test_a_damaged_configuration_loads_or_raises_a_config_error(tmp_path_factory, data):
    text = (ROOT / "configs/corruptions/paper.yaml").read_text()
    at = data.draw(st.integers(0, len(text)))
    deleted = data.draw(st.integers(0, 20))
    path = write(
        tmp_path_factory.getbasetemp(), text[:at] + data.draw(PIECES) + text[at + deleted :]
    )
    assert all(problem.startswith(f"{path}:") for problem in outcome(path))
