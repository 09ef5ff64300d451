"""The pytest plug-in: `@pytest.mark.robust` plays an agent on corrupted desktops, and judges it.

Every run of pytest loads this module where the package is installed, so it imports nothing that a
test without the mark does not need.
"""

from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from _pytest.config.argparsing import Parser

MARK = "robust"
_HELP = (
    f"{MARK}(suite, retention, gates, tasks, conditions, seeds, machines, desktops, options):"
    " play the agent that the test returns, clean and corrupted, and fail if the lower end of the"
    " 95 % interval of its retention is below `retention` (https://agenthijack.github.io)."
)


def pytest_addoption(parser: "Parser") -> None:
    """Add the options of the plug-in."""
    group = parser.getgroup("agenthijack", "robustness of agents")
    group.addoption(
        "--robust-runs",
        metavar="DIR",
        help="Keep the runs of tests with @pytest.mark.robust below DIR; by default in tmp_path.",
    )
    group.addoption(
        "--robust-required",
        action="store_true",
        help="Fail tests with @pytest.mark.robust where no desktop can run, instead of skipping.",
    )


def pytest_configure(config: pytest.Config) -> None:
    """Declare the mark."""
    config.addinivalue_line("markers", _HELP)


def pytest_itemcollected(item: pytest.Item) -> None:
    """Give a test with the mark a folder for its run."""
    if item.get_closest_marker(MARK) is not None and isinstance(item, pytest.Function):
        item.fixturenames.append("tmp_path")


@pytest.hookimpl(tryfirst=True)
def pytest_pyfunc_call(pyfuncitem: pytest.Function) -> bool | None:
    """Call a test that has the mark, and judge the agent that it returns."""
    mark = pyfuncitem.get_closest_marker(MARK)
    if mark is None:
        return None
    from .bench.robust_tests import run_robust_test

    run_robust_test(pyfuncitem, mark)
    return True
