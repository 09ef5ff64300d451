"""Agents of files for tests: settings without a file, and pictures to look at."""

import numpy as np

from online_env.agents.agent_files import read_agent
from online_env.agents.chat.agent import make_agent
from online_env.agents.chat.endpoint import RetryWaits
from online_env.agents.chat.run import ChatRun

AT_ONCE = RetryWaits(first=0.0, longest=0.0)
SIZE = (54, 96)


def picture(shade=0, size=SIZE):
    """An observation of one colour."""
    return {"screenshot": np.full((*size, 3), shade, np.uint8)}


def file(folder, url, text="", **keys):
    """An agent file: pyautogui over chat completions, but for `keys` and `text`."""
    entries = {
        "model": "m",
        "base_url": url,
        "prompt": "pyautogui",
        "parser": "pyautogui",
        "retries": 2,
        "timeout": 5,
        **keys,
    }
    lines = [f"{key}: {value}" for key, value in entries.items() if value is not None]
    path = folder / "agent.yaml"
    path.write_text("\n".join([*lines, text]) + "\n")
    return path


def agent_of(folder, url, text="", run=None, **keys):
    """The agent of such a file, which does not wait between tries."""
    run = run or ChatRun()
    run.waits = AT_ONCE
    return make_agent(read_agent(str(file(folder, url, text, **keys))), run)
