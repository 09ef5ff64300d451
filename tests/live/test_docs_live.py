"""The documentation's blocks that start a desktop run, as pasted."""

import pytest

from support import needs
from support.docs import (
    ACTIVATE,
    DESKTOP,
    RUN,
    SHELL,
    blocks_of,
    clone,
    pages_with,
    python_blocks,
    run_python,
)
from support.pasting import Terminal

PRINTED = {"embedded_desktop.md": "Desktop", "bring_your_own_vm.md": "(720, 1280) ['accessibility'"}
pytestmark = pytest.mark.usefixtures("browser_machine")


@pytest.mark.parametrize("block", list(python_blocks(DESKTOP)))
def test_python_blocks_run(block, tmp_path):
    if "osworld=True" in block.text:
        needs.root("OSWorld's mode")
    printed = run_python(block.text, tmp_path)
    assert "False" not in printed
    assert PRINTED.get(block.page.name, "") in printed


@pytest.mark.parametrize("page", pages_with(DESKTOP), ids=lambda page: page.name)
def test_commands_work_as_pasted(page, tmp_path):
    """The blocks of a page that need a desktop, in their order; tests/test_docs.py runs the
    others."""
    shell = [block for block in blocks_of(page) if block.language in SHELL]
    terminal = Terminal(clone(tmp_path))
    terminal.active = any(ACTIVATE in block.lines for block in shell if block.kind == RUN)
    terminal.paste(block for block in shell if block.kind == DESKTOP)
    assert all(path.stat().st_size > 10_000 for path in tmp_path.glob("*.png"))
