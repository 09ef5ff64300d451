"""How long a screen is watched, on one that follows a script and a clock that the test winds."""

from collections.abc import Callable

import numpy as np
import pytest

pytest.importorskip("gymnasium", reason="needs the extra [online]")

from hijack_data.errors import ParameterError
from online_env.environment import Settle, settle
from online_env.environment.settle import Settled, wait_until_settled

RULE = Settle(quiet=0.3, cap=3.0, look=0.05)
SHOT, TREE = 0.01, 0.1  # seconds that a screenshot and a tree take


class Screen:
    """Shows number `shows(seconds)`; its tree names the number that shows when it is read."""

    def __init__(self, shows: Callable[[float], int], monkeypatch: pytest.MonkeyPatch) -> None:
        self.now = 100.0
        self.calls: list[str] = []
        self._shows = shows
        monkeypatch.setattr(settle.time, "monotonic", lambda: self.now)
        monkeypatch.setattr(settle.time, "sleep", self._pass)

    def _pass(self, seconds: float) -> None:
        self.now += seconds

    @property
    def passed(self) -> float:
        return self.now - 100.0

    @property
    def number(self) -> int:
        return self._shows(self.passed)

    def screenshot(self) -> np.ndarray:
        self.calls.append("shot")
        self._pass(SHOT)
        return np.full((2, 2 + self.number // 100, 3), self.number, np.uint8)

    def accessibility(self) -> str:
        self.calls.append("tree")
        self._pass(TREE)
        return f"<tree of='{self.number}'/>"

    def settled(self, with_tree: bool = False, rule: Settle = RULE) -> Settled:
        return wait_until_settled(self, rule, with_tree)  # type: ignore[arg-type]


def number_of(found: Settled) -> int:
    return int(found.frame[0, 0, 0])


def test_a_still_screen_is_watched_for_the_quiet_time(monkeypatch: pytest.MonkeyPatch) -> None:
    screen = Screen(lambda seconds: 1, monkeypatch)
    result = screen.settled()
    assert (number_of(result), result.tree, result.in_time) == (1, None, True)
    assert RULE.quiet <= screen.passed < RULE.quiet + 2 * (RULE.look + SHOT)
    assert set(screen.calls) == {"shot"}


def test_a_screen_that_never_rests_is_taken_at_the_cap(monkeypatch: pytest.MonkeyPatch) -> None:
    screen = Screen(lambda seconds: int(seconds / 0.1), monkeypatch)
    result = screen.settled()
    assert not result.in_time
    assert RULE.cap <= screen.passed < RULE.cap + RULE.look + 2 * SHOT
    assert number_of(result) == int((screen.passed - SHOT) / 0.1)


def test_another_size_is_another_screen(monkeypatch: pytest.MonkeyPatch) -> None:
    screen = Screen(lambda seconds: 100 if seconds < 0.2 else 200, monkeypatch)
    result = screen.settled()
    assert result.frame.shape == (2, 4, 3)
    assert screen.passed >= 0.2 + RULE.quiet


def test_the_tree_is_read_while_the_screen_is_watched(monkeypatch: pytest.MonkeyPatch) -> None:
    screen = Screen(lambda seconds: 1, monkeypatch)
    result = screen.settled(with_tree=True)
    assert (result.tree, result.tree_seconds) == ("<tree of='1'/>", TREE)
    assert screen.calls.count("tree") == 1
    assert screen.passed < RULE.quiet + TREE + 2 * (RULE.look + SHOT)


@pytest.mark.parametrize(
    "given",
    [
        {"quiet": -0.1},
        {"quiet": 60.1},
        {"quiet": float("nan")},
        {"cap": -1},
        {"cap": 601},
        {"look": 0},
        {"look": 10.1},
    ],
)
def test_times_that_make_no_sense_are_refused(given: dict[str, float]) -> None:
    with pytest.raises(ParameterError, match=r"quiet is 0..60 s, cap 0..600 s, look above 0"):
        Settle(**given)


def test_the_limits_themselves_are_fine() -> None:
    assert Settle(quiet=0, cap=0, look=10) != Settle(quiet=60, cap=600, look=10)
