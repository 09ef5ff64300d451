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
`program/` analyses Python code without running it, because mapping code requires the value of the
coordinates at each call that moves the pointer.
"""

from .agent_actions import fenced_blocks, read_action, unreadable_action
from .dialects import (
    DIALECTS,
    DICT_DIALECTS,
    FRACTIONS,
    RESIZED_DIALECTS,
    TEXT_PARSERS,
    code_of,
    map_typed,
    parse_actions,
    parse_with,
)
from .dialects.pyautogui_code import calls_pyautogui, count_points, map_code, scale_normalized
from .dialects.pyautogui_parse import parse_pyautogui
from .dialects.pyautogui_write import write_pyautogui
from .recorded_actions import map_recorded
from .scaling import Scaling

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
