"""app_freeze and slow_network without a desktop: plans, what is read from /proc, refusals."""

import pytest

pytest.importorskip("gymnasium", reason="needs the extra [online]")

import hijack_data as hj
from hijack_data import conformance
from hijack_data.corruption import corruption_names, find_corruption, make_corruption
from hijack_data.plan import Effect
from hijack_data.types import Scene
from online_env.bench.config import Bench, override
from online_env.desktops.protocol import RunResult
from online_env.effects import EffectError, perform, resume
from online_env.effects.app_freeze import _Process
from online_env.environment.script import check_corruptions
from online_env.errors import MissingCapabilityError

from support.live import FakeDesktop

NAMES = ("app_freeze", "slow_network")


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize(
    "check", conformance.CHECKS, ids=lambda c: c.__name__.removeprefix("check_")
)
def test_conformance(name, check):
    result = conformance.run_check(check, find_corruption(name))
    assert result.ok, result.problem


def test_they_are_named_and_never_among_all():
    assert len(hj.corruption_names()) == len(set(hj.corruption_names()) - set(NAMES))
    assert set(NAMES) <= set(corruption_names("everyday"))
    named = override(Bench(), corruption=",".join(NAMES)).planners
    assert [planner.label for planner in named.values()] == list(NAMES)
    assert not set(NAMES) & set(override(Bench(), corruption="all").planners)


def test_each_severity_is_harsher_than_the_one_before():
    levels = [find_corruption("app_freeze").at(level).seconds for level in range(1, 6)]
    assert levels == sorted(set(levels))
    rates = [find_corruption("slow_network").at(level).rate for level in range(1, 6)]
    assert rates == sorted(set(rates), reverse=True)
    plan = make_corruption("app_freeze", seconds=7).plan(Scene((200, 300)), seed=0)
    assert plan.effects == (Effect("freeze", {"lasts": {"seconds": 7}}),)


def test_a_process_may_have_any_name():
    line = "49 (a) b (c) T 1 49 49 0 -1 4194560 5732 0 0 0 21 5 0 0 30 10 4 0 4422338 397086720"
    process = _Process.parse(line)
    assert (process.pid, process.name, process.state) == (49, "a) b (c", "T")
    assert (process.parent, process.start) == (1, 4422338)


class Machine(FakeDesktop):
    """A desktop with one window, whose processes and network are texts of the test."""

    def __init__(self, processes=(), window=None, root_ok=True):
        super().__init__()
        self.processes, self.window, self.root_ok = list(processes), window, root_ok
        self.scripts = []

    def tool(self, name, operation, fields, timeout=60):
        windows = [] if self.window is None else [self.window]
        return {"windows": windows, "active": 1}

    def execute(self, argv, timeout=60):
        self.scripts.append(argv)
        lines = [
            f"{p} (x) {s} {up} " + "0 " * 17 + f"{start} 0" for p, s, up, start in self.processes
        ]
        return RunResult("success", "\n".join(lines), "", 0)

    def network_root(self, script):
        self.scripts.append(script)
        return RunResult("success", "", "no tbf", 0 if self.root_ok else 2)


WINDOW = {"id": 1, "pid": 5, "title": "Notes", "mapped": True, "type": "normal"}


def test_a_process_that_only_has_the_number_of_a_stopped_one_proves_nothing():
    record = {
        "effect": "freeze",
        "params": {},
        "did": {"window": "Notes", "seconds": 9.0, "already": False, "processes": [[5, 100, "x"]]},
        "probes": [],
        "undone": [],
    }
    cases = {
        ((5, "T", 1, 100), (6, "T", 5, 101)): "",
        ((5, "T", 1, 100), (6, "S", 5, 101)): "not stopped: x (S)",
        ((5, "S", 1, 100),): "not stopped: x (S)",
        ((5, "T", 1, 999),): "the processes that were stopped are not there",
    }
    for processes, problem in cases.items():
        assert resume(record, Machine(processes)).probe().problem == problem


def test_without_a_window_nothing_is_stopped():
    for window in (None, {**WINDOW, "pid": 0}, {**WINDOW, "mapped": False}):
        machine = Machine([(5, "S", 1, 100)], window)
        with pytest.raises(EffectError, match="no window in front"):
            perform(Effect("freeze", {"lasts": {"seconds": 5}}), machine)
        assert machine.scripts == []
    with pytest.raises(EffectError, match="lasts must be"):
        perform(Effect("freeze"), Machine([(5, "S", 1, 100)], WINDOW))


def test_a_kernel_that_cannot_limit_is_refused_before_the_run():
    machine = Machine(root_ok=False)
    with pytest.raises(MissingCapabilityError, match="a kernel with tbf, ifb, u32 and mirred"):
        check_corruptions([make_corruption("slow_network")], 5, machine)
    assert len(machine.scripts) == 1, "nothing but the trial on a device of its own"
