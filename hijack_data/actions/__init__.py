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
| `pyautogui` | Python code, or WAIT, FAIL, DONE | pixels |
| `computer_13` | dict of OSWorld | pixels |
| `ui_tars` | text of UI-TARS 1.0 | 0..1000 of the picture |
| `ui_tars_1.5` | text of UI-TARS 1.5 | pixels of the smart-resized picture |
| `qwen2.5_vl` | tool calls in text | pixels of the smart-resized picture |
| `qwen3_vl` | the same | 0..1000 of the picture |
| `openai`, `anthropic` | dict of the computer tool | pixels |

Inside, `dialects/` has one module for each dialect. `program/` analyses Python code without running
it, because mapping code requires the value of the coordinates at each call that moves the pointer.
"""

from .allowed import fenced_blocks, read_action
from .dialects import (
    DIALECTS,
    RESIZED_DIALECTS,
    TEXT_PARSERS,
    THOUSANDTHS,
    code_of,
    map_typed,
    parse_actions,
)
from .dialects.pyautogui_code import calls_pyautogui, map_code, scale_normalized
from .dialects.pyautogui_parse import parse_pyautogui
from .dialects.pyautogui_write import write_pyautogui
from .recorded import map_recorded
from .scaling import Scaling

__all__ = [
    "DIALECTS",
    "RESIZED_DIALECTS",
    "TEXT_PARSERS",
    "THOUSANDTHS",
    "Scaling",
    "calls_pyautogui",
    "code_of",
    "fenced_blocks",
    "map_code",
    "map_recorded",
    "map_typed",
    "parse_actions",
    "parse_pyautogui",
    "read_action",
    "scale_normalized",
    "write_pyautogui",
]
