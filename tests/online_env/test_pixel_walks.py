"""Where `pixel` clicks, how long it looks, what it repairs: on texts that OCR might have read."""

import numpy as np
import pytest

pytest.importorskip("gymnasium", reason="needs the extra [online]")
pytest.importorskip("rapidocr", reason="needs the extra [ocr]")

from online_env.agents.pixel import onlooker_agent, screen_reader
from online_env.agents.pixel.onlooker_agent import PixelOnlooker
from online_env.agents.pixel.picture_changes import changed_boxes, changed_share, merged, touch
from online_env.agents.pixel.picture_onlooker import GONE, PictureOnlooker, panel_buttons
from online_env.agents.pixel.plan_walk import MAX_SCROLLS, MAX_WAITS, PlanWalk
from online_env.agents.pixel.screen_reader import ScreenReader, TextCache, TextLine
from online_env.agents.pixel.text_matching import all_texts, find_text
from online_env.tasks.plan_words import read_plan

SIZE = (400, 600)
DARK = np.zeros((*SIZE, 3), np.uint8)
TALL = 20


def line(text, x=0, y=0, since=0):
    return TextLine(text=text, box=(x, y, x + 10 * len(text), y + TALL), since=since)


@pytest.fixture
def screens(monkeypatch):
    """Pictures whose text is known: the shade of a picture is the number of its lines."""
    texts = []

    def read(part):
        return [(line.text, line.box) for line in texts[int(part[0, 0, 0])]]

    def show(*lines):
        texts.append(lines)
        return np.full((*SIZE, 3), len(texts) - 1, np.uint8)

    monkeypatch.setattr(screen_reader, "_read", read)
    monkeypatch.setattr(screen_reader, "SHARED", TextCache(0))
    return show


def walk(*steps):
    return PlanWalk(read_plan(steps), ScreenReader())


# Where it clicks


@pytest.mark.parametrize(
    ("step", "code"),
    [
        ('click "Name"', "pyautogui.click(220, 110)"),
        ('double-click "Name"', "pyautogui.doubleClick(220, 110)"),
        ('click right of "Name"', "pyautogui.click(300, 110)"),
        ('click left of "Name"', "pyautogui.click(140, 110)"),
        ('right-click above "Name"', "pyautogui.rightClick(220, 68)"),
        ('click below "Name"', "pyautogui.click(220, 152)"),
        ('click left of "Edge"', "pyautogui.click(0, 10)"),
        ('click above "Edge"', "pyautogui.click(20, 0)"),
        ('click right of "Corner"', "pyautogui.click(599, 390)"),
        ('click below "Corner"', "pyautogui.click(570, 399)"),
        (
            'ctrl-click "Name"',
            "pyautogui.keyDown('ctrl')\npyautogui.click(220, 110)\npyautogui.keyUp('ctrl')",
        ),
    ],
)
def test_a_click_is_in_the_middle_or_beside_and_always_on_the_picture(screens, step, code):
    picture = screens(line("Name", 200, 100), line("Edge"), line("Corner", 540, 380))
    assert walk(step).act(picture).action == code


@pytest.mark.parametrize(
    ("step", "code"),
    [
        ("press tab 3 times", "pyautogui.press('tab', presses=3)"),
        ("press ctrl+z 2 times", "pyautogui.hotkey('ctrl', 'z')\npyautogui.hotkey('ctrl', 'z')"),
        ('type "it\'s 1\\n"', 'pyautogui.write("it\'s 1\\n")'),
        ("scroll up 3", "pyautogui.scroll(3, 300, 200)"),
        ("scroll down", "pyautogui.scroll(-1, 300, 200)"),
        ('give up "no"', "FAIL"),
        ("wait", "WAIT"),
    ],
)
def test_a_step_that_needs_no_text_is_taken_at_once(screens, step, code):
    result = walk(step)
    walked = result.act(screens())
    assert (walked.action, walked.words) == (code, f"Step 1 of 1: {step}.")
    assert result.ended
    assert result.act(DARK).words == "That was the whole plan."


def test_the_text_beside_its_anchor_is_taken_and_none_without_the_anchor(screens):
    rows = [line("Edit", 300, 0), line("Edit", 300, 100), line("Tom", 0, 100)]
    picture = screens(*rows)
    assert walk('click "Edit" near "Tom"').act(picture).action == "pyautogui.click(320, 110)"
    without = walk('click "Edit" near "Ann"').act(picture)
    assert without.action == "WAIT"
    assert without.words.endswith("I do not see 'Edit'.")


# How long it looks


def test_the_wheel_turns_so_often_then_it_waits_and_then_it_is_lost(screens):
    picture = screens(line("Sent"))
    result = walk('scroll up to "Trash"')
    actions = [result.act(picture).action for _ in range(MAX_SCROLLS + MAX_WAITS)]
    assert actions == ["pyautogui.scroll(5, 300, 200)"] * MAX_SCROLLS + ["WAIT"] * MAX_WAITS
    answer = result.act(picture)
    assert (answer.is_lost, answer.action) == (True, "")
    assert answer.words.endswith("I do not see 'Trash'. The closest text is 'Sent'.")
    result.wait_again()
    assert result.act(picture).action == "pyautogui.scroll(5, 300, 200)"
    assert not result.ended


def test_a_text_that_comes_late_is_clicked_and_the_next_one_is_waited_for_anew(screens):
    empty, first, two_lines = (
        screens(),
        screens(line("One")),
        screens(line("One"), line("Four", 0, 50)),
    )
    value = walk('window "One"', 'click "One"', 'click "Four"')
    actions = [
        value.act(picture).action for picture in (empty, empty, first, first, first, two_lines)
    ]
    clicks = ["pyautogui.click(15, 10)", "pyautogui.click(20, 60)"]
    assert actions == ["WAIT", "WAIT", clicks[0], "WAIT", "WAIT", clicks[1]]


def test_the_window_at_work_is_the_last_one_named_so_far(screens):
    picture = screens(line("Thunar"), line("Mousepad", 0, 50))
    result = walk("press f2", 'window "Thunar"', "press f3", 'window "Mousepad"', "press f4")
    windows = []
    while not result.ended:
        windows.append(result.window)
        result.act(picture)
    assert windows == ["", "Thunar", "Mousepad"]


# What it reads


def test_a_smaller_picture_has_no_texts_of_the_larger_one(screens):
    reader = ScreenReader()
    large = screens(line("near", 10, 5), line("far right", 400, 5), line("low", 10, 300))
    small = screens(line("near", 10, 5))[:200, :300]
    assert len(reader.read(large)) == 3
    assert [(item.text, item.since) for item in reader.read(small)] == [("near", 1)]
    assert walk('click "low"').act(small).action == "WAIT"


def test_a_line_that_moved_is_new_and_one_that_stayed_is_not(screens):
    reader = ScreenReader()
    reader.read(screens(line("Stay"), line("Move", 0, 100)))
    again = reader.read(screens(line("Stay"), line("Move", 0, 300), line("Stay", 0, 200)))
    assert [(item.text, item.box[1], item.since) for item in again] == [
        ("Stay", 0, 0),
        ("Stay", 200, 1),
        ("Move", 300, 1),
    ]
    reader.forget()
    assert (reader.counts.pictures, reader.counts.calls) == (0, 0)


@pytest.mark.parametrize("place", [(0, 0), (69, 99), (64, 96), (31, 32)])
def test_the_change_of_one_pixel_is_in_one_tile_of_the_picture(place):
    before = np.zeros((70, 100, 3), np.uint8)
    after = before.copy()
    after[(*place, 2)] = 1
    ((x1, y1, x2, y2),) = changed_boxes(before, after)
    row, column = place
    assert x1 == column // 32 * 32
    assert y1 == row // 32 * 32
    assert (x2, y2) == (min(x1 + 32, 100), min(y1 + 32, 70))
    assert changed_share(before, after) == 1 / 12
    assert changed_share(before[:-1], after) == 1.0


def test_merged_boxes_hold_all_and_none_touch():
    draws = np.random.default_rng(5)
    for _ in range(50):
        boxes = []
        for x, y, width, height in draws.integers(1, 25, (8, 4)).tolist():
            boxes.append((4 * x, 4 * y, 4 * x + width, 4 * y + height))
        result = merged(boxes)
        for box in boxes:
            holders = [
                (x1, y1)
                for x1, y1, x2, y2 in result
                if x1 <= box[0] and y1 <= box[1] and box[2] <= x2 and box[3] <= y2
            ]
            assert len(holders) == 1
        assert not [
            1 for item in result for second in result if item != second and touch(item, second)
        ]


def test_a_text_that_was_read_with_mistakes_counts_only_if_none_was_read_well():
    lines = [line("Docunents"), line("Documents", y=50), line("My Documents", y=100)]
    assert [all_text.line.text for all_text in all_texts(lines, "Documents")] == [
        "Documents",
        "My Documents",
    ]
    (all_text,) = all_texts(lines[:1], "Documents")
    assert 0.6 < all_text.likeness < 0.85, "less than a part that was read well"
    part = find_text([line("Open the Docunents here")], "Documents")
    assert part.box == (90, 0, 180, TALL)
    assert find_text([line("ab")], "Documents") is None
    assert find_text([line("anything")], " ") is None


# What the onlooker sees and repairs


def panel(*buttons):
    """The panel at the bottom: the menu, buttons, and the clock to the right."""
    row = [line("Applications", 0, 375)]
    x = 130
    for text in buttons:
        row.append(line(text, x, 375))
        x += 10 * len(text) + 10
    return [*row, line("Mon 12:30", 545, 375)]


def test_buttons_are_those_between_the_menu_and_the_clock():
    lines = [*panel("Thunar", "42", "Mousepad"), line("Trash", 200, 300)]
    result = panel_buttons(list(reversed(lines)), SIZE)
    assert [button.text for button in result] == ["Thunar", "Mousepad"]
    assert panel_buttons([line("Thunar", 130, 375)], SIZE) == []


def test_a_window_is_gone_only_if_little_else_is_to_be_seen():
    desktop = [line(f"icon {number}", 0, 30 * number) for number in range(7)]
    onlooker = PictureOnlooker(())
    bare = [*desktop[:6], *panel("Thunar")]  # eight lines with the menu and the clock
    assert onlooker.watch(bare, SIZE, ["Thunar"]).kind == GONE
    assert onlooker.watch([*desktop, *panel("Thunar")], SIZE, ["Thunar"]) is None
    assert onlooker.watch(bare, SIZE, []) is None, "the plan names no window"
    assert onlooker.watch(desktop[:6], SIZE, ["Thunar"]) is None, "no panel shows"


def test_a_summary_names_six_texts_that_came_and_six_that_went():
    before, after = ([line(f"{word}{n}ab") for n in range(8)] for word in ("old", "new"))
    output = PictureOnlooker(()).summarise("Step.", [*before, line("both")], after, 0.256)
    names = [", ".join(repr(f"{word}{n}ab") for n in range(6)) for word in ("new", "old")]
    assert output == f"Step. 26% of the screen changed. New: {names[0]}. Gone: {names[1]}."
    assert PictureOnlooker(()).summarise("Step.", after, after, 0.0) == "Step. Nothing has changed."


def test_a_step_that_is_lost_is_tried_again_so_often_and_no_more(screens):
    picture = screens(line("Sent"), line("Draft", 0, 50))
    agent = PixelOnlooker()
    agent.reset()
    agent.follow(['click "Trash"'])
    values = [agent.predict("", {"screenshot": picture})[1][0] for _ in range(20)]
    esc = "pyautogui.press('esc', presses=1)"
    assert values.count(esc) == onlooker_agent.MAX_SAME_RECOVERIES
    end = values.index("DONE")
    assert set(values[:end]) == {"WAIT", esc}
    assert set(values[end:]) == {"DONE"}, "it does not begin again"
    agent.reset()
    agent.follow(['click "Draft"'])
    assert agent.predict("", {"screenshot": picture})[1] == ["pyautogui.click(25, 60)"]


def test_a_disturbance_is_put_right_three_times_and_then_the_plan_goes_on(screens):
    locked = screens(line("Password:"), line("Unlock", 0, 50))
    agent = PixelOnlooker()
    agent.reset()
    agent.follow(["press f2"])
    values = [agent.predict("", {"screenshot": locked})[1][0] for _ in range(12)]
    again = ["pyautogui.write('password')", "pyautogui.press('enter', presses=1)", "WAIT"]
    assert values[:10] == ["REQUEST_REINIT", *again * 3]
    assert values[10:] == ["pyautogui.press('f2', presses=1)", "DONE"]
