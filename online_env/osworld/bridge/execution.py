"""Run code in the guest at most once, and with a `<` that is typed as one.

OSWorld's own client sends code up to three times if its answer is lost or is an error of the
server, so that an agent's text may be typed three times in one step. Its `step` rewrites `<` for
two functions of pyautogui, which types `>` instead.
"""

import json
import logging
import time
from typing import Any

import requests
import urllib3

ANSWER_TIMEOUT_S = 90  # as OSWorld's client waits
# As in `desktops.http`, which OSWorld's own Python does not have.
# For `<`, pyautogui's table names a key that types `>` with Shift; Shift and comma type `<`.
LESS_THAN = (
    "_keys = getattr(getattr(pyautogui, 'platformModule', None), 'keyboardMapping', {}); "
    "_keys.update([('<', _keys[','])] if ',' in _keys else []); "
)
_OK = 200
_log = logging.getLogger(__name__)


def execute_once(controller: Any, command: str) -> Any:
    """Return the guest's answer to Python code; `None` if there is none.

    Only what could not be sent is sent again: then the guest has not run it.

    Args:
        controller: OSWorld's `PythonController`.
        command: The code.
    """
    code = controller.pkgs_prefix.format(command=LESS_THAN + command)
    program = ["python", "-c", code]
    for _ in range(controller.retry_times):
        try:
            response = requests.post(
                f"{controller.http_server}/execute",
                headers={"Content-Type": "application/json"},
                data=json.dumps({"command": program, "shell": False}),
                timeout=ANSWER_TIMEOUT_S,
            )
            if response.status_code == _OK:
                return response.json()
            _log.error("the guest answered %d to code", response.status_code)
            return None
        except (requests.RequestException, ValueError) as error:
            _log.error("no answer of the guest to code: %s", error)
            if not _was_unsent(error):
                return None
        time.sleep(controller.retry_interval)
    return None


def _was_unsent(error: Exception) -> bool:
    """Return whether no connection was made."""
    reason = getattr(error.args[0], "reason", None) if error.args else None
    return isinstance(
        reason, urllib3.exceptions.NewConnectionError | urllib3.exceptions.ConnectTimeoutError
    )
