"""Faults of the input on a real desktop: the X server confirms each, and notices sabotage."""

from typing import Any

import pytest

from hijack_data.plan import Plan
from hijack_data.plugin import InputFault
from hijack_data.types import as_boxes
from online_env.environment.input_faults import InputChannel

FAULTS = {
    "drop": InputFault("drop"),
    "repeat": InputFault("repeat", times=3),
    "offset": InputFault("offset", dx=40, dy=-7),
}
ACTIONS = {
    "click": "pyautogui.click(700, 500)",
    "drag": "pyautogui.moveTo(700, 500); pyautogui.dragTo(740, 540, duration=0.2)",
    "click with a key": "pyautogui.keyDown('shift'); pyautogui.click(9, 500); pyautogui.keyUp('shift')",
    "keys": "pyautogui.hotkey('shift', 'f7'); pyautogui.write('aß')",
}


class Deaf(InputChannel):
    """Sends the agent's own code, whatever the faults make of it."""

    def _run(self, code: str) -> Any:
        return super()._run(ACTIONS["click"])


def send(channel: InputChannel, fault: InputFault, code: str) -> tuple[str, dict[str, Any]]:
    channel.add(Plan("test-v1", (1080, 1920), inputs=(fault,)))
    line: dict[str, Any] = {"step": 0}
    _, problem = channel.send(code, line, as_boxes(None))
    return problem, line


@pytest.mark.parametrize("action", ACTIONS)
@pytest.mark.parametrize("kind", FAULTS)
def test_the_x_server_confirms_a_fault(embedded_desktop, kind, action):
    channel = InputChannel(embedded_desktop, embedded_desktop.size)
    problem, line = send(channel, FAULTS[kind], ACTIONS[action])
    assert problem == ""
    if (kind, action) == ("offset", "keys"):
        assert "input" not in line, "there is no point to shift"
        return
    probe = line["input"]["probe"]
    assert (probe["ok"], probe["facts"]["by"]) == (True, "events")
    assert bool(probe["facts"]["events"]) == (kind != "drop")


@pytest.mark.parametrize("kind", FAULTS)
def test_a_fault_that_does_not_reach_the_machine_is_noticed(embedded_desktop, kind):
    channel = Deaf(embedded_desktop, embedded_desktop.size)
    problem, _ = send(channel, FAULTS[kind], ACTIONS["click"])
    expected = {
        "drop": "none was sent",
        "repeat": "not 3 times",
        "offset": "went down at [700, 500]",
    }
    assert expected[kind] in problem
