"""`hijack apply` and `hijack gallery` on folders of pictures."""

import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from PIL import Image

from hijack_data.cli import hijack, main

RUN = CliRunner()
FEW = ("--set", "number=3")


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    for name in ("a.png", "sub/b.png", "sub/b.jpg"):
        path = tmp_path / "shots" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        Image.new("RGB", (320, 200), "navy").save(path)
    return tmp_path / "shots"


def test_every_picture_of_a_folder_is_corrupted_with_a_plan_of_its_own(
    folder: Path, tmp_path: Path
) -> None:
    out = tmp_path / "out"
    result = RUN.invoke(hijack, ["apply", str(folder), "marks", "-o", str(out), *FEW, "--json"])
    assert result.exit_code == 0, result.output
    files = sorted(str(path.relative_to(out)) for path in out.rglob("*.png"))
    assert files == ["a.png", "sub/b.jpg.png", "sub/b.png"]
    rows = json.loads(result.output)["pictures"]
    assert [row["file"] for row in rows] == files
    assert len({row["digest"] for row in rows}) == 3
    value = tmp_path / "one.png"
    RUN.invoke(
        hijack,
        ["apply", str(folder / "a.png"), "marks", "-o", str(value), *FEW, "--sample", "a.png"],
    )
    assert np.array_equal(Image.open(value), Image.open(out / "a.png"))


def test_each_picture_of_a_folder_has_a_file_of_its_own(folder: Path, tmp_path: Path) -> None:
    picture = (folder / "a.png").read_bytes()
    for name in ("a.bmp", "a.bmp.png", "a.gif.bmp", "a.gif.webp"):
        (folder / name).write_bytes(picture)
    out = tmp_path / "out"
    words = ["apply", str(folder), "marks", "-o", str(out), *FEW, "--json"]
    report = json.loads(CliRunner().invoke(hijack, words, catch_exceptions=False).stdout)
    names = [row["file"] for row in report["pictures"]]
    assert sorted(names) == sorted(str(p.relative_to(out)) for p in out.rglob("*.png"))
    assert len(set(names)) == 7


def test_pictures_that_cannot_be_read_are_told(folder: Path, tmp_path: Path) -> None:
    (folder / "bad.png").write_text("x")
    result = RUN.invoke(hijack, ["apply", str(folder), "marks", "-o", str(tmp_path / "out"), *FEW])
    assert result.exit_code == 1
    assert "3 pictures" in result.output
    assert "problem: bad.png: not a" in result.output
    page = tmp_path / "page.html"
    result = RUN.invoke(
        hijack,
        [
            "gallery",
            str(folder),
            "-o",
            str(page),
            "--corruptions",
            "resolution",
            "--detect",
            "none",
        ],
    )
    assert result.exit_code == 1
    assert "page.html: 3 pictures" in result.output
    assert "problem: bad.png" in result.output
    assert page.is_file()


def test_no_page_is_written_of_nothing(tmp_path: Path) -> None:
    (tmp_path / "bad.png").write_text("x")
    page = tmp_path / "page.html"
    result = RUN.invoke(
        hijack, ["gallery", str(tmp_path / "bad.png"), "-o", str(page), "--detect", "none"]
    )
    assert (result.exit_code, page.exists()) == (1, False)
    assert "no picture can be read" in result.output


@pytest.mark.parametrize(
    ("words", "reason"),
    [
        (["apply", "shots", "marks", "-o", "shots/out"], "lies in"),
        (["apply", "shots", "marks", "-o", "out", "--sample", "1"], "--sample is for one picture"),
        (
            ["apply", "shots", "marks", "-o", "out", "--save-plan", "p.json"],
            "--save-plan is for one picture",
        ),
        (["apply", "empty", "marks", "-o", "out"], "empty: holds no picture"),
        (["gallery", "empty", "-o", "page.html"], "empty: holds no picture"),
    ],
)
def test_what_a_folder_is_refused_for(
    words: list[str],
    reason: str,
    folder: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(folder.parent)
    Path("empty").mkdir()
    with pytest.raises(SystemExit) as caught:
        main(words)
    assert caught.value.code == 2
    assert reason in capsys.readouterr().err
    assert not Path("out").exists()
