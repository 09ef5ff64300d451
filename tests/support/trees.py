"""Desktops whose accessibility trees are written down."""

from dataclasses import dataclass, field

import numpy as np

from online_env.desktops.protocol import RunResult

SPACE = "https://accessibility.ubuntu.example.org/ns"


def tree(app: str, *nodes: str) -> str:
    """Return a tree with one application."""
    return (
        f'<desktop-frame xmlns:st="{SPACE}/state" xmlns:cp="{SPACE}/component" name="main">'
        f'<application name="{app}">{"".join(nodes)}</application></desktop-frame>'
    )


def node(
    role: str,
    name: str = "",
    *states: str,
    at: tuple[int, int] = (100, 200),
    size: tuple[int, int] = (80, 100),
    text: str = "",
) -> str:
    """Return a visible node, in pixels of the screen."""
    flags = " ".join(f'st:{state}="true"' for state in ("showing", "visible", *states))
    position = f'cp:screencoord="({at[0]}, {at[1]})" cp:size="({size[0]}, {size[1]})"'
    return f'<{role} name="{name}" {flags} {position}>{text}</{role}>'


@dataclass
class Trees:
    """A desktop that shows the next tree after each action, and the last one from then on."""

    trees: list[str]
    ran: list[str] = field(default_factory=list)
    result: RunResult = field(default_factory=lambda: RunResult("success", returncode=0))

    def accessibility(self) -> str:
        return self.trees[min(len(self.ran), len(self.trees) - 1)]

    def run(self, code: str) -> RunResult:
        self.ran.append(code)
        return self.result

    def screenshot(self) -> np.ndarray:
        return np.full((100, 100, 3), len(self.ran), np.uint8)

    def execute(self, argv: object, timeout: float = 60) -> RunResult:
        return RunResult("success", "/home/user", returncode=0)
