"""Whether a command could be run at all: its program, its subcommand, its options and its files are
there."""

import functools
import re
import shlex
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import click

from hijack_data.cli import hijack

from .docs import ROOT, surroundings

# Programs of the system; what they are asked to do is not looked at.
KNOWN = (
    "apt-get",
    "chromium",
    "cp",
    "docker",
    "eval",
    "export",
    "inspect",
    "mkdir",
    "pip",
    "ray",
    ".",
    "(cd",
    "cd",
    "sudo",
    "ssh",
    "ssh-keygen",
)
# What a synopsis has around its words.
MARKS = str.maketrans("", "", "[]")


def problem(line: str) -> str:
    """What is wrong with a command; empty where nothing is."""
    words = shlex.split(line.translate(MARKS))
    while words and (words[0] == "sudo" or re.fullmatch(r"[A-Z_]+=.*", words[0])):
        words = words[1:]
    if not words:
        return ""
    program, word = words[0], words[1:]
    if Path(program).name == "hijack":
        return of_hijack(word) or files(word)
    if program == "make":
        unknown = [name for name in word if "=" not in name and name not in targets()]
        return f"no target {unknown}" if unknown else ""
    if Path(program).name in ("python", "python3"):
        return of_python(word)
    return "" if program in KNOWN else f"what is {program!r}?"


def of_hijack(words: Sequence[str]) -> str:
    """What is wrong with the subcommand and its options."""
    command: click.Command = hijack
    context = click.Context(hijack)
    arguments = list(words)
    while arguments[:1] == ["--load"]:  # the one option that stands before the command
        arguments = arguments[2:]
    while arguments and isinstance(command, click.Group) and not arguments[0].startswith("-"):
        if arguments[0] == "...":
            return ""
        result = command.commands.get(arguments[0]) if command is not hijack else None
        result = result or command.get_command(context, arguments[0])
        if result is None:
            return f"no command {arguments[0]!r}"
        command, arguments = result, arguments[1:]
    names = {name for option in command.params for name in (*option.opts, *option.secondary_opts)}
    used_options = {word.partition("=")[0] for word in arguments if re.match(r"--?[a-z]", word)}
    unknown = sorted(used_options - names - {"-h", "--help", "--help-all"})
    return f"hijack {command.name} has no {', '.join(unknown)}" if unknown else ""


def of_python(words: Sequence[str]) -> str:
    """What is wrong with a script or a module, and its options."""
    if words[:1] == ["-m"]:
        if words[1] == "pytest":
            return ""
        result = re.findall(r"--[a-z-]+", usage(words[1]))
        unknown = [word for word in words[2:] if word.startswith("--") and word not in result]
        return f"{words[1]} has no {unknown}" if unknown else ""
    scripts = [word for word in words if word.endswith(".py")]
    return "" if scripts and (ROOT / scripts[0]).is_file() else f"no file {scripts}"


@functools.cache
def usage(module: str) -> str:
    """What a module prints for `--help`."""
    command = [sys.executable, "-m", module, "--help"]
    process = subprocess.run(
        command, capture_output=True, text=True, timeout=60, env=surroundings(True, ROOT)
    )
    return process.stdout


def files(words: Sequence[str]) -> str:
    """Which of the clone's own files are named and not there."""
    ours = [word for word in words if re.match(r"(configs|examples|benchmarks|tests)/", word)]
    missing_files = [word for word in ours if not list(ROOT.glob(word))]
    return f"no {', '.join(missing_files)} in the repository" if missing_files else ""


@functools.cache
def targets() -> frozenset[str]:
    """The targets of the Makefile."""
    return frozenset(re.findall(r"^([a-z]+):", (ROOT / "Makefile").read_text(), re.M))
