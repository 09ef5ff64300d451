"""Clean screens of one seed are equal, whatever the time is; the viewer of pictures asks nothing."""

import time
from typing import Any

import numpy as np
import pytest

from support import needs

pytest.importorskip("lxml", reason=needs.ONLINE)
pytest.importorskip("starlette", reason=needs.ONLINE)
pytest.importorskip("jinja2", reason=needs.ONLINE)

from online_env.environment.settle import Settle, wait_until_settled
from online_env.environment.stage import SmallTasks
from online_env.tasks import Hand
from online_env.tasks.kit import pictures


def screen(stage: SmallTasks, seed: int) -> Any:
    """Return the screen after a reset, without a caret that blinks."""
    stage.reset("rename_file", seed)
    return wait_until_settled(stage.desktop, Settle(), False).frame


def test_screens_of_one_seed_are_equal_in_another_minute(up: Any) -> None:
    stage = SmallTasks(up())
    first = screen(stage, 3)
    time.sleep(61 - time.time() % 60)  # the next minute
    assert np.array_equal(screen(stage, 3), first)


def test_the_first_start_of_the_picture_viewer_shows_no_dialog(up: Any) -> None:
    stage = SmallTasks(up())
    stage.reset("use_photoshop", 0)
    machine = stage.machine
    machine.write("Pictures/a.png", pictures.encoded(pictures.Image.new("RGB", (90, 60))))
    machine.open("ristretto", machine.path("Pictures/a.png"))
    hand = Hand(stage.desktop)
    hand.find("frame", None, "ristretto")
    time.sleep(2)
    assert not [node for node in hand.look() if node.role in ("dialog", "alert")]
