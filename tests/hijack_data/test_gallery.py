"""The gallery page: what it holds, that nothing in it can run or call out, and that it works in a
real browser."""

import ast
import base64
import html
import io
import itertools
import json
import os
import re
import shlex
import shutil
from collections.abc import Mapping
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

import hijack_data as hj
from hijack_data.cli import main
from hijack_data.cli.picture_plans import parse_settings
from hijack_data.corruption import find_corruption
from hijack_data.errors import ParameterError, ParameterTypeError
from hijack_data.gallery import gallery, sample_id
from hijack_data.gallery.reproduce import cli_call, python_call, schedule
from hijack_data.gallery.tiles import _start, painted
from hijack_data.picture_io import load_image

HOSTILE = "<img src=x onerror=alert(1)>.png"
LIVE = ("multi_apps", "accidental_touch", "app_minimization", "network_error", "verification")
OFFLINE = ("pop_ups", "resolution", "marks", "subtitle")
SHRINK = hj.Subtitle(fit="shrink")


def screen(height: int = 400, width: int = 640, tint: int = 0) -> np.ndarray:
    """A plain desktop with a bar, a window and some buttons."""
    image = np.full((height, width, 3), (230 - tint, 232, 236), np.uint8)
    image[:24] = 40
    image[60 : height - 60, 80 : width - 200] = 255
    for x in range(100, width - 240, 90):
        image[80:104, x : x + 70] = (60, 110, 200)
    return image


def save(path: Path, image: np.ndarray) -> Path:
    Image.fromarray(image).save(path)
    return path


@pytest.fixture(scope="module")
def shots(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    folder = tmp_path_factory.mktemp("shots")
    return [save(folder / "first.png", screen()), save(folder / HOSTILE, screen(tint=90))]


@pytest.fixture(scope="module")
def screens(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """Pictures as large as a real screen, on which recorded pictures fit."""
    folder = tmp_path_factory.mktemp("screens")
    return [
        save(folder / "first.png", screen(768, 1024)),
        save(folder / HOSTILE, screen(768, 1024, tint=90)),
    ]


class Reader(HTMLParser):
    """Collects the elements of a page, and the text of its scripts, styles, `pre` and `dl` rows."""

    def __init__(self, page: str) -> None:
        super().__init__(convert_charrefs=True)
        self.elements: list[tuple[str, dict[str, str | None]]] = []
        self.texts: dict[str, list[str]] = {}
        self._open: list[str] = []
        self.feed(page)
        self.close()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, dict(attrs)))
        if tag in ("script", "style", "pre", "h2", "h3", "dd", "p"):
            self._open.append(tag)
            self.texts.setdefault(tag, []).append("")

    def handle_endtag(self, tag: str) -> None:
        if self._open and self._open[-1] == tag:
            self._open.pop()

    def handle_data(self, data: str) -> None:
        for tag in self._open:
            self.texts[tag][-1] += data

    def all(self, tag: str, name: str | None = None) -> list[dict[str, str | None]]:
        elements = [attrs for t, attrs in self.elements if t == tag]
        return (
            elements
            if name is None
            else [a for a in elements if name in (a.get("class") or "").split()]
        )

    @property
    def plans(self) -> list[hj.Plan]:
        return [
            hj.Plan.from_json(text) for text in self.texts["pre"] if '"agenthijack-plan"' in text
        ]


def picture_of(uri: str) -> np.ndarray:
    return np.array(Image.open(io.BytesIO(base64.b64decode(uri.partition(",")[2]))).convert("RGB"))


def test_every_corruption_is_a_tile_with_a_picture(screens: list[Path]) -> None:
    """Those that act on the machine are composites, and the tile says so."""
    planners = {name: hj.make_corruption(name) for name in (*OFFLINE, *LIVE)} | {"subtitle": SHRINK}
    page = gallery(screens, seed=7, planners=planners, detect="picture")
    read = Reader(page.html)
    assert page.problems == ()
    assert read.texts["h3"] == [*OFFLINE, *LIVE] * len(screens)
    assert len(read.all("img")) == len(read.texts["h3"])
    effects = ["launch_app", "touch", "minimise", "firewall", "lock"]
    assert re.findall(r"<dt>Effect on the machine</dt><dd>(\w+)</dd>", page.html) == effects * len(
        screens
    )
    assert re.findall(r"<dt>Fidelity</dt><dd>(\w+)</dd>", page.html) == ["foreign"] * len(
        effects
    ) * len(screens)
    assert page.html.count("<dd>before the episode</dd>") == 2 * len(screens)
    acting = [plan for plan in read.plans if plan.effects]
    assert [plan.effects[0].kind for plan in acting] == effects * len(screens)
    picture = load_image(screens[0])[0]
    for plan in acting[: len(effects)]:
        assert not np.array_equal(hj.apply(plan, picture), picture), plan.corruption


@pytest.mark.parametrize(
    ("boxes", "start"),
    [
        ([], 50),
        ([[500, 0, 600, 9]], 48),
        ([[700, 0, 800, 9], [300, 5, 900, 9]], 28),
        ([[0, 0, 1000, 9]], 0),
        ([[10, 0, 90, 9]], 0),
        ([[990, 0, 1000, 9]], 90),
    ],
)
def test_the_divider_begins_left_of_what_was_painted(boxes: list[list[int]], start: int) -> None:
    assert _start(boxes, 1000) == start


def test_what_cannot_be_shown_is_a_problem_that_says_why(tmp_path: Path) -> None:
    tiny = save(tmp_path / "tiny.png", screen(100, 120))
    page = gallery([tiny], planners={"lock": hj.Verification()}, detect="none")
    assert len(page.problems) == 1
    assert "--only lock_screen --sizes 120x100" in page.problems[0]
    assert "lock" in Reader(page.html).texts["h3"]


def test_a_plan_that_paints_and_acts_is_a_tile(screens: list[Path]) -> None:
    sequence = hj.Sequence([hj.Marks(number=3), hj.Verification()])
    page = gallery(screens[:1], planners={"both": sequence}, detect="none")
    read = Reader(page.html)
    assert len(read.all("img")) == 1
    assert [effect.kind for effect in read.plans[0].effects] == ["lock"]


def test_default_planners_are_all_registered_corruptions(shots: list[Path]) -> None:
    page = gallery(shots[:1], detect="picture")
    buttons = re.findall(r'data-filter="\d+"[^>]*>([^<]+)<', page.html)
    assert buttons == hj.corruption_names()
    problems = [problem for problem in page.problems if "--sizes 640x400" not in problem]
    assert len(problems) == 1
    assert problems[0].startswith("first.png: subtitle: ")
    assert "set fit=&#x27;shrink&#x27;" in page.html


def test_the_pictures_on_the_page_are_the_pictures_that_apply_gives(shots: list[Path]) -> None:
    planners = {"marks": hj.Marks(number=9), "small": hj.Resolution(scale=0.5)}
    page = gallery(shots[:1], seed=5, planners=planners, detect="none")
    image, _ = load_image(shots[0])
    scene = hj.Scene(image.shape[:2])
    tiles = [picture_of(attrs["src"] or "") for attrs in Reader(page.html).all("img", "after")]
    for value, planner in zip(tiles, planners.values(), strict=True):
        plan = planner.plan(scene, seed=5, sample="first.png")
        np.testing.assert_array_equal(value, hj.apply(plan, image))
    (uri,) = re.findall(r"\.p0 \.before\{background-image:url\((data:[^)]*)\)\}", page.html)
    np.testing.assert_array_equal(picture_of(uri), image)


def test_plan_figures_and_calls_on_a_tile_are_true(tmp_path: Path) -> None:
    path = save(tmp_path / "it's a $screen.png", screen())
    marks = hj.Marks(number=60, color="#00ff00", mark_type="circle")
    page = gallery([path], seed=11, planners={"m": marks}, detect="picture")
    image, _ = load_image(path)
    scene = hj.scene_from(image)
    assert len(scene.boxes) > 2
    plan = marks.plan(scene, seed=11, sample=path.name)
    read = Reader(page.html)
    assert read.plans == [plan]
    assert plan.digest() in page.html
    safety = hj.judge(plan, image, hj.apply(plan, image), boxes=scene.boxes)
    share = f"{100 * safety.changed_pixels / (400 * 640):.1f} %"
    assert read.texts["dd"][:3] == [
        f"{len(safety.covered)} of {len(scene.boxes)}",
        f"{safety.changed_pixels:,}",
        share,
    ]
    assert "60" in read.texts["dd"][3:]
    calls = [text for text in read.texts["pre"] if text.startswith(("hj.", "hijack "))]
    assert [remade(text, scene) for text in calls] == [plan, plan]
    data = json.loads(read.texts["script"][1])
    assert data["tiles"][0] == {
        "picture": 0,
        "covered": list(safety.covered),
        "painted": painted(plan),
    }
    assert data["pictures"] == [{"size": [640, 400], "boxes": scene.boxes.tolist()}]


def remade(call: str, scene: hj.Scene) -> hj.Plan:
    """Carry out a call as the page shows it, without running it as code."""
    if call.startswith("hijack "):
        words = shlex.split(call)
        pairs = [word.partition("=") for flag, word in itertools.pairwise(words) if flag == "--set"]
        seed, sample = int(words[words.index("--seed") + 1]), words[words.index("--seed") + 2]
        maker = hj.make_corruption(
            words[3], **parse_settings(find_corruption(words[3]), tuple(map("".join, pairs)))
        )
        return maker.plan(scene, seed=seed, sample=sample.removeprefix("--sample="))
    tree = ast.parse(call, mode="eval").body
    assert isinstance(tree, ast.Call)
    assert isinstance(tree.func, ast.Attribute)
    values = {k.arg: ast.literal_eval(k.value) for k in tree.keywords}
    return evaluate(tree.func.value).plan(scene, **values)


def evaluate(node: ast.expr) -> Any:
    assert isinstance(node, ast.Call)
    if ast.unparse(node.func) == "hj.Sequence":
        assert isinstance(node.args[0], ast.List)
        return hj.Sequence([evaluate(part) for part in node.args[0].elts])
    assert ast.unparse(node.func) == "hj.make_corruption"
    return hj.make_corruption(
        ast.literal_eval(node.args[0]),
        **{k.arg or "": ast.literal_eval(k.value) for k in node.keywords},
    )


@pytest.mark.parametrize(
    "planner",
    [
        hj.Marks(number=4, color="gold", avoid_elements=True),
        hj.Subtitle(subtitle_text="two\nlines: \"a\" \\ 'b'", font_size=12),
        hj.Subtitle(subtitle_text="12", font_size=12),
        hj.PopUps(button_string="true", small_factor=2),
        hj.AppMinimization(step=hj.plugin.Every(4)),
        hj.AccidentalTouch(step=(2, 5), without_app=False),
        hj.OneOf([hj.Marks(number=3), hj.Resolution()]),
        hj.Sequence([hj.Marks(number=3), hj.Resolution(scale=0.3)]),
    ],
    ids=lambda p: type(p).__name__,
)
def test_calls_make_the_same_plan(planner: Any) -> None:
    scene = hj.Scene((400, 640), [[10, 10, 60, 40]])
    for sample in ("a b.png", "-x'\".png", "\u202eé.png"):
        plan = planner.plan(scene, seed=2**63, sample=sample)
        call = python_call(plan, scene, 2**63, sample)
        assert call is not None
        assert "\n" not in call
        assert remade(call, scene) == plan
        command = cli_call(plan, 2**63, sample)
        assert (command is None) == ("+" in plan.corruption)
        if command is not None:
            assert not shlex.split(command)[2].startswith("-")
            assert "\n" not in command
            assert remade(command, scene) == plan


def test_the_command_on_a_tile_gives_the_picture_on_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    path = save(tmp_path / "-it's $a screen.png", screen())
    text = hj.Subtitle(subtitle_text="two\nlines; $HOME", font_size=14)
    planners = {
        "marks": hj.Marks(number=9, avoid_elements=True),
        "pop": hj.PopUps(small_factor=3),
        "text": text,
    }
    read = Reader(gallery([path], seed=4, planners=planners).html)
    commands = [text for text in read.texts["pre"] if text.startswith("hijack ")]
    monkeypatch.chdir(tmp_path)
    for command, plan, value in zip(commands, read.plans, read.all("img"), strict=True):
        assert plan.ops
        with pytest.raises(SystemExit) as end:
            main(shlex.split(command)[1:])
        assert end.value.code == 0
        assert plan.digest()[:12] in capsys.readouterr().out
        np.testing.assert_array_equal(load_image("out.png")[0], picture_of(value["src"] or ""))


def test_a_command_is_left_out_where_it_would_give_another_plan() -> None:
    scene = hj.Scene((400, 640))
    marks = hj.Marks(number=3, avoid_elements=True).plan(scene, seed=1)
    assert cli_call(marks, 1, "x.png", detected=False) is None
    assert cli_call(marks, 1, "x.png") is not None
    slash = hj.Subtitle(subtitle_text="C:\\new", font_size=9).plan(scene, seed=1)
    assert cli_call(slash, 1, "x.png") is None


def test_a_plan_that_no_call_makes_has_no_call() -> None:
    scene = hj.Scene((400, 640))
    foreign = hj.Plan("mine-v1", (400, 640))
    assert python_call(foreign, scene, 1, "x") is None
    assert cli_call(foreign, 1, "x") is None


@pytest.mark.parametrize(
    ("step", "text"),
    [
        (-1, "before the episode"),
        (3, "at step 3"),
        ((1, 4), "at steps 1, 4"),
        (hj.plugin.Every(5), "every 5 steps"),
    ],
)
def test_schedule(step: Any, text: str) -> None:
    planner = hj.Verification(step=step)
    assert schedule(planner) == text
    assert schedule(hj.Marks()) == "at every step"


def test_painted_follows_a_resize_and_is_empty_for_one_alone() -> None:
    scene = hj.Scene((400, 640))
    assert painted(hj.Resolution().plan(scene, seed=0)) == []
    first = hj.Resolution(scale=0.5).plan(scene, seed=0)
    combined = first.then(
        hj.Plan("x-v1", (200, 320), ops=(hj.plugin.Paste(SPRITE, ((100, 50), (-4, 0))),))
    )
    assert painted(combined) == [[200, 100, 216, 116], [0, 0, 8, 16]]


SPRITE = {"draw": "mark", "shape": "rectangle", "size": 4, "color": "red"}


def test_same_input_same_bytes_wherever_the_files_lie(shots: list[Path], tmp_path: Path) -> None:
    planners: Mapping[str, Any] = {"marks": hj.Marks(), "gone": hj.Subtitle(font_size=500)}
    copies = [Path(shutil.copy(path, tmp_path)) for path in shots]
    result = gallery(
        [*shots, shots[0].parent / "none.png"], seed=3, planners=planners, detect="none"
    )
    two = gallery(
        [*map(str, copies), str(tmp_path / "none.png")], seed=3, planners=planners, detect="none"
    )
    assert result == two
    assert str(tmp_path) not in two.html
    assert result.html != gallery(shots, seed=4, planners=planners, detect="none").html


def test_hostile_text_stays_text(shots: list[Path]) -> None:
    evil = "</script><script>alert(1)</script><!--"
    planners = {
        evil: hj.Subtitle(subtitle_text=evil, font_size=10),
        '" onclick="alert(2)': hj.Subtitle(subtitle_text=evil * 9, font_size=40),
    }
    page = gallery(shots, planners=planners, detect="none")
    read = Reader(page.html)
    assert len(read.all("script")) == 2
    assert len(read.all("img")) == 2
    assert {k for _, attrs in read.elements for k in attrs if k.startswith("on")} == set()
    assert HOSTILE in read.texts["h2"]
    assert evil in read.texts["h3"]
    assert len(page.problems) == 2
    assert read.plans[0].params["subtitle_text"] == evil
    assert f"{HOSTILE}, before" in [attrs.get("aria-label") for attrs in read.all("div", "before")]


def test_file_names_that_are_not_utf_8_do_not_break_the_page(tmp_path: Path) -> None:
    path = Path(os.fsdecode(os.fsencode(tmp_path) + b"/caf\xe9.png"))
    try:
        save(path, screen(40, 60))
    except OSError:
        pytest.skip("this file system takes UTF-8 names only")
    page = gallery([path], planners={"marks": hj.Marks(number=1, mark_size=4)}, detect="none")
    assert sample_id(path) == "caf?.png"
    assert "caf?.png" in page.html.encode("utf-8").decode("utf-8")


def test_nothing_on_the_page_points_outside(shots: list[Path]) -> None:
    page = gallery(shots, planners={"subtitle": SHRINK}, detect="none").html
    read = Reader(page)
    links = [
        value or ""
        for _, attrs in read.elements
        for key, value in attrs.items()
        if key in ("src", "href")
    ]
    assert links
    assert all(link.startswith("data:") for link in links)
    assert all(url.lstrip("\"'").startswith("data:") for url in re.findall(r"url\(([^)]*)\)", page))
    outside = set(re.findall(r"https?://[^\s\"'<>]+", page))
    assert outside == {"http://www.w3.org/2000/svg"}  # a namespace, not an address that is fetched
    (policy,) = [
        a["content"] or ""
        for a in read.all("meta")
        if a.get("http-equiv") == "Content-Security-Policy"
    ]
    assert policy.startswith("default-src 'none'; img-src data:;")
    assert "unsafe" not in policy


def test_broken_pictures_and_corruptions_are_listed_and_the_rest_is_shown(
    shots: list[Path], tmp_path: Path
) -> None:
    empty, missing = tmp_path / "empty.png", tmp_path / "missing.png"
    empty.touch()
    tiny = save(tmp_path / "tiny.png", screen(200, 300)[:30, :40])
    planners: Mapping[str, Any] = {
        "subtitle": hj.Subtitle(),
        "marks": hj.Marks(number=1, mark_size=3),
        "none": hj.Marks(number=0),
        "clean": hj.OneOf([hj.Marks()], p_clean=1.0),
    }
    page = gallery([empty, shots[0], missing, tiny], planners=planners, detect="none")
    assert len(page.problems) == 6
    assert page.problems[0] == "empty.png: the file is empty (0 bytes)"
    assert page.problems[1].startswith(
        "first.png: subtitle: subtitle.subtitle_text does not fit 640x400"
    )
    assert page.problems[2] == "first.png: none: the plan changes nothing"
    assert page.problems[3].startswith("missing.png: cannot be read")
    read = Reader(page.html)
    assert len(read.all("img")) == 2
    assert len(read.all("article", "message")) == 8
    assert page.html.count("left clean") == 2
    for problem in page.problems:
        assert f"<li>{html.escape(problem)}</li>" in page.html


@pytest.mark.parametrize(
    ("error", "images", "options"),
    [
        (ParameterError, [], {}),
        (ParameterTypeError, "a.png", {}),
        (ParameterTypeError, Path("a.png"), {}),
        (ParameterTypeError, [np.zeros((4, 4, 3), np.uint8)], {}),
        (ParameterTypeError, ["a.png"], {"seed": "7"}),
        (ParameterError, ["a.png"], {"seed": -1}),
        (ParameterTypeError, ["a.png"], {"planners": {}}),
        (ParameterTypeError, ["a.png"], {"planners": [hj.Marks()]}),
        (ParameterTypeError, ["a.png"], {"planners": {"m": hj.Marks}}),
        (ParameterError, ["a.png"], {"embed_width": 4}),
        (ParameterTypeError, ["a.png"], {"embed_width": 12.5}),
    ],
)
def test_wrong_arguments_are_refused(
    error: type[Exception], images: Any, options: dict[str, Any]
) -> None:
    with pytest.raises(error):
        gallery(images, **options)


def test_an_unknown_detector_is_refused(shots: list[Path]) -> None:
    with pytest.raises(hj.HijackError, match="pictures"):
        gallery(shots, detect="pictures")  # type: ignore[arg-type]


def test_wide_pictures_are_scaled_down_together_and_say_so(tmp_path: Path) -> None:
    path = save(tmp_path / "wide.png", screen(500, 1000))
    planners: Mapping[str, Any] = {"marks": hj.Marks(number=2), "small": hj.Resolution(scale=0.5)}
    page = gallery([path], planners=planners, detect="none", embed_width=660)
    shapes = [picture_of(attrs["src"] or "").shape for attrs in Reader(page.html).all("img")]
    assert shapes == [(330, 660, 3), (165, 330, 3)]
    assert "1000x500, shown at 66 %" in page.html
    assert "1000x500 to 500x250, shown at 66 %" in page.html
    assert (
        "shown at" not in gallery([path], planners=planners, detect="none", embed_width=1000).html
    )
