"""The formats of a report by name; each is a function that writes a `ReportDocument`."""

from collections.abc import Callable, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, TypeAlias

from hijack_data.entries import Lazy
from hijack_data.errors import suggest

from .model import ReportError

if TYPE_CHECKING:
    from .document import ReportDocument

ReportWriter: TypeAlias = "Callable[[ReportDocument], str]"
TERMINAL = "terminal"
FORMATS: Mapping[str, str] = MappingProxyType(
    {
        TERMINAL: "online_env.report.terminal:text",
        "json": "online_env.report.tables:as_json",
        "csv": "online_env.report.tables:as_csv",
        "latex": "online_env.report.latex:as_latex",
        "markdown": "online_env.report.tables:as_markdown",
        "html": "online_env.report.html:as_html",
        "model-index": "online_env.report.model_card:as_model_index",
        "eval-results": "online_env.report.model_card:as_eval_results",
        "badge": "online_env.report.badge:as_badge",
    }
)
SUFFIXES: Mapping[str, str] = MappingProxyType(
    {
        ".txt": TERMINAL,
        ".json": "json",
        ".csv": "csv",
        ".tex": "latex",
        ".md": "markdown",
        ".html": "html",
        ".htm": "html",
        ".yaml": "model-index",
        ".yml": "model-index",
        ".svg": "badge",
    }
)

# Formats that always show causes, for which the steps are read; others do so with --full.
WITH_CAUSES = ("html",)
COMPARISON = "a comparison"
# Formats that have a place for what an option asks for.
FORMATS_BY_OPTION: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {
        COMPARISON: (TERMINAL, "json", "csv", "markdown", "html"),
        "--reference": (TERMINAL, "json", "markdown", "html"),
        "--margin": (TERMINAL, "json", "markdown", "html"),
        "--paper": (TERMINAL, "json", "latex", "markdown", "html"),
        "--full": (TERMINAL, "json", "markdown"),
    }
)


def check_shown(option: str, format: str) -> None:
    """Check that a format shows what an option asks for, which would otherwise be lost in silence.

    Raises:
        ReportError: it does not.
    """
    if format not in FORMATS_BY_OPTION[option]:
        names = ", ".join(FORMATS_BY_OPTION[option])
        raise ReportError(f"{option} is not shown by the format {format}; give one of {names}")


def choose_format(name: str | None, out: Path | None) -> str:
    """Return the format with a name, or the format for the suffix of a file.

    Raises:
        ReportError: there is no such format, or the suffix of the file is unknown.
    """
    if name is not None:
        if name not in FORMATS:
            raise ReportError(f"--format: unknown format {name!r}{suggest(name, FORMATS)}")
        return name
    if out is None:
        return TERMINAL
    if out.suffix.lower() not in SUFFIXES:
        names = ", ".join(FORMATS)
        raise ReportError(f"-o {out}: its name does not tell the format; give --format ({names})")
    return SUFFIXES[out.suffix.lower()]


def write(document: "ReportDocument", format: str) -> str:
    """Return a document in one of the `FORMATS`; it ends with a line feed."""
    writer: ReportWriter = Lazy(FORMATS[format]).load()
    return writer(document).rstrip("\n") + "\n"
