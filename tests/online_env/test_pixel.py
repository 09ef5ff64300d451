"""The agents `pixel` and `pixel_onlooker`, with real OCR on pictures of a real desktop."""

import inspect
import multiprocessing
import sys
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

pytest.importorskip("gymnasium", reason="needs the extra [online]")
pytest.importorskip("rapidocr", reason="needs the extra [ocr]")

from hijack_data.errors import MissingDependencyError
from online_env.agents import conformance
from online_env.agents.agent_process import AgentProcess
from online_env.agents.agent_thread import AgentThread
from online_env.agents.base import PlanFollower
from online_env.agents.pixel import screen_reader
from online_env.agents.pixel.picture_changes import changed_boxes, changed_share, merged
from online_env.agents.pixel.picture_onlooker import COVERED, GONE, PictureOnlooker
from online_env.agents.pixel.screen_reader import ScreenReader, TextCache, TextLine
from online_env.agents.pixel.text_matching import closest_text, find_text
from online_env.agents.registry import AGENTS, make
from online_env.bench.config import Bench
from online_env.bench.episodes import _pass_plan
from online_env.bench.models import ModelOptions, prepare

ROOT = Path(__file__).resolve().parents[2]
MENU = (640, 270, 1120, 580)  # of the recording "rename": a file list and its context menu


@cache
def picture(place: str, box: tuple[int, int, int, int] | None = None) -> np.ndarray:
    image = Image.open(ROOT / place).convert("RGB")
    return np.asarray(image.crop(box) if box else image)


def before_menu() -> np.ndarray:
    return picture("examples/recordings/images/rename-02.png", MENU)


def with_menu() -> np.ndarray:
    return picture("examples/recordings/images/rename-03.png", MENU)


def locked() -> np.ndarray:
    return picture("hijack_data/assets/lock_screen-1920x1080-1.webp", (640, 330, 1280, 740))


def offline() -> np.ndarray:
    return picture("hijack_data/assets/error_page-chromium-960x1043-3.webp")[60:480]


def renaming(number: int) -> np.ndarray:
    return picture(f"examples/recordings/images/rename-{number:02d}.png", (700, 440, 1240, 640))


def sharing(folder: Path) -> TextCache:
    """A cache as another process of a run has it."""
    cache = TextCache()
    cache.share_in(folder)
    return cache


def read_together(folder: Path) -> tuple[tuple[TextLine, ...], int]:
    """The lines of a picture, and how often this process called the OCR for them."""
    reader = ScreenReader(sharing(folder))
    return reader.read(renaming(5)), reader.counts.calls


def line(text: str, x: int = 0, y: int = 0, since: int = 0) -> TextLine:
    return TextLine(text=text, box=(x, y, x + 10 * len(text), y + 20), since=since)


def play(agent, lines, *pictures):
    agent.reset()
    agent.follow(lines)
    return [agent.predict("", {"screenshot": image}) for image in pictures]


# Matching


def test_a_text_is_found_although_ocr_loses_spaces_and_confuses_letters():
    lines = [line("Documents-Thunar"), line("report-l0.txt", y=30), line("Saue as...", y=60)]
    for expected, text in (
        ("Documents - Thunar", "Documents-Thunar"),
        ("report-10.txt", "report-l0.txt"),
        ("Save As…", "Saue as..."),
    ):
        calls = find_text(lines, expected)
        assert calls is not None, expected
        assert calls.line.text == text
    assert find_text(lines, "Sent") is None
    assert find_text([line("Font")], "Fon") is None, "short texts are whole words"


def test_the_place_of_a_word_in_a_line_is_its_own():
    text = find_text([line("Bookmarks Help", x=100)], "Help")
    assert text is not None
    assert text.box == (200, 0, 240, 20)


def test_of_several_places_the_best_then_the_newest_then_the_nearest():
    lines = [line("Save file", y=0), line("Save", y=90), line("Save", y=60), line("Cancel", 80, 92)]
    assert find_text(lines, "Save").centre == (20, 70)
    newest = [*lines, line("Save", y=120, since=4)]
    assert find_text(newest, "Save").centre == (20, 130)
    anchors = [find_text(lines, "Cancel")]
    assert find_text(newest, "Save", anchors).centre == (20, 100)
    assert closest_text(lines, "Safe") == "Save"
    assert closest_text([], "Safe") == ""


# Reading what changed


def test_changes_are_found_where_the_menu_opened():
    before = picture("examples/recordings/images/rename-02.png")
    after = picture("examples/recordings/images/rename-03.png")
    assert changed_boxes(after, after) == []
    assert changed_share(after, after) == 0
    assert changed_boxes(before[1:], after) == [(0, 0, 1920, 1080)]
    boxes = changed_boxes(before, after)
    outside = np.ones(after.shape[:2], bool)
    for x1, y1, x2, y2 in boxes:
        outside[y1:y2, x1:x2] = False
    assert outside.mean() > 0.8
    assert (before == after)[outside].all()


def test_boxes_that_touch_become_one():
    boxes = [(0, 0, 10, 10), (50, 50, 60, 60), (8, 8, 30, 30), (29, 0, 51, 51)]
    assert merged(boxes) == [(0, 0, 60, 60)]
    assert merged([(0, 0, 10, 10), (10, 0, 20, 10)]) == [(0, 0, 10, 10), (10, 0, 20, 10)]


def test_only_what_changed_is_read_and_nothing_twice():
    cache = TextCache()
    reader = ScreenReader(cache)
    first = reader.read(renaming(5))
    pixel_count = reader.counts.pixels
    second = reader.read(renaming(6))
    assert "draft.txt" in [item.text for item in first]
    assert "draft.txt" not in [item.text for item in second]
    assert {line.since for line in second} == {0, 1}
    assert reader.counts.pixels < 1.7 * pixel_count
    calls = reader.counts.calls
    assert reader.read(renaming(6).copy()) == second
    again = ScreenReader(cache)
    assert (again.read(renaming(5)), again.read(renaming(6))) == (first, second)
    assert (reader.counts.calls, again.counts.calls, again.counts.kept) == (calls, 0, calls)


def test_no_line_that_stays_is_cut():
    """What changes touches one line, and the box around that touches the next."""
    before = np.full((200, 400, 3), 255, np.uint8)
    after = before.copy()
    after[60:64, 100:104] = 0
    reader = ScreenReader(TextCache(), whole=False)
    reader.read(before)
    reader._lines = (line("first line", 90, 50), line("second", 150, 65), line("apart", 300, 150))
    boxes = reader._boxes(after)
    for standing in reader._lines[:2]:
        x1, y1, x2, y2 = standing.box
        assert any(b[0] <= x1 and b[1] <= y1 and x2 <= b[2] and y2 <= b[3] for b in boxes)
    reader.read(after)
    assert [item.text for item in reader._lines] == ["apart"]


def test_the_cache_forgets_what_was_not_asked_for(monkeypatch):
    read = []
    monkeypatch.setattr(screen_reader, "_read", lambda part: read.append(part[0, 0, 0]) or [])
    counts = screen_reader.ReadingCounts()
    cache = TextCache(2)
    for number in (1, 2, 1, 3, 1, 2):
        cache.read(np.full((4, 4, 3), number, np.uint8), counts)
    assert read == [1, 2, 3, 2]
    assert (counts.calls, counts.kept) == (4, 2)


def test_processes_that_need_the_same_text_read_it_once(tmp_path):
    with ProcessPoolExecutor(3, multiprocessing.get_context("spawn")) as processes:
        items = list(processes.map(read_together, [tmp_path / "texts"] * 3))
    lines = [of_one for of_one, _ in items]
    assert lines[0] == lines[1] == lines[2] == ScreenReader(TextCache()).read(renaming(5))
    assert sorted(calls for _, calls in items) == [0, 0, 1]


def test_a_text_that_was_cut_off_is_read_again(tmp_path):
    expected = ScreenReader(sharing(tmp_path)).read(renaming(5))
    (file,) = tmp_path.iterdir()
    text = file.read_text()
    file.write_text(text[:-20])
    for calls in (1, 0):
        reader = ScreenReader(sharing(tmp_path))
        assert reader.read(renaming(5)) == expected
        assert (reader.counts.calls, reader.counts.kept) == (calls, 1 - calls)
    assert file.read_text() == text


def test_a_folder_that_cannot_be_written_changes_nothing(tmp_path):
    (tmp_path / "file").touch()
    reader = ScreenReader(sharing(tmp_path / "file" / "texts"))
    assert reader.read(renaming(5)) == ScreenReader(TextCache()).read(renaming(5))
    assert reader.counts.calls == 1


# The agents


def test_a_plan_is_followed_on_pictures():
    plan = ['right-click "draft.txt"', 'click "Rename..."', "press ctrl+a", 'type "a\'b"', "wait"]
    result = play(make("pixel"), plan, before_menu(), *[with_menu()] * 5)
    assert [actions[0].split("(")[0] for _, actions in result] == [
        "pyautogui.rightClick",
        "pyautogui.click",
        "pyautogui.hotkey",
        "pyautogui.write",
        "WAIT",
        "DONE",
    ]
    assert result[3][1] == ['pyautogui.write("a\'b")']
    output, (action,) = result[1]
    assert output == "Step 2 of 5: click \"Rename...\". I read 'Rename...'."
    x, y = map(int, action.removeprefix("pyautogui.click(").removesuffix(")").split(","))
    assert abs(x - 339) < 12
    assert abs(y - 260) < 8


def test_a_text_that_does_not_come_is_waited_for_then_the_agent_ends():
    result = play(make("pixel"), ['wait for "Trash"', 'click "Copy"'], *[with_menu()] * 4)
    assert [actions for _, actions in result] == [["WAIT"], ["WAIT"], ["DONE"], ["DONE"]]
    assert "I do not see 'Trash'. The closest text is '" in result[2][0]
    scrolled = play(make("pixel"), ['scroll down to "Trash"'], *[with_menu()] * 2)
    assert scrolled[0][1] == ["pyautogui.scroll(-5, 240, 155)"]


def test_only_the_plan_says_that_a_task_cannot_be_done():
    result = play(make("pixel"), ['click "Copy"', 'give up "no"'], *[with_menu()] * 2)
    assert [actions[0] for _, actions in result][1] == "FAIL"
    agent = make("pixel_onlooker_no_summary")
    answers = play(agent, ['click "Trash"', 'give up "no"'], *[with_menu()] * 3)
    assert answers[-1][1] == ["DONE"]


@pytest.mark.parametrize("name", ["pixel", "pixel_onlooker"])
def test_without_a_plan_there_is_nothing_to_do(name):
    assert play(make(name), [], with_menu())[0][1] == ["DONE"]


def test_the_initial_check_knows_errors_by_their_looks():
    agent = make("pixel_onlooker")
    assert "entering the password" in agent.check(locked())
    assert "network is unavailable" in agent.check(offline())
    assert agent.check(with_menu()) is None


def test_a_locked_screen_is_reported_once_and_unlocked():
    result = play(make("pixel_onlooker"), ['click "Copy"'], locked(), locked(), locked())
    assert result[0][1] == ["REQUEST_REINIT"]
    assert result[0][0].startswith("Reminder: ")
    assert [result[1][1], result[2][1]] == [
        ["pyautogui.write('password')"],
        ["pyautogui.press('enter', presses=1)"],
    ]


def test_each_module_can_be_left_out():
    plan = ["press f2", 'click "Copy"']
    unchecked = play(make("pixel_onlooker_no_check"), plan, locked())
    assert unchecked[0][1] == ["pyautogui.write('password')"], "the summaries notice it, too"
    blind = make("pixel_onlooker_no_summary")
    result = play(blind, plan, with_menu(), locked())
    assert result[1][1] == ["WAIT"]
    assert blind.summaries == []


def test_a_summary_says_what_came_and_went():
    agent = make("pixel_onlooker")
    play(agent, ['right-click "draft.txt"', 'click "Copy"'], before_menu(), with_menu())
    (summary,) = agent.summaries
    assert summary.startswith('Step 1 of 2: right-click "draft.txt".')
    assert "% of the screen changed. New: " in summary
    assert "'Copy'" in summary
    play(agent, ["wait", "wait"], with_menu(), with_menu())
    assert agent.summaries == ["Step 1 of 2: wait. WAIT Nothing has changed."]
    play(agent, ["wait", "wait"], before_menu(), with_menu())
    assert agent.summaries[0].endswith("The agent did nothing to cause it.")


def test_a_minimised_window_is_restored_by_its_button():
    screen = picture("hijack_data/assets/desktop-thunar-1920x1080-1.webp")
    lines = [
        replace(item, box=(item.box[0], item.box[1] + 980, item.box[2], item.box[3] + 980))
        for item in ScreenReader().read(screen[980:])
    ]
    onlooker = PictureOnlooker(())
    item = onlooker.watch(lines, (1080, 1920), ["Thunar"])
    assert item.kind == GONE
    assert item.steps[0] == 'click "Documents -Thunar" near "Applications"'
    titles = [line("~/Documents/harbour-walk.txt - Mousepad"), line("Documents - Thunar", y=300)]
    items = [*lines, *titles]
    assert onlooker.watch(items, (1080, 1920), ["Mousepad", "Thunar"]) is None
    foreign = PictureOnlooker(()).watch(items, (1080, 1920), ["Thunar"])
    assert foreign.kind == COVERED
    assert foreign.steps[0].startswith('right-click "~/Documents/harbour-wa')


SIZE = (1080, 1920)
AT_WORK = line("Documents - Thunar", y=300)


def panel(*windows: str) -> list[TextLine]:
    """The line of the panel, with the buttons of some windows."""
    buttons = [line(window, x=300 + 300 * at, y=1050) for at, window in enumerate(windows)]
    return [line("Applications", x=20, y=1050), *buttons]


def test_of_several_windows_the_one_at_work_is_restored():
    onlooker = PictureOnlooker(())
    windows = ["Thunar", "xarchiver"]
    result = onlooker.watch(panel("Documents - Thunar", "a.zip - xarchiver 0.5"), SIZE, windows)
    assert result.kind == GONE
    assert result.steps[0] == 'click "a.zip - xarchiver 0.5" near "Applications"'


def test_a_window_that_came_during_the_task_is_not_foreign():
    onlooker = PictureOnlooker(())
    first = [AT_WORK, *panel("Documents - Thunar")]
    assert onlooker.watch(first, SIZE, ["Thunar"]) is None
    texts = [AT_WORK, *panel("Documents - Thunar", "a.zip - xarchiver 0.5")]
    assert onlooker.watch(texts, SIZE, ["Thunar"]) is None
    assert PictureOnlooker(()).watch(texts, SIZE, ["Thunar"]).kind == COVERED


def test_a_foreign_window_is_known_again_by_a_button_that_is_cut_short():
    onlooker = PictureOnlooker(())
    first = [AT_WORK, *panel("Documents - Thunar", "untitled - Geany (new instance)")]
    assert onlooker.watch(first, SIZE, ["Thunar"]).kind == COVERED
    later = [AT_WORK, *panel("Documents - Thunar", "a.zip - xarchiver 0.5", "untitled - Gea...")]
    result = onlooker.watch(later, SIZE, ["Thunar"])
    assert result.steps[0] == 'right-click "untitled - Gea..." near "Applications"'


def test_where_the_own_window_cannot_be_read_no_window_is_foreign():
    onlooker = PictureOnlooker(())
    assert onlooker.watch([line("Some text", y=300), *panel("*****")], SIZE, ["Thunar"]) is None
    texts = [AT_WORK, *panel("*****", "Documents - Thunar")]
    assert onlooker.watch(texts, SIZE, ["Thunar"]) is None


# What it is given


class Curious:
    """Looks up its callers."""

    uses_plan = True

    def follow(self, lines):
        self.lines = lines
        self.seen = [frame.filename for frame in inspect.stack()[1:]]

    def predict(self, instruction, obs):
        return "", ["DONE"]


class Contestant:
    def predict(self, instruction, obs):
        return "", ["DONE"]

    def follow(self, lines):
        raise AssertionError("it does not follow plans")


def test_a_follower_gets_words_and_no_way_to_the_episode():
    with AgentThread(Curious) as agent:
        _pass_plan(agent, lambda: ("wait",), [])
        curious = agent.agent
    assert isinstance(curious, PlanFollower)
    assert curious.lines == ("wait",)
    assert not [
        name
        for name in curious.seen
        if "online_env/bench/" in name or "online_env/environment/" in name
    ]
    with AgentThread(Contestant) as agent:
        _pass_plan(agent, lambda: ("wait",), [])


def test_an_agent_that_cannot_read_says_so_before_the_run(monkeypatch, tmp_path):
    monkeypatch.setitem(sys.modules, "rapidocr", None)
    with pytest.raises(MissingDependencyError, match=r"pip install .*\[ocr\]'"):
        prepare(Bench(agents=("pixel",)), ModelOptions(), tmp_path)
    prepare(Bench(agents=("pixel",)), ModelOptions(), None)


TOLD = """
from online_env.agents.pixel.onlooker_agent import PixelOnlooker

class Told(PixelOnlooker):
    def reset(self):
        super().reset()
        self.follow(['window "Sound"', 'click "Mute"'])
"""


def test_it_is_an_agent_like_any_other(tmp_path, monkeypatch):
    # Small pictures: `hijack check` takes large ones, which are read for half a minute.
    monkeypatch.setattr(conformance, "SIZE", (180, 320))
    monkeypatch.setattr(conformance, "SIZES", ((400, 240), (200, 320), (32, 32)))
    (tmp_path / "told.py").write_text(TOLD)
    name = AGENTS.find(f"{tmp_path}/told.py:Told")
    with AgentProcess(AGENTS.get(name), 120) as agent:
        results = list(conformance.run_checks(agent))
    assert [result.problem for result in results if not result.ok] == []
    assert len(results) == len(conformance.CHECKS)
