"""Values that TAB completes, such as names of corruptions, agents, benchmarks and formats."""

import importlib
from collections.abc import Callable
from typing import Any

import click
from click.shell_completion import CompletionItem

Completion = Callable[[click.Context, click.Parameter, str], list[CompletionItem]]


def complete(source: str, *more: str) -> Completion:
    """Return a completion of one name, or of the last one of a list with commas.

    Args:
        source: `module:attribute`, imported when TAB is pressed: a function that returns the names,
            or a registry, mapping or sequence of them.
        more: further words.
    """

    def completion(
        ctx: click.Context, parameter: click.Parameter, incomplete: str
    ) -> list[CompletionItem]:
        before, comma, last = incomplete.rpartition(",")
        words_before = before.split(",")
        return [
            CompletionItem(before + comma + word)
            for word in (*_names(source), *more)
            if word.startswith(last) and word not in words_before
        ]

    return completion


def complete_configuration(*folders: str) -> Completion:
    """Return a completion of the packaged configurations in folders of `configs/`."""

    def completion(
        ctx: click.Context, parameter: click.Parameter, incomplete: str
    ) -> list[CompletionItem]:
        names = (name.partition("/") for name in _names("hijack_data.config_files:available"))
        return [
            CompletionItem(name)
            for folder, _, name in names
            if folder in folders and name.startswith(incomplete)
        ]

    return completion


def _names(source: str) -> list[str]:
    module, _, attribute = source.partition(":")
    names: Any
    try:
        names = getattr(importlib.import_module(module), attribute)
        if hasattr(names, "names"):
            names = names.names
        if callable(names):
            names = names()
    except Exception:  # noqa: BLE001  a broken plug-in completes nothing, and breaks no shell
        return []
    return [*names]
