"""The modules of the extra `online`, and the error for one that is not installed."""

from collections.abc import Iterable

from hijack_data import extras

EXTRA = "online"
# A desktop and its local internet need these; the environment needs gymnasium as well.
DESKTOP = (
    "starlette",
    "uvicorn",
    "multipart",
    "anyio",
    "httpx",
    "urllib3",
    "Xlib",
    "mss",
    "jeepney",
    "jinja2",
    "markdown_it",
)
MODULES = (*DESKTOP, "gymnasium", "scipy", "openpyxl", "docx", "pptx")


def require(purpose: str, modules: Iterable[str] = DESKTOP) -> None:
    """Raise `MissingDependencyError`, with the remedy, if `purpose` lacks one of `modules`."""
    extras.require(purpose, EXTRA, modules)


def import_error(error: ModuleNotFoundError, purpose: str) -> ImportError:
    """Return the error to raise instead of `error`, with the remedy if the extra is missing.

    Args:
        error: The error of an import.
        purpose: What needs the module, for the message.
    """
    module = (error.name or "").partition(".")[0]
    if module not in MODULES:
        return error
    return extras.missing(f"{purpose} needs {module}", EXTRA)
