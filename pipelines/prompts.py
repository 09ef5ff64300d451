"""Questions of exports to a model, in words that readers recognise."""

TASK_PREFIX = "Task: "
PROMPTS = {
    "pyautogui": (
        "Answer with the next action as Python code that calls pyautogui, in pixels of the "
        "screenshot, or with WAIT, FAIL or DONE."
    ),
    "ui_tars": (
        "Answer with the next action, such as click(start_box='(x,y)'), type(content='...') or "
        "finished(); coordinates are 0 to 1000 of the screenshot's width and height."
    ),
    "ui_tars_1.5": (
        "Answer with the next action, such as click(start_box='(x,y)'), type(content='...') "
        "or finished(); coordinates are pixels of the screenshot as you see it."
    ),
}
# The space of the coordinates of an answer, as `readers.choices` names it.
SPACES = {"pyautogui": "pixels", "ui_tars": "thousand", "ui_tars_1.5": "resized"}


def question(instruction: str, how: str) -> str:
    """Return the message of the user: the task, and how to answer."""
    return f"{TASK_PREFIX}{instruction}\n{how}"


def parse_question(text: str) -> tuple[str, str] | None:
    """Return the instruction and the space of the answers of a `question`; `None` for others."""
    if not text.startswith(TASK_PREFIX):
        return None
    for dialect, how in PROMPTS.items():
        ending = f"\n{how}"
        if text.endswith(ending):
            instruction = text[len(TASK_PREFIX) : -len(ending)]
            return instruction, SPACES[dialect]
    return None
