"""One grammar over all commands: an option of one name means and looks the same in each of them."""

import os
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import click
import pytest
from click.testing import CliRunner

from hijack_data.cli import COMMANDS, help_pages, hijack, main
from hijack_data.cli.options import FiniteRange
from hijack_data.cli.summaries import SECTIONS, SUMMARIES

pytest.importorskip("gymnasium", reason="needs the extra [online]; make env")
ROOT = Path(__file__).resolve().parent.parent
# Types of click that say nothing of what is meant; a metavar does.
BARE = {"TEXT", "INTEGER", "FLOAT", "PATH", "DIRECTORY", "INTEGER RANGE", "FLOAT RANGE"}


def leaves(command: click.Command, name: str) -> Iterator[tuple[str, click.Command]]:
    """A command, or all of a group, by what is typed for it."""
    if not isinstance(command, click.Group):
        yield name, command
        return
    context = click.Context(command, info_name=name)
    for part in command.list_commands(context):
        inner = command.get_command(context, part)
        assert inner is not None
        yield from leaves(inner, f"{name} {part}".strip())


EVERY = dict(leaves(hijack, ""))
OPTIONS = [
    (name, parameter)
    for name, command in EVERY.items()
    for parameter in command.params
    if isinstance(parameter, click.Option)
]


def called(*flags: str) -> list[tuple[str, click.Option]]:
    """The options that have one of the flags."""
    return [(name, option) for name, option in OPTIONS if set(flags) & set(option.opts)]


def test_the_summaries_are_those_of_the_commands():
    context = click.Context(hijack)
    real = {
        name: hijack.get_command(context, name).get_short_help_str(limit=300) for name in COMMANDS
    }
    assert real == SUMMARIES
    assert sum(map(len, SECTIONS.values())) == len(SUMMARIES), "a command is in two sections"


def test_no_number_in_a_range_is_nan_or_without_end():
    numbers = [
        (name, option.name, option.type)
        for name, option in OPTIONS
        if isinstance(option.type, click.FloatRange)
    ]
    assert [row for row in numbers if not isinstance(row[2], FiniteRange)] == []
    assert len(numbers) > 4


# Modules that take time; a help that imports one of them imports what it does not need.
HEAVY = ("numpy", "PIL", "rich", "yaml", "pipelines", "online_env", "hijack_data.plan")
SPY = f"""
import sys
from hijack_data.cli import main
try:
    main()
finally:
    print([name for name in {HEAVY!r} if name in sys.modules], file=sys.stderr)
"""


@pytest.mark.parametrize("words", [["--help"], ["--version"], []])
def test_what_needs_no_command_imports_none(words: list[str]):
    environment = os.environ | ({} if words else {"_HIJACK_COMPLETE": "bash_complete"})
    environment |= {} if words else {"COMP_WORDS": "hijack s", "COMP_CWORD": "1"}
    process = subprocess.run(
        [sys.executable, "-c", SPY, *words],
        capture_output=True,
        text=True,
        env=environment,
        check=False,
    )
    assert process.stderr.splitlines()[-1] == "[]", process.stderr
    if words == ["--help"]:
        assert all(re.search(rf"^  {name} ", process.stdout, re.M) for name in COMMANDS)
        assert not re.search(r"\w\.\.\.", process.stdout), "a summary is cut off"
    if not words:
        values = [line.partition(",")[2] for line in process.stdout.splitlines()]
        assert values == [name for name in COMMANDS if name.startswith("s")]


@pytest.mark.parametrize("name", EVERY)
def test_a_command_says_what_it_does_and_what_its_options_are(name: str):
    command = EVERY[name]
    context = click.Context(command, info_name=name)
    assert command.get_short_help_str(limit=300).endswith("."), name
    for option in command.params:
        if not isinstance(option, click.Option):
            continue
        flag = option.opts[0]
        assert option.help, f"hijack {name} {flag}: no help"
        assert re.search(r"[.\]]$", option.help), f"hijack {name} {flag}: {option.help!r}"
        for word in (*option.opts, *option.secondary_opts):
            assert re.fullmatch(r"-[a-z]|--[a-z]+(-[a-z]+)*", word), f"hijack {name} {word}"
        if not option.is_flag:
            shape = option.make_metavar(context)
            assert shape not in BARE, f"hijack {name} {flag} {shape}: give it a metavar"
    assert len(command.get_help(context)) > 0


def test_one_letter_is_one_option():
    short = {
        (word, option.opts[1])
        for _, option in OPTIONS
        for word in option.opts
        if not word.startswith("--")
    }
    assert short == {("-o", "--out")}


def test_what_is_written_goes_to_out():
    assert {name: option.opts[:2] for name, option in called("--out", "-o")} == {
        name: ["-o", "--out"] for name, _ in called("--out", "-o")
    }
    assert len(called("-o")) >= 16


def test_seeds_are_numbers_from_0():
    for name, option in called("--seed"):
        assert (option.metavar, option.type) == ("N", click.INT), f"{name}: use seed_option"
        assert option.default == 0 or "[default: 0" in str(option.help), name
    assert len(called("--seed")) >= 6


def test_workers_are_at_least_one():
    for name, option in called("--workers", "--desktops"):
        assert isinstance(option.type, click.IntRange), name
        assert (option.type.min, option.metavar) == (1, "N"), name


def test_flags_are_flags():
    for flag in ("--json", "--dry-run", "--resume", "--overwrite", "--strict"):
        assert called(flag)
        assert [name for name, option in called(flag) if not option.is_flag] == []
    assert [name for name, option in called("--json") if not option.help.startswith("Print ")] == []


def test_what_takes_long_can_be_tried_and_continued():
    """Whatever plays or trains for hours says beforehand what it would do, and goes on."""
    for name in ("build", "bench", "score", "search", "train"):
        flags = {word for option in EVERY[name].params for word in option.opts}
        assert {"-o", "--dry-run", "--resume"} <= flags, name


def test_an_error_names_the_page_that_explains_it(tmp_path: Path):
    page = (ROOT / help_pages.PAGE).read_text()
    headings = re.findall(r"^### `([^`]+)`$", page, re.M)
    assert [part for part in help_pages.EXPLAINED if part not in headings] == []
    subtitle = ["subtitle", "--set", "font_size=400", "-o", str(tmp_path / "x.png")]
    screen = ROOT / "examples" / "recordings" / "images" / "notes-04.png"
    process = subprocess.run(
        [sys.executable, "-m", "hijack_data.cli", "apply", str(screen), *subtitle],
        capture_output=True,
        text=True,
        check=False,
    )
    assert process.returncode == 2
    assert "explained in docs/troubleshooting.md#does-not-fit\n" in process.stderr
    anchors = {part: help_pages.anchor(part) for part in help_pages.EXPLAINED[:2]}
    assert list(anchors.values()) == [
        "pip-install",
        "is-imported-instead-of-agenthijacks-own-package",
    ]


def test_the_help_of_each_command_fits_a_screen():
    for name, command in EVERY.items():
        context = click.Context(command, info_name=f"hijack {name}", max_content_width=80)
        lines = command.get_help(context).splitlines()
        assert len(lines) <= 24, f"hijack {name} --help has {len(lines)} lines"
        names = {parameter.name for parameter in command.params}
        assert getattr(command, "more", set()) <= names, name


def test_every_option_is_in_the_help_of_all():
    command = EVERY["build"]
    result = CliRunner().invoke(command, ["--help-all"])
    assert result.exit_code == 0
    for parameter in command.params:
        if isinstance(parameter, click.Option):
            assert parameter.opts[-1] in result.output, parameter.opts
    assert "--episode-key" not in CliRunner().invoke(command, ["--help"]).output


@pytest.mark.parametrize(
    ("words", "value"),
    [
        ("show po", "pop_ups"),
        ("bench emb", "embedded_small"),
        ("build x --corruptions marks,su", "marks,subtitle"),
        ("build x --config all", "all_nine"),
        ("build x --format agen", "agentnet"),
        ("bench x --agent or", "oracle"),
        ("bench x --tasks write_n", "write_note"),
        ("export x --to ver", "verl"),
        ("report x --format mark", "markdown"),
        ("tasks --set hel", "held_out"),
    ],
)
def test_values_are_completed(words: str, value: str):
    line = f"hijack {words}"
    environment = {"_HIJACK_COMPLETE": "bash_complete", "COMP_WORDS": line}
    environment["COMP_CWORD"] = str(len(line.split()) - 1)
    result = CliRunner().invoke(hijack, env=environment, prog_name="hijack")
    assert f"plain,{value}" in result.output.splitlines()


def test_usage_is_an_error_of_one_line(capsys: pytest.CaptureFixture[str]):
    with pytest.raises(SystemExit) as stopped:
        main(["build", "--foo"])
    assert stopped.value.code == 2
    error = capsys.readouterr().err
    assert error.startswith("hijack: error: No such option '--foo'")
    assert error.endswith("; see hijack build --help\n")
    assert error.count("\n") == 1


def test_no_command_shows_the_commands(capsys: pytest.CaptureFixture[str]):
    with pytest.raises(SystemExit) as stopped:
        main([])
    assert stopped.value.code == 0
    assert capsys.readouterr().out.startswith("Usage: hijack")
