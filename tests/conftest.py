"""Shared fixtures: real data (skipped with a reason when absent) and small pictures."""

import os
import signal
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import hypothesis
import numpy as np
import pytest

from hijack_data import loading, registry
from hijack_data.kernels.cpu import jit

from support import parts
from support.chromium import Browser, chromium
from support.slow import SLOW

# A shell that runs the suite in the background makes it ignore Ctrl-C, and so would every process
# that a test starts.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)

# Triton decides when it is imported whether its kernels run in its interpreter: they do where there
# is no GPU.
if not any(Path(name).exists() for name in ("/dev/nvidia0", "/dev/kfd")):
    os.environ["TRITON_INTERPRET"] = "1"

# On a busy machine an example may take any time. In CI the profile of that name has no deadline, too.
if "CI" not in os.environ:
    hypothesis.settings.register_profile("no_deadline", deadline=None)
    hypothesis.settings.load_profile("no_deadline")

# what the tests look at is the kernels, not the NumPy code of a process's first pictures
jit.start()

ROOT = Path(__file__).resolve().parent.parent
SHARED_DATA = ROOT.parent / "shared" / "data"


def pytest_addoption(parser: pytest.Parser) -> None:
    """Which part of the suite to run, and which cases of it."""
    group = parser.getgroup("parts of the suite")
    group.addoption("--part", choices=parts.PARTS, default="all", help="see tests/support/parts.py")
    group.addoption("--draw", type=int, default=None, help="seed of the cases of the core")


def pytest_configure(config: pytest.Config) -> None:
    """Fix the seed before other processes take over the options."""
    if config.option.draw is None:
        config.option.draw = parts.default_seed(ROOT)


def pytest_ignore_collect(collection_path: Path, config: pytest.Config) -> bool | None:
    """Do not even import files of which no test runs: some load several frameworks."""
    if config.option.markexpr == "not slow" and is_slow(collection_path):
        return True
    relative_path = collection_path.relative_to(ROOT / "tests").as_posix()
    return parts.is_ignored(relative_path, config.option.part) or None


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Mark the tests that `make check` leaves out, leave those of other parts out, and sort."""
    for item in items:
        if is_slow(item.path):
            item.add_marker("slow")
    selected = parts.select(items, config.option.part, config.option.draw)
    matches = [item for item in items if item.nodeid not in selected]
    if matches:
        config.hook.pytest_deselected(items=matches)
        items[:] = [item for item in items if item.nodeid in selected]
    items.sort(key=parts.starting_order)


def pytest_terminal_summary(
    terminalreporter: pytest.TerminalReporter, config: pytest.Config
) -> None:
    """Say how to run the same tests again."""
    part, seed = config.option.part, config.option.draw
    if part != "all":
        terminalreporter.write_line(f"these were the tests of --part {part} --draw {seed}")


@cache
def is_slow(path: Path) -> bool:
    """Whether this is one of the slow files, or needs a desktop."""
    relative_path = path.relative_to(ROOT / "tests")
    return relative_path.as_posix() in SLOW or relative_path.parts[:1] == ("live",)


@pytest.fixture(autouse=True)
def forgotten_names() -> Iterator[None]:
    """What a test registers is unknown to the next one, whose messages list all names."""
    before = {item.group: set(item.entries) for item in registry.registries()}
    files, listed = dict(loading._files), set(loading._listed)
    variable = os.environ.get(loading.VARIABLE)
    yield
    if loading._files.keys() != files.keys() or os.environ.get(loading.VARIABLE) != variable:
        # A file of a test; the variable names it to every process that begins later.
        loading._files.clear()
        loading._files.update(files)
        loading._listed.clear()
        loading._listed.update(listed)
        os.environ.pop(loading.VARIABLE, None)
        if variable is not None:
            os.environ[loading.VARIABLE] = variable
    for item in registry.registries():
        for name in set(item.entries) - before.get(item.group, set()):
            # What stands for an agent of a user, or of a file, is an object of a class of ours.
            entry = item.entries[name]
            kind = type(entry).__name__
            if not registry.is_ours(entry) or kind in ("AgentReference", "FileAgentMaker"):
                del item.entries[name]


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """The folder of real screenshots and trajectories; not part of the repository."""
    if not SHARED_DATA.is_dir():
        pytest.skip(f"the real recordings are not here ({SHARED_DATA}); see CONTRIBUTING.md")
    return SHARED_DATA


@pytest.fixture(scope="session")
def noise() -> np.ndarray:
    """A 216x384 RGB picture in which no two neighbouring pixels agree."""
    return np.random.default_rng(0).integers(0, 256, (216, 384, 3), dtype=np.uint8)


@pytest.fixture(scope="module")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    """A headless Chromium for the tests of a module; skips where there is none."""
    with chromium(tmp_path_factory.mktemp("chromium")) as result:
        yield result


@pytest.fixture
def no_waiting(monkeypatch: pytest.MonkeyPatch) -> None:
    """An agent's WAIT takes no time."""
    monkeypatch.setattr("online_env.environment.episode.WAIT_S", 0.0)
