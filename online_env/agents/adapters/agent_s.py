"""Agent S3 (`gui-agents`), which has OSWorld's interface, as one of our agents.

A class with `engine` and `grounding` is an agent, see docs/score_my_agent.md.
"""

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

from hijack_data import extras
from hijack_data.errors import ParameterError

from ..base import DONE, FAIL, Observation
from .osworld import OsworldAgent

EXTRA = "agent-s"
_GROUNDING = "gui_agents.s3.agents.grounding"
_AGENT = "gui_agents.s3.agents.agent_s"
_REQUIRED_KEYS = (
    ("engine", ("engine_type", "model")),
    ("grounding", ("engine_type", "model", "grounding_width", "grounding_height")),
)


class AgentS(OsworldAgent):
    """Plays as Agent S3, with pointer and keyboard only.

    Its code agent is off, since it would run programs on the machine, and two of its actions are
    reimplemented (`plain_aci`). Its action `set_cell_values` runs a program and is refused.

    Raises:
        ParameterError: `engine` or `grounding` lacks a key.
        MissingDependencyError: `gui-agents` is not installed.
    """

    engine: ClassVar[Mapping[str, Any]] = {}
    grounding: ClassVar[Mapping[str, Any]] = {}
    # More arguments of `AgentS3`, such as `enable_reflection`.
    options: ClassVar[Mapping[str, Any]] = {}

    def __init__(self) -> None:
        for attribute, keys in _REQUIRED_KEYS:
            settings = getattr(self, attribute)
            missing = [key for key in keys if key not in settings]
            if missing:
                name = type(self).__name__
                raise ParameterError(f"{name}.{attribute} lacks {', '.join(missing)}")
        self._aci = plain_aci()(
            env=None,
            platform="linux",
            engine_params_for_generation=dict(self.engine),
            engine_params_for_grounding=dict(self.grounding),
        )
        module = extras.load(_AGENT, "Agent S3", EXTRA)
        agent = module.AgentS3(dict(self.engine), self._aci, platform="linux", **self.options)
        super().__init__(agent)

    def predict(self, instruction: str, obs: Observation) -> tuple[str, Sequence[str]]:
        """Return the agent's plan and its action as code."""
        # Agent S3 scales the points of its grounding model to a screen of this size.
        self._aci.height, self._aci.width = obs["screenshot"].shape[:2]
        words, actions = super().predict(instruction, obs)
        return words, [_word(action) for action in actions]


def _word(action: str) -> str:
    """Return `DONE` and `FAIL` without the text around them."""
    stripped = action.strip()
    return stripped if stripped in (DONE, FAIL) else action


def plain_aci() -> Any:
    """Return Agent S3's actions with `type` and `switch_applications` as plain keys.

    The original ones install a package with sudo to use the clipboard, and run wmctrl, which is
    neither pointer nor keyboard. The model of Agent S3 reads the docstrings below.
    """
    module = extras.load(_GROUNDING, "Agent S3", EXTRA)
    action = module.agent_action

    class PlainACI(module.OSWorldACI):
        @action
        def type(
            self,
            element_description: str | None = None,
            text: str = "",
            overwrite: bool = False,
            enter: bool = False,
        ) -> str:
            """Type text into an element.

            Args:
                element_description: which element, in a full sentence; omit it to type into the
                    element that has the focus.
                text: what to type.
                overwrite: whether to delete what the element holds first.
                enter: whether to press Enter at the end.
            """
            lines: list[str] = []
            if element_description is not None:
                point = self.generate_coords(element_description, self.obs)
                x, y = self.resize_coordinates(point)
                lines.append(f"pyautogui.click({x}, {y})")
            if overwrite:
                lines.append("pyautogui.hotkey('ctrl', 'a')")
                lines.append("pyautogui.press('backspace')")
            lines.append(f"pyautogui.write({text!r})")
            if enter:
                lines.append("pyautogui.press('enter')")
            return "\n".join(["import pyautogui", *lines])

        @action
        def switch_applications(self, app_code: str) -> str:
            """Switch to the application that was in use before this one.

            Args:
                app_code: the name of the application, for the record.
            """
            return "import pyautogui\npyautogui.hotkey('alt', 'tab')"

    return PlainACI
