"""The command line: what it prints, what it writes, and its exit codes. Run as users run it, in its
own process, but for long lists of one kind of mistake."""

import hashlib
import io
import json
import platform
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import hijack_data as hj
from hijack_data import cli
from hijack_data.cli import main
from hijack_data.file_io import write_atomic
from hijack_data.picture_io import encode_png, load_image

from support import lean

ROOT = Path(__file__).resolve().parents[2]
SIZE = (540, 1100)


def run(*words, cwd=None, command=(sys.executable, "-m", "hijack_data.cli")):
    return subprocess.run(
        [*command, *map(str, words)], capture_output=True, text=True, cwd=cwd, timeout=120
    )


def inside(capsys, *words):
    """What `run` gives, without a process of its own."""
    with pytest.raises(SystemExit) as ended:
        main([*map(str, words)])
    output = capsys.readouterr()
    return subprocess.CompletedProcess(words, ended.value.code, output.out, output.err)


@pytest.fixture
def screen(tmp_path):
    path = tmp_path / "screen.png"
    y, x = np.mgrid[: SIZE[0], : SIZE[1]]
    write_atomic(path, encode_png(np.stack([x % 256, y % 256, (x + y) % 256], -1).astype(np.uint8)))
    return path


def refused(done, *parts):
    assert done.returncode == 2, (done.returncode, done.stdout, done.stderr)
    assert "Traceback" not in done.stderr
    for part in parts:
        assert part in done.stderr, done.stderr


def test_help_and_version():
    result = run("--help")
    assert result.returncode == 0
    for name in ("list", "show", "apply", "gallery", "check", "doctor", "build"):
        assert name in result.stdout
        assert run(name, "--help").returncode == 0
    output = run("--version").stdout
    assert output == run("-V").stdout
    assert output.startswith("hijack 0.1.0\n")
    assert f"CPython {platform.python_version()}, {platform.system()}" in output
    assert (
        f"numpy {np.__version__}" in output
    )  # for bug reports, which must not tell who sends them
    assert str(Path.home()) not in output


def test_list_and_show():
    rows = json.loads(run("list", "--json").stdout)
    assert [r["name"] for r in rows] == [*hj.corruption_names(), *hj.corruption_names("everyday")]
    text = run("show", "pop_ups").stdout
    assert "small_factor" in text
    assert "Algorithm 1" in text
    refused(run("show", "pop_up"), "did you mean 'pop_ups'")


def test_the_package_is_the_command():
    command = [sys.executable, "-m", "hijack_data", "show", "marks"]
    process = subprocess.run(command, capture_output=True, text=True, timeout=120)
    assert (process.returncode, process.stdout) == (0, run("show", "marks").stdout)


@pytest.mark.parametrize("name", hj.corruption_names())
def test_show_prints_every_bracket(name, capsys):
    """The terminal's markup has brackets of its own, and drops those that it takes for it."""
    data = inside(capsys, "show", name, "--json").stdout
    text = inside(capsys, "show", name).stdout
    parameters = json.loads(data)["parameters"]
    words = {word for row in parameters for word in f"{row['accepts']} {row['doc']}".split()}
    assert {word for word in words if set("[]") & set(word)} <= set(text.split())


def test_apply_prints_one_object(screen, tmp_path):
    out = tmp_path / "o.png"
    result = run(
        "apply",
        screen,
        "marks",
        "-o",
        out,
        "--seed",
        7,
        "--set",
        "number=9",
        "--set",
        "color=#00ff00",
        "--json",
    )
    assert result.returncode == 0, result.stderr
    row = json.loads(result.stdout)
    assert list(row) == ["corruption", "digest", "sha256", "size", "notes"]
    pixels = load_image(out)[0]
    assert row["sha256"] == hashlib.sha256(pixels.tobytes()).hexdigest()
    assert row["size"] == [1100, 540]
    plan = hj.Marks(number=9, color="#00ff00").plan(hj.Scene(size=SIZE), seed=7, sample="0")
    assert row["digest"] == plan.digest()
    assert np.array_equal(pixels, hj.apply(plan, load_image(screen)[0]))


def test_a_saved_plan_is_replayed(screen, tmp_path, capsys):
    value, two, plan = (tmp_path / name for name in ("1.png", "2.png", "p.json"))
    assert (
        run("apply", screen, "pop_ups", "-o", value, "--seed", 3, "--save-plan", plan).returncode
        == 0
    )
    assert run("apply", screen, "-o", two, "--plan", plan).returncode == 0
    assert value.read_bytes() == two.read_bytes()
    refused(
        run("apply", screen, "marks", "-o", two, "--plan", plan),
        "a plan of pop_ups-v2, not of marks",
    )
    for words in (["--set", "width=3"], ["--severity", 2], ["--seed", 3], ["--step", 0]):
        result = inside(capsys, "apply", screen, "-o", two, "--plan", plan, *words)
        refused(result, f"leave out {words[0]}")
    Image.new("RGB", (50, 40)).save(tmp_path / "small.png")
    refused(
        run("apply", tmp_path / "small.png", "-o", two, "--plan", plan),
        "made for 1100x540 but the picture is 50x40",
    )
    plan.write_text(plan.read_text().replace("960", "961", 1))
    refused(run("apply", screen, "-o", tmp_path / "3.png", "--plan", plan), "was edited")
    plan.write_text("{}")
    refused(
        run("apply", screen, "-o", tmp_path / "3.png", "--plan", plan), "not an AgentHijack plan"
    )
    assert not (tmp_path / "3.png").exists()


def test_the_tree_is_used(screen, tmp_path):
    ns = "https://accessibility.ubuntu.example.org/ns"
    tree = tmp_path / "tree.xml"
    tree.write_text(
        f'<desktop-frame xmlns:st="{ns}/state" xmlns:cp="{ns}/component"><push-button name="a"'
        ' st:showing="true" st:visible="true" st:enabled="true" cp:screencoord="(0, 0)"'
        ' cp:size="(1100, 300)"/></desktop-frame>'
    )
    plan = tmp_path / "p.json"
    result = run(
        "apply", screen, "pop_ups", "-o", tmp_path / "o.png", "--tree", tree, "--save-plan", plan
    )
    assert result.returncode == 0, result.stderr
    ((_, y),) = hj.Plan.from_json(plan.read_text()).ops[0].at
    assert y >= 300
    tree.write_text("<broken")
    refused(run("apply", screen, "pop_ups", "-o", tmp_path / "x.png", "--tree", tree), "tree")


@pytest.mark.parametrize(
    ("words", "parts"),
    [
        (["marsk"], ["unknown corruption 'marsk'; did you mean 'marks'"]),
        (["marks", "--set", "nmber=3"], ["no parameter 'nmber'; did you mean 'number'"]),
        (["marks", "--set", "number=many"], ["marks.number must be an integer, got 'many'"]),
        (["marks", "--set", "number=-3"], ["marks.number must be int in [0, 100000], got -3"]),
        (["marks", "--set", "number=010"], ["got '010' (str); write 10 (octal is not read)"]),
        (["marks", "--set", "number=1:30"], ["numbers to the base of 60 are not read"]),
        (["marks", "--set", "number=["], ["--set number=[", "not valid YAML"]),
        (["marks", "--set", "avoid_elements=no"], ["got 'no' (str); write false"]),
        (["marks", "--set", "number"], ["must be key=value"]),
        (["marks", "--set", "number=5", "--set", "number=6"], ["--set number is given twice"]),
        (["marks", "--set", "number=5", "--set", "number=5"], ["--set number is given twice"]),
        (["marks", "--set", "color=#ff000080"], ["has transparency", "#ff0000"]),
        (["subtitle", "--set", f"font_path={'x' * 300}"], ["subtitle.font_path", "is not a file"]),
        (["subtitle", "--set", "font_path=~nobody-of-this-name/x.ttf"], ["subtitle.font_path"]),
        (["marks", "--seed", "-1"], ["seed must be in"]),
        (["marks", "--severity", "9"], ["severity must be in 1..5"]),
        (["subtitle", "--set", "subtitle_text=你好"], ["no glyph for", "U+4F60"]),
        (
            ["subtitle", "--set", "font_size=400"],
            ["does not fit 1100x540", "largest font_size that fits"],
        ),
        ([], ["give the NAME"]),
    ],
)
def test_bad_words(screen, tmp_path, words, parts, capsys):
    out = tmp_path / "o.png"
    refused(inside(capsys, "apply", screen, *words, "-o", out), *parts)
    assert not out.exists()
    assert not list(tmp_path.glob(".*"))


def test_bad_files(screen, tmp_path, capsys):
    out = tmp_path / "o.png"
    (tmp_path / "empty.png").write_bytes(b"")
    (tmp_path / "cut.png").write_bytes(screen.read_bytes()[:999])
    refused(
        inside(capsys, "apply", tmp_path / "empty.png", "marks", "-o", out), "empty.png", "0 bytes"
    )
    refused(inside(capsys, "apply", tmp_path / "cut.png", "marks", "-o", out), "cut.png", "cut off")
    refused(inside(capsys, "apply", tmp_path / "none.png", "marks", "-o", out), "none.png")
    refused(inside(capsys, "apply", screen, "marks", "-o", tmp_path / "o.jpg"), "only .png")
    refused(
        inside(capsys, "apply", screen, "marks", "-o", tmp_path / "no" / "o.png"),
        "cannot be written",
    )
    assert not out.exists()


def test_other_colour_modes_are_converted_and_said(tmp_path):
    Image.new("RGBA", (300, 200), (9, 9, 9, 128)).save(tmp_path / "a.png")
    result = run("apply", tmp_path / "a.png", "marks", "-o", tmp_path / "o.png")
    assert result.returncode == 0
    assert "RGBA was converted to RGB" in result.stdout


def test_one_pixel_and_a_hundred_million(tmp_path):
    Image.new("RGB", (1, 1)).save(tmp_path / "one.png")
    assert run("apply", tmp_path / "one.png", "marks", "-o", tmp_path / "o.png").returncode == 0
    refused(
        run("apply", tmp_path / "one.png", "subtitle", "-o", tmp_path / "s.png"), "does not fit 1x1"
    )
    Image.new("L", (10000, 10000)).save(tmp_path / "large.png")
    result = run("apply", tmp_path / "large.png", "subtitle", "-o", tmp_path / "l.png", "--json")
    assert result.returncode == 0, result.stderr
    assert json.loads(result.stdout)["size"] == [10000, 10000]


def test_state_corruptions_are_shown_by_recorded_pictures(screen, tmp_path):
    result = run(
        "apply",
        screen,
        "verification",
        "-o",
        tmp_path / "o.png",
        "--save-plan",
        tmp_path / "p.json",
    )
    assert "note: fidelity: foreign" in result.stdout, result.stderr
    assert "The session was locked" in result.stdout
    before, after = load_image(screen)[0], load_image(tmp_path / "o.png")[0]
    assert (before != after).any(axis=2).mean() > 0.9
    again = run("apply", screen, "--plan", tmp_path / "p.json", "-o", tmp_path / "again.png")
    assert again.returncode == 0, again.stderr
    assert np.array_equal(load_image(tmp_path / "again.png")[0], after)


def test_a_picture_that_cannot_show_an_effect_is_refused_not_copied(tmp_path):
    Image.new("RGB", (200, 100)).save(tmp_path / "small.png")
    refused(
        run("apply", tmp_path / "small.png", "verification", "-o", tmp_path / "o.png"),
        "--sizes 200x100",
    )
    assert not (tmp_path / "o.png").exists()
    plan = tmp_path / "bare.json"
    plan.write_text(hj.Verification().plan(hj.Scene((100, 200)), seed=0).to_json())
    refused(
        run("apply", tmp_path / "small.png", "--plan", plan, "-o", tmp_path / "o.png"),
        "leave out --plan",
    )
    assert not (tmp_path / "o.png").exists()


def test_check_finds_a_bad_plugin(tmp_path):
    plugin = tmp_path / "bad.py"
    plugin.write_text(
        "import random\nfrom dataclasses import dataclass\nfrom typing import ClassVar\n"
        "from hijack_data.plugin import Corruption, Draft, Paste, register\n"
        "@register\n@dataclass(frozen=True)\nclass Bad(Corruption):\n"
        '    """Uses the global generator."""\n    name: ClassVar[str] = "bad"\n    category:'
        ' ClassVar[str] = "visual_disruptor"\n    scope: ClassVar[str] = "observation"\n    def'
        " make_plan(self, scene, stream, step):\n        at = ((random.randint(0, 9), 0),)\n       "
        ' return Draft(ops=(Paste({"draw": "mark", "shape": "star", "size": 9, "color":'
        ' "red"}, at),))\n'
    )
    result = run("check", plugin, command=lean.HIJACK)
    assert result.returncode == 1
    assert "global generator; use the stream" in " ".join(result.stdout.split())
    (tmp_path / "none.py").write_text("x = 1\n")
    refused(run("check", tmp_path / "none.py"), "registers nothing")
    (tmp_path / "reader.py").write_text(
        "from pipelines.readers.base import register\n@register\nclass R:\n    name = 'mine'\n"
        "    def detect(self, path): return False\n    def read(self, source): return iter(())\n"
    )
    refused(run("check", tmp_path / "reader.py"), "nothing that hijack check can check")
    (tmp_path / "broken.py").write_text("def\n")
    refused(run("check", tmp_path / "broken.py"), "cannot be imported: SyntaxError")
    refused(run("check", tmp_path / "missing.py"), "not a Python file")


def test_doctor():
    result = run("doctor")
    assert result.returncode == 0
    assert "numpy" in result.stdout


def test_what_a_shell_is_told_is_for_a_shell(tmp_path):
    """Options by their names; where a message is of the library's, Python's come second."""
    (tmp_path / "half" / ".build").mkdir(parents=True)
    refused(
        run("verify", tmp_path / "half"), "the same build with --resume (in Python: resume=True)"
    )
    nothing = run(
        "build",
        ROOT / "examples" / "recordings",
        "--out",
        tmp_path / "n",
        "--no-clean",
        "--corruptions",
        "",
    )
    refused(nothing, "--no-clean")


def test_a_label_with_brackets_is_printed():
    from rich.console import Console

    from pipelines.dataset.stats import LabelStats, Stats

    counts = {"dropped": {}, "not_applicable": {"[bold]b": {"no [i] there": 1}}, "rejected": {}}
    stats = Stats(
        folder="folder",
        output="materialised",
        trajectories=1,
        steps=1,
        shards=1,
        bytes=1,
        labels={"[red]a": LabelStats()},
        counts=counts,
    )
    console = Console(width=200, file=io.StringIO())
    console.print(*stats.tables(), sep="\n")
    printed = console.file.getvalue()
    assert printed.count("[red]a") == 2
    assert "[bold]b: not applicable to 1 step: no [i] there" in printed


def test_unknown_command():
    refused(run("aply"), "did you mean 'apply'")


def test_gallery(screen, tmp_path):
    result = run(
        "gallery",
        screen,
        "-o",
        tmp_path / "g.html",
        "--corruptions",
        "marks,subtitle",
        "--detect",
        "none",
    )
    assert result.returncode == 0, result.stderr
    assert "<title>" in (tmp_path / "g.html").read_text()
    (tmp_path / "bad.png").write_bytes(b"")
    result = run(
        "gallery",
        screen,
        tmp_path / "bad.png",
        "-o",
        tmp_path / "g2.html",
        "--corruptions",
        "marks",
    )
    assert result.returncode == 1
    assert "0 bytes" in result.stderr
    refused(
        run("gallery", screen, "-o", tmp_path / "g3.html", "--corruptions", "marsk"),
        "did you mean 'marks'",
    )


def test_build_and_verify(tmp_path):
    source = ROOT / "examples" / "recordings"
    options = ("--limit", "1", "--corruptions", "marks")
    result = run("build", source, "--out", tmp_path / "d", *options, "--json")
    assert result.returncode == 0, result.stderr
    assert json.loads(result.stdout)["rows_by_corruption"] == {"clean": 8, "marks": 8}
    assert run("verify", tmp_path / "d").returncode == 0
    refused(run("build", source, "--out", tmp_path / "d"), "--resume")
    refused(run("build", tmp_path / "nothing", "--out", tmp_path / "e"), "nothing")
    refused(
        run("build", source, "--out", tmp_path / "f", "--corruptions", "verificaton"),
        "mean 'verification'",
    )
    refused(
        run("build", source, "--out", tmp_path / "f", "--format", "agentnett"),
        "did you mean 'agentnet'",
    )
    shard = next((tmp_path / "d" / "data").glob("*.parquet"))
    data = bytearray(shard.read_bytes())
    data[len(data) // 2] ^= 1
    shard.write_bytes(bytes(data))
    result = run("verify", tmp_path / "d", "--json")
    assert result.returncode == 1
    assert json.loads(result.stdout)["ok"] is False


def test_what_a_terminal_cannot_show_is_printed_as_an_escape(monkeypatch):
    printed = io.TextIOWrapper(io.BytesIO(), encoding="utf-8")
    monkeypatch.setattr(sys, "stdout", printed)
    with pytest.raises(SystemExit):
        cli.main(["--help"])
    print("half a pair: \ud83d", flush=True)
    assert printed.buffer.getvalue().endswith(b"half a pair: \\ud83d\n")


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full, which Linux has")
def test_a_full_disk_behind_the_output_is_one_line():
    with open("/dev/full", "w") as full:
        process = subprocess.run(
            [sys.executable, "-m", "hijack_data.cli", "list"],
            stdout=full,
            stderr=subprocess.PIPE,
            text=True,
            check=False,
        )
    output = (
        "hijack: error: the output cannot be written (No space left on device); free some space"
    )
    assert (process.returncode, process.stderr.strip()) == (3, output)
