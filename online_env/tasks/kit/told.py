"""Parts of plans in words that several tasks have."""

from ..plan_words import quoted


def visit(address: str, heading: str) -> list[str]:
    """Tell how to open a page in the browser that shows, and what to see then."""
    return [
        "press ctrl+l",
        f"type {quoted(address)}",
        "press delete",  # what the browser completed
        "press enter",
        f"wait for {quoted(heading)}",
    ]


def take_note(path: str, text: str) -> list[str]:
    """Tell how to write a text file with the editor; the path is relative to the home folder."""
    return [
        "press alt+f2",
        "wait",
        f"type {quoted('mousepad')}",
        "press enter",
        'window "Mousepad"',
        f"type {quoted(text)}",
        "press ctrl+s",
        f"wait for {quoted('Cancel')}",
        "press ctrl+a",
        f"type {quoted(f'/home/user/{path}')}",
        "press enter",
        f"wait for {quoted(path.rpartition('/')[2])}",
    ]
