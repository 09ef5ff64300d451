"""Clean screens of one seed are equal, and no application shows a dialog at its first start."""

import functools
import time
from typing import Any

import numpy as np
import pytest

from support import needs

pytest.importorskip("lxml", reason=needs.ONLINE)
pytest.importorskip("starlette", reason=needs.ONLINE)
pytest.importorskip("jinja2", reason=needs.ONLINE)

from online_env.desktops import commands
from online_env.embedded.panel_clock import set_panel_clock
from online_env.environment.settle import Settle, wait_until_settled
from online_env.environment.stage import SmallTasks
from online_env.tasks import Hand
from online_env.tasks.kit import gimp
from online_env.tasks.tree_nodes import TreeNode


def reset_screen(stage: SmallTasks, seed: int) -> tuple[Any, str]:
    """Return the first settled picture of an episode, and the panel's part of its tree."""
    stage.reset("rename_file", seed)
    settled = wait_until_settled(stage.desktop, Settle(), with_tree=True)
    panel = str(settled.tree).partition('<application name="xfce4-panel">')[2]
    return settled.frame, panel.partition("</application>")[0]


def test_screens_of_one_seed_are_equal_and_seeds_differ_in_the_clock(up: Any) -> None:
    """In another minute, fonts included, whose hinting depends on which program starts first."""
    stage = SmallTasks(up())
    frame, panel = reset_screen(stage, 3)
    for _ in range(2):
        again, panel_again = reset_screen(stage, 3)
        assert np.array_equal(again, frame)
        assert panel_again == panel != ""
    time.sleep(62 - time.time() % 60)  # the next minute
    assert np.array_equal(stage.desktop.screenshot(), frame)
    set_panel_clock(stage.desktop, 4)
    changed_mask = (wait_until_settled(stage.desktop, Settle(), False).frame != frame).any(axis=2)
    rows, columns = np.nonzero(changed_mask)
    assert rows.min() >= changed_mask.shape[0] - 36
    assert columns.min() >= changed_mask.shape[1] - 130


def is_frame(name: str, node: TreeNode) -> bool:
    return node.role == "frame" and name in node.name


def test_first_starts_show_no_dialog(up: Any) -> None:
    stage = SmallTasks(up())
    stage.reset("use_photoshop", 0)
    machine = stage.machine
    machine.write("Pictures/a.png", gimp.encode(gimp.Image.new("RGB", (90, 60))))
    hand = Hand(stage.desktop, 60)
    starts = {"Impress": ("soffice", "--impress"), "Thunderbird": ("thunderbird",)}
    present = [
        name for name, argv in starts.items() if stage.desktop.execute(["which", argv[0]]).ok
    ]
    for name in present:
        commands.launch(stage.desktop, *starts[name])
    machine.open("ristretto", machine.path("Pictures/a.png"))
    for name in ("a.png", *present):  # another window may cover it: it has no box then
        hand.wait(f"frame {name}", functools.partial(is_frame, name))
    time.sleep(4)
    assert not [node.name for node in hand.look() if node.role in ("dialog", "alert")]
