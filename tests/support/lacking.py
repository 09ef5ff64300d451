"""Python with modules that cannot be imported, as where an extra is not installed.

`python lacking.py '{"modules": [...], "commands": {name: words}, "code": {name: text}}'` runs all
of it in one process and prints, for each name, the exit code or the error, and what was printed.
With `"system": "Darwin"` the machine says that it is one, and `"functions"` of `os` are gone.
"""

import contextlib
import io
import json
import os
import platform
import sys
import traceback
from collections.abc import Callable, Sequence
from typing import Any


class Without:
    """A finder that finds none of some modules, and is another finder otherwise."""

    def __init__(self, finder: Any, modules: Sequence[str]) -> None:
        self.finder, self.modules = finder, frozenset(modules)

    def __getattr__(self, name: str) -> Any:
        return getattr(self.finder, name)

    def find_spec(self, fullname: str, path: Any = None, target: Any = None) -> Any:
        if fullname.partition(".")[0] in self.modules:
            return None
        return self.finder.find_spec(fullname, path, target)


def watched(act: Callable[[], Any]) -> dict[str, Any]:
    """What comes of `act`: `code` (of the exit, or `None`), `error` (types and text), `printed`."""
    out = io.StringIO()
    entries: dict[str, Any] = {"code": None, "error": ""}
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(out):
        try:
            act()
        except SystemExit as end:
            entries["code"] = end.code or 0
        except BaseException as error:  # noqa: BLE001
            entries["error"] = f"{[base.__name__ for base in type(error).__mro__]} {error}"
            traceback.print_exc(file=out)
    return {**entries, "printed": out.getvalue()}


def pretend(system: str, functions: Sequence[str]) -> None:
    """Answer as another system does; the standard library has been imported by then."""
    if system:
        platform.system = lambda: system
    for name in functions:
        delattr(os, name)


def main(order: dict[str, Any]) -> None:
    """Carry out an order, and print its results as JSON."""
    pretend(order.get("system", ""), order.get("functions", ()))
    for name in order["modules"]:
        sys.modules.pop(name, None)  # what starts before us may have it
    sys.meta_path[:] = [Without(finder, order["modules"]) for finder in sys.meta_path]
    from hijack_data.cli import main as hijack
    from pipelines.viewer import server

    server.serve = lambda *_: None  # a page would be served until Ctrl-C
    results: dict[str, Any] = {}
    for name, words in order["commands"].items():
        results[name] = watched(lambda words=words: hijack(words))
    for name, text in order["code"].items():
        results[name] = watched(lambda text=text: exec(text, {}))
    print(json.dumps(results))


if __name__ == "__main__":
    main(json.loads(sys.argv[1]))
