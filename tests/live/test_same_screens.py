"""No time shows on a clean screen, and the viewer of pictures asks nothing at its first start."""

import time
from typing import Any

import numpy as np
import pytest

from support import needs

pytest.importorskip("lxml", reason=needs.ONLINE)
pytest.importorskip("starlette", reason=needs.ONLINE)
pytest.importorskip("jinja2", reason=needs.ONLINE)

from online_env.environment.stage import SmallTasks
from online_env.tasks import Hand
from online_env.tasks.kit import gimp


def test_the_clock_of_the_panel_stands_still(up: Any) -> None:
    stage = SmallTasks(up())
    stage.reset("rename_file", 3)
    time.sleep(3)  # after its start the panel draws the clock in two steps
    first = stage.desktop.screenshot()
    time.sleep(62 - time.time() % 60)  # the next minute
    assert np.array_equal(stage.desktop.screenshot(), first)


def test_clean_screens_are_equal(up: Any) -> None:
    """Fonts included, whose hinting depends on which program starts first."""
    desktop = up()
    screens = []
    for _ in range(4):
        desktop.reset()
        time.sleep(3)  # see above
        screens.append(desktop.screenshot())
    assert all(np.array_equal(screen, screens[0]) for screen in screens)


def test_the_first_start_of_the_picture_viewer_shows_no_dialog(up: Any) -> None:
    stage = SmallTasks(up())
    stage.reset("use_photoshop", 0)
    machine = stage.machine
    machine.write("Pictures/a.png", gimp.encoded(gimp.Image.new("RGB", (90, 60))))
    machine.open("ristretto", machine.path("Pictures/a.png"))
    hand = Hand(stage.desktop)
    hand.find("frame", None, "ristretto")
    time.sleep(2)
    assert not [node for node in hand.look() if node.role in ("dialog", "alert")]
