"""The actions of agents: parse, write and check them, and map their coordinates.

This module is the front of the package:

* `parse_actions` reads an action of any dialect into `Action`s, `parse_pyautogui` reads code;
* `write_pyautogui` writes an `Action` as code, `code_of` writes a model's reply in a typed dialect
  as code;
* `map_typed` and `map_code` change the coordinates of an action and nothing else; `map_recorded`
  does the same for the action texts in recordings and dataset rows;
* `scale_normalized` turns fractions of the screen in code into pixels;
* `read_action` checks whether an agent on a live desktop may run an action.

`Scaling` is the one rule by which coordinates become pixels. Inputs are never modified. An action
that cannot be read or mapped raises `ActionError`. The dialects:

| dialect | form | coordinates |
|---|---|---|
| `pyautogui` | Python code, or WAIT, FAIL, DONE; also in ``` fences | pixels |
| `computer_13` | dict of OSWorld | pixels |
| `ui_tars`, `seed` | text of UI-TARS 1.0 and Doubao; Seed's XML | 0..1000 of the picture |
| `ui_tars_1.5` | text of UI-TARS 1.5 | pixels of the smart-resized picture |
| `qwen2.5_vl` | tool calls in text, as JSON or XML | pixels of the smart-resized picture |
| `qwen3_vl`, `gui_owl` | the same, also of Mobile-Agent | 0..1000 of the picture |
| `mai_ui` | the same | 0..999 of the picture |
| `openai`, `anthropic` | dict of the computer tool, or its API's item | pixels |
| `opencua` | a reply with fenced pyautogui code | pixels of the smart-resized picture |
| `holo1.5`; `holo2` | JSON, `Click(x, y)` | the smart-resized picture; 0..1000 |
| `glm`, `cogagent`, `autoglm` | calls in text | 0..1000 of the picture |
| `internvl` | `<box>[[x1,y1,x2,y2]]</box>` | 0..1000 of the picture |
| `showui` | dicts as Python writes them | 0..1 of the picture |
| `gemini` | function calls | 0..1000 of the picture |

Inside, `dialects/` has one table of all dialects; most are a table of actions and a syntax.
`pyautogui_grammar` reads Python code without running it: straight-line calls with literal
arguments, and nothing else.
"""

from typing import TYPE_CHECKING

from ..lazy_names import lazy_names
from .agent_actions import fenced_blocks, read_action, unreadable_action
from .scaling import Scaling

if TYPE_CHECKING:  # the same names, for type checkers
    from .dialects import DIALECTS as DIALECTS
    from .dialects import DICT_DIALECTS as DICT_DIALECTS
    from .dialects import FRACTIONS as FRACTIONS
    from .dialects import RESIZED_DIALECTS as RESIZED_DIALECTS
    from .dialects import TEXT_PARSERS as TEXT_PARSERS
    from .dialects import code_of as code_of
    from .dialects import map_typed as map_typed
    from .dialects import parse_actions as parse_actions
    from .dialects import parse_with as parse_with
    from .dialects.pyautogui_code import calls_pyautogui as calls_pyautogui
    from .dialects.pyautogui_code import count_points as count_points
    from .dialects.pyautogui_code import map_code as map_code
    from .dialects.pyautogui_code import scale_normalized as scale_normalized
    from .dialects.pyautogui_parse import parse_pyautogui as parse_pyautogui
    from .dialects.pyautogui_write import write_pyautogui as write_pyautogui
    from .recorded_actions import map_recorded as map_recorded

# Where names are defined whose modules know every dialect. They are imported on first use: a plan
# needs none, and they take half of its import.
_HOMES = {
    "DIALECTS": ".dialects",
    "DICT_DIALECTS": ".dialects",
    "FRACTIONS": ".dialects",
    "RESIZED_DIALECTS": ".dialects",
    "TEXT_PARSERS": ".dialects",
    "calls_pyautogui": ".dialects.pyautogui_code",
    "code_of": ".dialects",
    "count_points": ".dialects.pyautogui_code",
    "map_code": ".dialects.pyautogui_code",
    "map_recorded": ".recorded_actions",
    "map_typed": ".dialects",
    "parse_actions": ".dialects",
    "parse_pyautogui": ".dialects.pyautogui_parse",
    "parse_with": ".dialects",
    "scale_normalized": ".dialects.pyautogui_code",
    "write_pyautogui": ".dialects.pyautogui_write",
}

__all__ = [
    "DIALECTS",
    "DICT_DIALECTS",
    "FRACTIONS",
    "RESIZED_DIALECTS",
    "TEXT_PARSERS",
    "Scaling",
    "calls_pyautogui",
    "code_of",
    "count_points",
    "fenced_blocks",
    "map_code",
    "map_recorded",
    "map_typed",
    "parse_actions",
    "parse_pyautogui",
    "parse_with",
    "read_action",
    "scale_normalized",
    "unreadable_action",
    "write_pyautogui",
]

__getattr__ = lazy_names(__name__, _HOMES)
