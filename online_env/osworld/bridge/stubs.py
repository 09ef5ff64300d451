"""Import `desktop_env` without the packages that a task does not need.

`desktop_env` imports about thirty packages at once, whatever the task. Those that are absent are
stood in for while it is imported, and only then: a finder that stays would make `import pandas`
succeed everywhere.
"""

import contextlib
import importlib.abc
import importlib.machinery
import importlib.util
import sys
import types
from collections.abc import Iterable, Iterator, Sequence
from typing import Any

# What the evaluators, getters and setup of desktop-env 1.0.2 import from elsewhere.
ROOTS = (
    "PIL",
    "PyPDF2",
    "acoustid",
    "borb",
    "bs4",
    "cv2",
    "docx",
    "easyocr",
    "fastdtw",
    "fitz",
    "formulas",
    "imagehash",
    "librosa",
    "mutagen",
    "odf",
    "openpyxl",
    "pandas",
    "pdfplumber",
    "playwright",
    "pptx",
    "psutil",
    "pydrive",
    "pypdf",
    "rapidfuzz",
    "scipy",
    "skimage",
    "tldextract",
    "tqdm",
    "xmltodict",
    "yaml",
)


class MissingDependency(BaseException):
    """An evaluator used a package that is not installed.

    Not an `Exception`: most metrics answer `except Exception` with a score of 0, and a missing
    package is no failure of the agent.
    """


class _StandIn(type):
    """A class that may be named, in annotations too, but neither called nor used."""

    def __call__(cls, *_: Any, **__: Any) -> Any:
        raise MissingDependency(cls.__module__)

    def __getattr__(cls, name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(name)
        return _stand_in(cls.__module__, f"{cls.__qualname__}.{name}")


def _stand_in(module: str, name: str) -> Any:
    return _StandIn(name.rpartition(".")[2], (), {"__module__": module, "__qualname__": name})


class StubModule(types.ModuleType):
    """A module whose every attribute is a stand-in."""

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(name)
        value = _stand_in(self.__name__, name)
        setattr(self, name, value)
        return value


class _Finder(importlib.abc.MetaPathFinder, importlib.abc.Loader):
    def __init__(self, roots: frozenset[str]) -> None:
        self.roots = roots

    def find_spec(
        self,
        fullname: str,
        path: Sequence[str] | None = None,
        target: types.ModuleType | None = None,
    ) -> importlib.machinery.ModuleSpec | None:
        if fullname.partition(".")[0] in self.roots:
            return importlib.machinery.ModuleSpec(fullname, self, is_package=True)
        return None

    def create_module(self, spec: importlib.machinery.ModuleSpec) -> types.ModuleType:
        return StubModule(spec.name)

    def exec_module(self, module: types.ModuleType) -> None:
        module.__path__ = []


def absent(roots: Iterable[str] = ROOTS) -> frozenset[str]:
    """Return those of `roots` that cannot be imported here."""
    return frozenset(
        root for root in roots if root not in sys.modules and importlib.util.find_spec(root) is None
    )


@contextlib.contextmanager
def standing_in(roots: Iterable[str] = ROOTS) -> Iterator[frozenset[str]]:
    """Give stubs for imports of missing packages; afterwards such imports fail as before.

    Args:
        roots: The packages; those that are installed are imported.

    Yields:
        The packages that are missing.
    """
    missing = absent(roots)
    finder = _Finder(missing)
    sys.meta_path.append(finder)  # at the end: a real package wins
    try:
        yield missing
    finally:
        sys.meta_path.remove(finder)
        for name in [name for name in sys.modules if name.partition(".")[0] in missing]:
            del sys.modules[name]


def stub_root(value: object) -> str | None:
    """Return the package that `value` stands in for, or `None` if it is real."""
    if isinstance(value, StubModule):
        return value.__name__.partition(".")[0]
    if isinstance(value, _StandIn):
        return value.__module__.partition(".")[0]
    return None
