"""The contact sheet of all nine on a live desktop."""

import os

import numpy as np
import pytest

from support import needs

pytest.importorskip("lxml", reason=needs.ONLINE)

import hijack_data as hj
from hijack_data.errors import ParameterError
from hijack_data.gallery import contact_sheet
from online_env.showcase import ShowcaseEntry, sheet, show_nine


def test_all_nine_are_shown_proved_and_taken_back(browser_machine):
    from online_env.embedded.desktop import EmbeddedDesktop

    with EmbeddedDesktop.up(name=f"ts{os.getpid()}") as desktop:
        items = list(show_nine(desktop))
    assert [item.name for item in items] == hj.corruption_names()[:9]
    assert [item.saw for item in items if not item.ok] == []
    assert all(item.saw for item in items)
    for item in items:
        assert item.before.shape == (1080, 1920, 3)
        assert item.after.shape == (
            (540, 960, 3) if item.name == "resolution" else item.before.shape
        )
        assert item.name == "resolution" or (item.before != item.after).any()
        # Each begins where the one before it ended: nothing of that is left but the pointer.
        assert (item.before != items[0].before).any(-1).mean() < 0.03, item.name
    picture = sheet(items)
    assert picture.shape[1] == 1600
    assert picture.shape[0] > 9 * 430


def test_captions_stand_below_the_titles_and_what_failed_says_so():
    grey = np.full((90, 160, 3), 200, np.uint8)
    plain = contact_sheet([("one", grey, grey)], 400)
    with_caption = contact_sheet([("one", grey, grey)], 400, ["seen"])
    assert with_caption.shape[0] - plain.shape[0] == 30
    band = with_caption[24 + 40 : 24 + 40 + 30]
    assert band.min() < 60  # there is ink
    assert (with_caption[: 24 + 40] == plain[: 24 + 40]).all()
    good, bad = (
        sheet([ShowcaseEntry("marks", grey, grey, ok, "same")], 400) for ok in (True, False)
    )
    assert (good != bad).any()
    with pytest.raises(ParameterError, match="2 captions for 1 rows"):
        contact_sheet([("one", grey, grey)], 400, ["a", "b"])
