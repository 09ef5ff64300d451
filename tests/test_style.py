"""House rules that no linter knows."""

import ast
from collections import defaultdict
from collections.abc import Iterator
from functools import cache
from pathlib import Path

from support import parts

ROOT = Path(__file__).resolve().parent.parent
PACKAGES = ("hijack_data", "pipelines", "online_env")
# Names of the same thing for another framework: `hj.Marks` makes plans, `transforms.Marks` is that
# corruption as a transform of torchvision, as the users of both libraries expect.
SAME_IN_FRAMEWORKS = {
    "Corrupt",
    "Marks",
    "OneOf",
    "PopUps",
    "Resolution",
    "Schedule",
    "Sequence",
    "Subtitle",
}


def files(*packages: str) -> list[Path]:
    return [path for package in packages for path in sorted((ROOT / package).rglob("*.py"))]


@cache
def parsed(path: Path) -> ast.Module:
    return ast.parse(path.read_text(encoding="utf-8"))


def test_the_formatter_is_never_switched_off():
    marks = ("# fmt: " + "skip", "# fmt: " + "off")
    paths = files(*PACKAGES, "tests", "benchmarks", "examples")
    assert [str(path) for path in paths if any(mark in path.read_text() for mark in marks)] == []


def meanings(path: Path) -> Iterator[tuple[str, str]]:
    """Yield the public classes and type aliases of a module, each with what tells it from others.

    A class is one of a kind; two aliases of the same type mean the same.
    """
    for node in parsed(path).body:
        if isinstance(node, ast.ClassDef):
            yield node.name, str(path)
        elif isinstance(node, ast.AnnAssign) and "TypeAlias" in ast.dump(node.annotation):
            yield ast.unparse(node.target), ast.unparse(node.value or node.target)
        elif isinstance(node, ast.Assign) and isinstance(node.value, ast.Subscript | ast.BinOp):
            names = [ast.unparse(target) for target in node.targets]
            # `Row = dict[str, Any]`, not `T = TypeVar("T")` and no constant
            yield from (
                (name, ast.unparse(node.value))
                for name in names
                if name[:1].isupper() and not name.isupper()
            )


def test_one_meaning_a_name():
    """A public class or type alias is defined once in the whole project."""
    places: dict[str, dict[str, str]] = defaultdict(dict)
    for path in files(*PACKAGES):
        for name, meaning in meanings(path):
            places[name][meaning] = str(path)
    shared = {
        name: value
        for name, value in places.items()
        if len(value) > 1 and not name.startswith("_") and name not in SAME_IN_FRAMEWORKS
    }
    assert shared == {}


def test_every_entry_of_the_parts_of_the_suite_exists() -> None:
    for entry in (*parts.TAIL, *parts.WHOLE, *parts.LONG_FILES):
        file, _, function = entry.partition("::")
        path = ROOT / "tests" / file
        assert path.is_file(), entry
        assert not function or f"def {function}(" in path.read_text(), entry
