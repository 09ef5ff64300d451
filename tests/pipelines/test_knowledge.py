"""What a source knows of its machine, and what people tell a build about it, decides what may
happen there."""

import json
import re
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner

from hijack_data.apps import collect_apps
from hijack_data.cli import hijack
from hijack_data.errors import ConfigError, ParameterError, ParameterTypeError
from hijack_data.platforms import as_platform, find_platform
from hijack_data.types import Action, Step, Trajectory
from pipelines import build, inspect_source, open_dataset, verify
from pipelines.building.output_folder import parameters_in
from pipelines.errors import BuildError, SourceError
from pipelines.knowledge import SIDECAR, Knowledge, KnowledgeEntry, read_knowledge
from pipelines.readers import get_reader

from support.events import FIVE, with_apps
from support.formats import FORMATS, osworld, write_json

PAGE = "the pictures show a web page"
UNSAID = "the recording does not say whether its pictures show a desktop, a web page or a phone"


@pytest.mark.parametrize(
    ("word", "platform"),
    [
        ("Darwin", "macos"),
        ("Windows", "windows"),
        ("Ubuntu", "linux"),
        ("Xfce", "linux-xfce"),
        ("iOS", "ios"),
        ("web page", "web"),
        ("linux_xfce", "linux-xfce"),
        ("embedded", "linux-xfce"),
        ("desktop", None),
        (3, None),
    ],
)
def test_words_for_platforms(word: Any, platform: str | None) -> None:
    assert find_platform(word) == platform
    if platform is None:
        with pytest.raises((ParameterError, ParameterTypeError), match="platform"):
            as_platform(word)


def first(name: str, folder: Path) -> Trajectory:
    value, *_ = (item for item in get_reader(name).read(folder) if isinstance(item, Trajectory))
    return value


def change_rows(file: Path, **more: Any) -> None:
    """Add fields to every record of a JSON or JSON Lines file."""
    text = file.read_text()
    lines = text.splitlines() if file.suffix == ".jsonl" else [text]
    file.write_text(
        "\n".join(json.dumps({**json.loads(line), **more}) for line in lines if line) + "\n"
    )


def agentnet(folder: Path) -> Path:
    """An AgentNetBench task that says where it was recorded."""
    (file,) = FORMATS["agentnet"](folder).glob("*.json*")
    about = {
        "applications": ["Excel"],
        "websites": ["goodreads"],
        "system": "Windows",
        "domain": "Work",
    }
    change_rows(file, meta_info=about)
    return folder


def agentnet_ubuntu(folder: Path) -> Path:
    (file,) = FORMATS["agentnet"](folder).glob("*.json*")
    file.rename(file.with_name(f"agentnet_ubuntu_5k{file.suffix}"))
    return folder


def osworld_snapshot(folder: Path) -> Path:
    """A task that names its snapshot only."""
    osworld(folder)
    (task,) = (folder / "examples" / "gimp").iterdir()
    write_json(task, {"id": "x", "instruction": "find it", "snapshot": "chrome"})
    return folder


def screenagent(folder: Path) -> Path:
    FORMATS["screenagent"](folder)
    for file in folder.rglob("*.json"):
        change_rows(file, send_prompt_en="You are familiar with the Windows operating system. Now")
    return folder


def jsonl(folder: Path) -> Path:
    FORMATS["jsonl"](folder)
    return with_apps(folder, ["Finder"], platform=lambda row: "Mac")


def openai(folder: Path) -> Path:
    """A body whose computer tool tells its environment."""
    FORMATS["openai"](folder)
    (file,) = folder.glob("*.json*")
    records = [json.loads(line) for line in file.read_text().splitlines()]
    tool = {"type": "computer_use_preview", "environment": "windows"}
    file.write_text(
        "".join(json.dumps(line) + "\n" for line in [{"tools": [tool], "input": []}, *records])
    )
    return folder


def openai_browser(folder: Path) -> Path:
    (file,) = openai(folder).glob("*.json*")
    file.write_text(file.read_text().replace('"windows"', '"browser"', 1))
    return folder


def runs(folder: Path) -> Path:
    FORMATS["runs"](folder)
    for file in folder.rglob("episode.json"):
        change_rows(file, desktop={"provider": "EmbeddedDesktop"})
    return folder


SOURCES: list[Any] = [
    ("agentnet", agentnet, {"Excel", "browser"}, "windows"),
    ("agentnet", agentnet_ubuntu, None, "linux"),
    ("osworld", osworld_snapshot, {"chrome"}, "linux"),
    ("screenagent", screenagent, set(), "windows"),
    ("jsonl", jsonl, {"Finder"}, "macos"),
    ("openai", openai, set(), "windows"),
    ("openai", openai_browser, {"browser"}, None),
    ("runs", runs, None, "linux-xfce"),
    ("webvoyager", FORMATS["webvoyager"], {"browser"}, "web"),
]


@pytest.mark.parametrize(("reader", "make", "apps", "platform"), SOURCES)
def test_what_a_source_says_is_read(
    reader: str, make: Any, apps: set[str] | None, platform: str | None, tmp_path: Path
) -> None:
    result = first(reader, make(tmp_path / "source"))
    assert result.platform == platform
    assert apps is None or set(result.apps) == apps


@pytest.mark.parametrize(("reader", "make", "apps", "platform"), SOURCES)
def test_what_a_source_says_decides(
    reader: str,
    make: Any,
    apps: set[str] | None,
    platform: str | None,
    assets: Path,
    tmp_path: Path,
) -> None:
    """A lock screen of Xfce is not put on another desktop, and a browser is known where one is."""
    options: dict[str, Any] = {
        "format": reader,
        "corruptions": "verification,network_error",
        "clean": False,
    }
    report = build(make(tmp_path / "source"), tmp_path / "out", assets=assets, **options)
    reasons = {label: "; ".join(value) for label, value in report.not_applicable.items()}
    if platform == "web":
        assert PAGE in reasons["verification"]
        assert "names no browser" not in reasons.get("network_error", "")
        return
    output = {None: UNSAID, "linux-xfce": "was recorded on a screen of this size"}.get(
        platform, f"shows {platform}"
    )
    assert output in reasons["verification"]
    if apps is not None:
        names_browser = bool(apps & {"browser", "chrome"})
        assert ("names no browser" in reasons["network_error"]) == (not names_browser)


def test_a_platform_that_is_none_is_rejected(recording: Any) -> None:
    folder = with_apps(recording(trajectories=1, steps=1), [], platform=lambda row: "windoes")
    (rejected,) = get_reader("jsonl").read(folder)
    assert (rejected.field, "did you mean 'windows'" in rejected.reason) == ("platform", True)


def without(folder: Path) -> Path:
    """A recording that says nothing of its machine."""
    return with_apps(folder, [], platform=lambda row: None)


@pytest.mark.parametrize(
    ("options", "fidelity", "reason"),
    [
        ({}, None, UNSAID),
        ({"platform": "xfce"}, "recorded", ""),
        (
            {"platform": "linux"},
            None,
            "shows linux, .* if it is one, say so with --platform linux-xfce",
        ),
        (
            {"platform": "windows"},
            None,
            r"shows windows, and the pictures are of an Xfce .* --allow-platform-mismatch \(in Python",
        ),
        ({"platform": "windows", "allow_platform_mismatch": True}, "foreign", ""),
        ({"allow_platform_mismatch": True}, None, UNSAID),
        ({"platform": "xfce", "allow_platform_mismatch": True}, "recorded", ""),
        ({"platform": "android", "allow_platform_mismatch": True}, None, "show a phone"),
        ({"platform": "web", "allow_platform_mismatch": True}, None, "show a web page"),
    ],
)
def test_our_desktop_is_shown_on_its_own_platform_or_on_request(
    options: Any, fidelity: str | None, reason: str, recording: Any, assets: Path, tmp_path: Path
) -> None:
    source, out = without(recording(trajectories=1, steps=1)), tmp_path / "out"
    report = build(source, out, corruptions="verification", clean=False, assets=assets, **options)
    assert [row["fidelity"] for row in open_dataset(out)] == ([fidelity] if fidelity else [])
    (why,) = report.not_applicable.get("verification", {"": 0})
    assert re.search(reason, why)
    assert verify(out).ok


def test_options_hold_where_the_source_does_not_say(
    browsing: Path, assets: Path, tmp_path: Path
) -> None:
    """The recording is of Chrome on Xfce, whatever the options are; `linux` leaves open which
    desktop it is."""
    options: dict[str, Any] = {"corruptions": ",".join(FIVE), "assets": assets, "clean": False}
    plain = build(browsing, tmp_path / "plain", **options)
    message = build(browsing, tmp_path / "told", apps="chrome,gimp", platform="windows", **options)
    assert (
        (message.rows, message.not_applicable) == (plain.rows, {}) == (dict.fromkeys(FIVE, 2), {})
    )
    shard = Path("data", "train-00000.parquet")
    assert (tmp_path / "plain" / shard).read_bytes() == (tmp_path / "told" / shard).read_bytes()
    with_apps(browsing, ["chrome"], platform=lambda row: "linux")
    knowledge = read_knowledge(browsing, platform="linux-xfce")
    assert {item.platform for item in knowledge.complete(get_reader("jsonl").read(browsing))} == {
        "linux-xfce"
    }  # type: ignore[union-attr]


def test_apps_of_all_trajectories_are_checked_against_each(
    recording: Any, add_line: Any, good_line: Any, tmp_path: Path
) -> None:
    """The option speaks for every trajectory: a stated fact against it is an error, and a program
    that an instruction names leaves the applications of that trajectory unknown."""
    source = without(recording(trajectories=1, steps=1))
    for name, instruction in (("crop", "使用GIMP剪裁图像"), ("site", "open the site in Chromium")):
        add_line(
            source, good_line(name, 0, image="images/t0-0.png", instruction=instruction, apps=None)
        )
    result = inspect_source(source, apps="chrome", sample=0)
    assert result.apps == {"chrome": 2, "not said": 1}
    assert any("instruction names another program, such as crop" in note for note in result.notes)
    add_line(source, good_line("mail", 0, image="images/t0-0.png", apps=["Thunderbird"]))
    message = r"apps chrome: trajectory 'mail' states thunderbird; .*agenthijack\.yaml"
    with pytest.raises(BuildError, match=message):
        build(source, tmp_path / "out", apps="chrome")
    entry = {"match": "mail", "apps": ["thunderbird"]}
    (source / SIDECAR).write_text(json.dumps({"recordings": [entry]}))
    assert inspect_source(source, apps="chrome", sample=0).apps["thunderbird"] == 1


@pytest.mark.parametrize("name", ["windows", "Windows 11", "macOS", "Ubuntu 22.04"])
def test_a_platform_is_no_application(name: str) -> None:
    assert collect_apps([name, "VLC"]) == {"vlc"}


def test_a_phone_stays_one_whatever_the_option_says(recording: Any, tmp_path: Path) -> None:
    source = with_apps(recording(trajectories=1, steps=1), [], domain=lambda row: "mobile")
    with_apps(source, [], platform=lambda row: None)
    report = build(
        source,
        tmp_path / "out",
        corruptions="verification",
        platform="linux-xfce",
        allow_platform_mismatch=True,
    )
    assert "show a phone" in str(report.not_applicable)


def test_manifest_and_card_know_what_was_told(recording: Any, assets: Path, tmp_path: Path) -> None:
    source, out = without(recording(trajectories=1, steps=1)), tmp_path / "out"
    options: dict[str, Any] = {"corruptions": "multi_apps", "assets": assets}
    entries = {
        "apps": ["Google Chrome", "code"],
        "platform": "Win11",
        "allow_platform_mismatch": True,
    }
    build(source, out, **options, **entries)
    parameters = parameters_in(out)
    assert parameters["recordings"] == {"apps": ["chrome", "vscode"], "platform": "windows"}
    assert parameters["allow_platform_mismatch"] is True
    assert (
        "--apps chrome,vscode --platform windows --allow-platform-mismatch"
        in (out / "README.md").read_text()
    )
    for second in (
        {**entries, "apps": "gimp"},
        {**entries, "platform": None},
        {**entries, "allow_platform_mismatch": False},
    ):
        with pytest.raises(BuildError, match="was begun with other parameters"):
            build(source, out, resume=True, **options, **second)
    assert build(source, out, resume=True, **options, **entries).kept == 1
    build(source, tmp_path / "plain", **options)
    assert not {"recordings", "allow_platform_mismatch"} & parameters_in(tmp_path / "plain").keys()


@pytest.mark.parametrize(
    ("options", "error"),
    [
        (
            {"apps": "chrom"},
            "apps: 'chrom' is not an application that is known; did you mean 'chrome'",
        ),
        ({"apps": "chrome,,gimp"}, "apps holds an empty name"),
        ({"apps": 3}, "apps must be names of applications"),
        ({"apps": ["chrome", 3]}, "apps must be names of applications"),
        ({"platform": "linx"}, "platform: unknown platform 'linx'; did you mean 'linux'"),
        ({"platform": 3}, "platform must be the name of a platform"),
    ],
)
def test_slips_in_options_are_errors(
    options: Any, error: str, recording: Any, tmp_path: Path
) -> None:
    with pytest.raises((ParameterError, ParameterTypeError), match=error):
        build(recording(), tmp_path / "out", **options)
    assert not (tmp_path / "out").exists()


def test_the_command_takes_what_is_known(recording: Any, assets: Path, tmp_path: Path) -> None:
    source = str(without(recording(trajectories=1, steps=1)))
    command = [
        "build",
        source,
        "--out",
        str(tmp_path / "out"),
        "--corruptions",
        "network_error",
        "--assets",
    ]
    options = ["--apps", "chrome", "--platform", "linux-xfce"]
    run = CliRunner().invoke(hijack, [*command, str(assets), *options])
    assert (run.exit_code, "network_error: 1" in run.output) == (0, True), run.output


def test_a_file_in_the_source_says_it_by_trajectory(
    recording: Any, assets: Path, tmp_path: Path
) -> None:
    """It wins over the records; options hold for what it leaves open."""
    source = with_apps(recording(trajectories=3, steps=1), ["gimp"], platform=lambda row: "windows")
    (source / SIDECAR).write_text(
        "recordings:\n- {match: t0, apps: [Chromium]}\n- {match: t1, apps: [vlc]}\n"
        "- {match: t2, apps: [gimp], platform: windows}\n- {match: 't?', platform: xfce}\n"
    )
    items = list(read_knowledge(source, "gimp", "macos").complete(get_reader("jsonl").read(source)))
    values = [(item.id, item.apps, item.platform) for item in items if isinstance(item, Trajectory)]
    assert values == [
        ("t0", ("chrome",), "linux-xfce"),
        ("t1", ("vlc",), "linux-xfce"),
        ("t2", ("gimp",), "windows"),
    ]
    report = build(
        source, tmp_path / "out", corruptions="network_error", clean=False, assets=assets
    )
    assert [row["trajectory_id"] for row in open_dataset(tmp_path / "out")] == ["t0"]
    assert report.rejected == 0
    assert len(parameters_in(tmp_path / "out")["recordings"]["file_sha256"]) == 64


def test_an_entry_that_matches_nothing_is_counted(recording: Any, tmp_path: Path) -> None:
    source = recording(trajectories=1, steps=1)
    (source / SIDECAR).write_text(
        "recordings:\n- {match: 't*', platform: windows}\n- {match: s0, platform: windows}\n"
    )
    report = build(source, tmp_path / "out", corruptions="marks")
    assert report.exit_code == 1
    (line,) = (tmp_path / "out" / "quarantine.jsonl").read_text().splitlines()
    assert json.loads(line) == {
        "file": SIDECAR,
        "where": "line 3",
        "field": "match",
        "reason": "'s0' matches no trajectory; give an id, or a pattern with * and ?",
    }


@pytest.mark.parametrize(
    ("text", "errors"),
    [
        ("", ["is empty; write"]),
        ("apps: [chrome]", [":1:1: write a list under the key recordings"]),
        (
            "recordings: []\nrecordngs: []",
            [":2:1: unknown key 'recordngs'; did you mean 'recordings'"],
        ),
        ("recordings:\n- t0", [":2:3: an entry is a mapping"]),
        (
            "recordings:\n- {match: t0, aps: [x]}",
            ["unknown key 'aps'; did you mean 'apps'", "says nothing; give apps"],
        ),
        ("recordings:\n- {apps: [gimp]}", ["match is missing; write the id"]),
        ("recordings:\n- {match: t0, apps: chrome}", ["apps must be a list of names"]),
        (
            "recordings:\n- {match: t0, apps: [chrom]}\n- {match: t1, platform: [3]}",
            [":2:", "did you mean 'chrome'", ":3:", "unknown platform a list"],
        ),
        ("recordings: [", ["agenthijack.yaml:"]),
    ],
)
def test_mistakes_in_the_file_name_place_and_fix(
    text: str, errors: list[str], recording: Any, tmp_path: Path
) -> None:
    source = recording()
    (source / SIDECAR).write_text(text)
    with pytest.raises(ConfigError) as caught:
        build(source, tmp_path / "out", corruptions="marks")
    assert SIDECAR in str(caught.value)
    for error in errors:
        assert error in str(caught.value)
    assert not (tmp_path / "out").exists()


def test_the_file_is_a_file_of_the_source(recording: Any, tmp_path: Path) -> None:
    source, outside = recording(), tmp_path / "outside.yaml"
    outside.write_text("recordings:\n- {match: t0, platform: windows}\n")
    (source / SIDECAR).symlink_to(outside)
    with pytest.raises(SourceError, match=r"agenthijack\.yaml: .* leaves the source folder"):
        build(source, tmp_path / "out", corruptions="marks")


def test_only_pixels_drawn_over_it_make_a_recorded_screen_composited(
    browsing: Path, assets: Path, tmp_path: Path
) -> None:
    import hijack_data as hj

    over = {"marks": hj.Marks(number=3, mark_size=6), "resolution": hj.Resolution(scale=0.5)}
    planners = {
        f"with_{name}": hj.Sequence([second, hj.Verification()]) for name, second in over.items()
    }
    build(
        browsing,
        tmp_path / "out",
        corruptions={**planners, "alone": hj.Verification()},
        assets=assets,
        clean=False,
    )
    entries = {
        row["corruption"]: row["fidelity"] for row in open_dataset(tmp_path / "out") if row["event"]
    }
    assert entries == {
        "with_marks": "composited",
        "with_resolution": "composited",
        "alone": "recorded",
    }


def test_brackets_in_a_match_are_those_of_the_id() -> None:
    entry = KnowledgeEntry("session [1]*", ("gimp",), None, "recordings[0]")
    steps = (Step(0, "0.png", Action("wait")),)
    trajectories = [
        Trajectory(name, "jsonl", "do it", steps) for name in ("session 1", "session [1]b")
    ]
    completed = Knowledge(entries=(entry,)).complete(trajectories)
    assert [item.apps for item in completed if isinstance(item, Trajectory)] == [(), ("gimp",)]
