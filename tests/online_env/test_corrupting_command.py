"""`hijack desktop corrupt` on a desktop that is none: what it prints, saves, and returns."""

import json
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner, Result
from PIL import Image

pytest.importorskip("gymnasium", reason="needs the extra [online]")

from online_env.corrupting.corrupt_command import corrupt
from online_env.corrupting.ledger import LEDGER_FILE

from support.live import SIZE, FakeDesktop


class Windows(FakeDesktop):
    """Its two windows can be minimised, as our guest server does it; it can be attached to."""

    id = "d1"

    def __init__(self) -> None:
        super().__init__()
        self.hidden: list[int] = []
        self.is_stubborn = False

    def tool(
        self, name: str, operation: str, fields: dict[str, Any], timeout: float
    ) -> dict[str, Any]:
        if operation == "minimise":
            self.hidden = [] if self.is_stubborn else [1, 2]
            return {"managed": True, "by": "each", "hidden": [1, 2], "active": 2}
        if operation == "restore":
            back = fields["ids"] or self.hidden
            self.hidden = []
            return {"restored": back, "left": back[:1] if self.is_stubborn else []}
        matches = [number for number in (1, 2) if number not in self.hidden]
        windows = [{"title": f"w{n}", "mapped": True, "type": "normal"} for n in matches]
        return {"desktop_shown": False, "windows": windows}

    def __enter__(self) -> "Windows":
        return self

    def __exit__(self, *_: object) -> None:
        """Stay."""


@pytest.fixture
def desktop(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Windows:
    windows = Windows()
    (tmp_path / "d1").mkdir()
    monkeypatch.setattr("online_env.embedded.running.attach", lambda name: windows)
    monkeypatch.setattr("online_env.embedded.runtime.registry.folder", lambda name: tmp_path / name)
    monkeypatch.chdir(tmp_path)
    return windows


def run(*words: str) -> Result:
    return CliRunner().invoke(corrupt, words)


def size_of(picture: Path) -> tuple[int, int]:
    """Return the height and the width of a picture."""
    with Image.open(picture) as image:
        return image.height, image.width


def test_a_corruption_is_applied_told_refused_twice_and_taken_back(desktop: Windows) -> None:
    result = run("app_minimization")
    assert result.output.splitlines() == [
        "app_minimization on d1: no window is on the screen, 2 went to the panel",
        "  take it back with: hijack desktop corrupt --undo app_minimization --on d1",
    ]
    assert (result.exit_code, desktop.hidden) == (0, [1, 2])
    again = run("app_minimization")
    assert again.exit_code == 1
    assert "app_minimization is on d1 already" in str(again.exception)
    undone = run("--undo")
    assert undone.output == "app_minimization on d1: 2 windows are back\n"
    assert (undone.exit_code, desktop.hidden) == (0, [])


def test_a_probe_that_is_false_is_the_exit_code(desktop: Windows) -> None:
    desktop.is_stubborn = True
    result = run("app_minimization")
    assert result.exit_code == 1
    assert result.output.splitlines()[0] == (
        "app_minimization on d1: the probe is FALSE: still on the screen: 'w1', 'w2'"
    )
    undone = run("--undo", "app_minimization")
    assert undone.exit_code == 1
    assert undone.output == "app_minimization on d1: NOT undone: 1 windows stay minimised\n"
    desktop.is_stubborn = False
    assert run("--undo").exit_code == 0  # it was kept for another try


def test_what_was_done_is_one_json_object(desktop: Windows, tmp_path: Path) -> None:
    data = json.loads(run("app_minimization", "--json", "--seed", "4").output)
    (effect,) = data.pop("effects")
    digest = data.pop("digest")
    assert data == {
        "corruption": "app_minimization",
        "desktop": "d1",
        "ok": True,
        "saw": "no window is on the screen, 2 went to the panel",
        "notes": [],
        "picture": None,
    }
    assert effect["did"] == {"by": "each", "hidden": [1, 2], "active": 2}
    assert len(digest) >= 16
    (entry,) = json.loads((tmp_path / "d1" / LEDGER_FILE).read_text())
    assert entry["records"][0]["did"] == effect["did"]
    undone = json.loads(run("--undo", "--json").output)
    assert undone == {
        "desktop": "d1",
        "ok": True,
        "recorded": True,
        "undone": [
            {
                "corruption": "app_minimization",
                "effect": "minimise",
                "ok": True,
                "facts": {"restored": 2},
                "problem": "",
            }
        ],
    }


def test_what_an_agent_sees_is_saved(desktop: Windows, tmp_path: Path) -> None:
    result = run("subtitle", "--set", "font_size=12")
    assert (result.exit_code, "take it back" in result.output) == (0, False)
    assert "  what an agent sees: subtitle.png" in result.output
    assert size_of(tmp_path / "subtitle.png") == SIZE
    result = run("app_minimization", "--out", "mine.png")
    assert "  what an agent sees: mine.png" in result.output
    assert size_of(tmp_path / "mine.png") == SIZE
    assert not (tmp_path / "app_minimization.png").exists()


def test_without_a_record_it_goes_by_what_the_machine_shows(
    desktop: Windows, tmp_path: Path
) -> None:
    nothing = run("--undo")
    assert (nothing.exit_code, nothing.output) == (1, "")
    assert str(nothing.exception) == (
        "nothing was applied to d1 by hand; name a corruption to clear up all the same"
    )
    run("app_minimization")
    (tmp_path / "d1" / LEDGER_FILE).unlink()
    undone = run("--undo", "app_minimization")
    assert undone.output.splitlines() == [
        "no record of app_minimization on d1: going by what the machine shows",
        "app_minimization on d1: 2 windows are back",
    ]
    assert desktop.hidden == []
    picture = run("--undo", "resolution")
    assert "resolution changes only what an agent sees, not the machine" in str(picture.exception)


def test_a_name_or_undo_must_be_given(desktop: Windows) -> None:
    result = run()
    assert result.exit_code == 2
    assert "give the NAME of a corruption (hijack list), or --undo" in result.output
    result = run("subtitel")
    assert "did you mean 'subtitle'" in str(result.exception)
    assert run("subtitle", "--set", "size=12").exit_code != 0
