"""The configuration of a benchmark: what it may say, and every mistake with its place."""

import re
from pathlib import Path

import pytest
import yaml

import hijack_data as hj
from hijack_data.corruption import corruption_names
from hijack_data.errors import (
    ConfigError,
    HijackError,
    HijackWarning,
    ParameterError,
    UnknownNameError,
    shorten_list,
)
from hijack_data.runs.run_planners import read_planners

pytest.importorskip("gymnasium", reason="needs the extra [online]")

from online_env import tasks
from online_env.agents.registry import AGENTS
from online_env.bench.config import Bench, all_planners, at_severities, load_bench, override
from online_env.bench.jobs import Job, jobs
from online_env.bench.providers import check_installed
from online_env.errors import MissingPackageError

ROOT = Path(__file__).resolve().parents[2]


def write(tmp_path, text):
    path = tmp_path / "b.yaml"
    path.write_text(text)
    return path


def mistakes(tmp_path, text):
    path = write(tmp_path, text)
    with pytest.raises(ConfigError) as caught:
        load_bench(path)
    return [problem.removeprefix(f"{path}:") for problem in caught.value.problems]


def test_the_shipped_small_benchmark():
    bench = load_bench("embedded_small")
    assert bench == load_bench(ROOT / "configs/benchmark/embedded_small.yaml").__class__(
        **vars(bench)
    )
    assert (bench.size, bench.seeds, bench.recovery, bench.retries) == (
        (1080, 1920),
        (0,),
        "none",
        1,
    )
    assert set(bench.tasks) <= set(tasks.names())
    assert list(bench.planners) == ["clean", *hj.corruption_names()]
    assert bench.planners["marks"] == hj.Marks()
    assert bench.planners["clean"] is None
    assert len(jobs(bench)) == 2 * 10 * 10


def test_every_key(tmp_path):
    bench = load_bench(
        write(
            tmp_path,
            """
desktop: {provider: embedded, size: [1280, 720]}
agents: all
tasks: [rename_file]
corruptions:
  - clean
  - marks: {as: few, number: 5}
  - accidental_touch: {step: {every: 2}}
  - sequence: {as: both, parts: [subtitle, network_error]}
seeds: [3, 1]
max_steps: 9
recovery: repair
retries: 0
""",
        )
    )
    assert (bench.size, bench.agents, bench.tasks) == (
        (720, 1280),
        tuple(AGENTS.names()),
        ("rename_file",),
    )
    assert list(bench.planners) == ["clean", "few", "accidental_touch", "both"]
    assert bench.planners["few"] == hj.Marks(number=5)
    assert (bench.seeds, bench.max_steps, bench.recovery, bench.retries) == ((3, 1), 9, "repair", 0)
    data = bench.to_data()
    assert data["corruptions"][0] == "clean"
    assert data["corruptions"][1]["marks"]["number"] == 5
    assert data["corruptions"][1]["marks"]["as"] == "few"
    assert data["corruptions"][2]["accidental_touch"]["step"] == {"every": 2}
    # Other tests of this process may have registered agents of files, whose hashes are in `code`.
    fields = {key: value for key, value in data.items() if key not in ("source", "code")}
    again = load_bench(write(tmp_path, yaml.safe_dump(fields)))
    assert again.to_data() | {"source": ""} == data | {"source": ""}


def test_defaults(tmp_path):
    bench = load_bench(write(tmp_path, "tasks: all\n"))
    assert bench.planners == all_planners()
    assert (bench.agents, bench.seeds, bench.max_steps) == (("oracle",), (0,), 15)
    only = load_bench(write(tmp_path, "corruptions: [clean]\n"))
    assert dict(only.planners) == {"clean": None}
    assert only.to_data()["corruptions"] == ["clean"]


def test_the_paper_s_protocol():
    bench = load_bench("paper")  # a file of corruptions has this name, too
    assert (bench.source, bench.size) == ("benchmark/paper", (1080, 1920))
    assert (bench.max_steps, bench.recovery, bench.environment_errors) == (
        15,
        "reset",
        "before_setup",
    )
    assert len(bench.agents) == 10
    assert "agenthijack-agent" in bench.agents
    assert dict(bench.planners) == all_planners()
    overridden = override(bench, recovery="none", environment_errors="after_setup", layer="dom")
    assert overridden.to_data() == {
        **bench.to_data(),
        "recovery": "none",
        "environment_errors": "after_setup",
        "layer": "dom",
    }


def test_every_mistake_at_once_with_its_place(tmp_path):
    result = mistakes(
        tmp_path,
        """\
desktop: {provider: vmware, size: [1920], colour: 1}
agnets: [oracle]
agents: [oracl]
tasks: [write_not, rename_file, rename_file]
corruptions: [clean, {marks: {as: m2, number: x}}, pop_up]
seeds: 3
max_steps: 0
recovery: nun
retries: yes
""",
    )
    assert result == [
        "1:21: desktop.provider must be one of embedded, osworld, browser, got 'vmware'; known:"
        " browser, embedded, osworld",
        (
            "1:35: desktop.size must be [width, height] in pixels; write desktop: {provider:"
            " embedded, size: [1920, 1080]}"
        ),
        "1:43: desktop has no key 'colour'; known: provider, size",
        "2:1: unknown key 'agnets'; did you mean 'agents'?",
        (
            f"3:10: agents[0] must be one of {shorten_list(AGENTS.names())}, got 'oracl'; did you mean"
            " 'oracle'?"
        ),
        (
            f"4:9: tasks[0] must be one of {shorten_list(tasks.names())}, got 'write_not'; did you mean"
            " 'write_note'?"
        ),
        "4:33: tasks names 'rename_file' twice; remove one",
        "5:47: marks.number must be an integer, got 'x' (str)",
        "5:52: unknown corruption 'pop_up'; did you mean 'pop_ups'?",
        "6:8: seeds must be a list, got 3 (int); write seeds: [0, 1, 2]",
        "7:12: max_steps must be int in [1, 1000], got 0",
        "8:11: recovery must be one of none, repair, reset, got 'nun'; did you mean 'none'?",
        "9:10: retries must be an integer, got 'yes' (str)",
    ]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "1:1: a benchmark is a mapping such as tasks: [write_note], the file is empty"),
        ("[write_note]", "got a list"),
        ("tasks: []", "1:8: tasks must be a list, got an empty one; write tasks: ["),
        ("tasks:", "tasks must be a list, got nothing"),
        ("desktop: embedded", "1:10: desktop must be a mapping"),
        ("desktop: {size: [10, 99999]}", "desktop.size[0] must be int in [200, 8192], got 10"),
        ("seeds: [1, -1]", "1:12: seeds[1] must be int"),
        ("seeds: [1, 1]", "1:12: seeds names 1 twice; remove one"),
        ("corruptions: []", "corruptions is empty"),
        ("corruptions: some", "corruptions must be a list of corruptions"),
        ("tasks: [write_note", "not valid YAML"),
        (f"max_steps: {'9' * 60}", "a whole number of 60 digits"),
    ],
)
def test_mistakes(text, words, tmp_path):
    result = mistakes(tmp_path, text)
    assert any(words in problem for problem in result), result


def test_the_command_line_overrides(tmp_path):
    bench = load_bench("embedded_small")
    overridden = override(
        bench, agent="do_nothing", task="rename_file, write_note", corruption="clean,marks", seeds=3
    )
    assert overridden.agents == ("do_nothing",)
    assert overridden.tasks == ("rename_file", "write_note")
    assert dict(overridden.planners) == {"clean": None, "marks": hj.Marks()}
    assert overridden.seeds == (0, 1, 2)
    assert override(bench) == bench


def test_labels_of_the_file_can_be_chosen(tmp_path):
    bench = load_bench(write(tmp_path, "corruptions: [{marks: {as: few, number: 5}}]\n"))
    assert dict(override(bench, corruption="few").planners) == {"few": hj.Marks(number=5)}
    assert dict(override(bench, corruption="marks").planners) == {"marks": hj.Marks()}
    assert override(bench, corruption="all").planners == all_planners()
    file = tmp_path / "default.yaml"
    file.write_text("noise: {marks: {number: 7}, subtitle: {subtitle_text: [A, B]}}")
    assert dict(override(bench, corruption=f"clean,{file}").planners) == {
        "clean": None,
        "marks": hj.Marks(number=7),
        "subtitle": hj.Subtitle("A\nB"),
    }
    with pytest.raises(ParameterError, match="names 'marks' twice"):
        override(bench, corruption=f"marks,{file}")
    file.write_text("corruptions: [marks]\nseed: 7\nclean: true\n")
    with pytest.warns(HijackWarning, match=r"default.yaml: a run does not read its seed, clean"):
        override(bench, corruption=str(file))


@pytest.mark.parametrize(
    ("options", "error", "words"),
    [
        ({"agent": "oracl"}, UnknownNameError, "--agent: no 'oracl'; did you mean 'oracle'?"),
        ({"task": "rename"}, UnknownNameError, "--tasks: no 'rename'; did you mean 'rename_file'?"),
        (
            {"corruption": "mark"},
            UnknownNameError,
            "--corruptions: no 'mark'; did you mean 'marks'?",
        ),
        ({"corruption": "marks,"}, UnknownNameError, "--corruptions: no ''"),
        ({"corruption": "mine.py:Mine"}, UnknownNameError, "hijack --load FILE.py COMMAND"),
        ({"corruption": "marks,marks"}, ParameterError, "--corruptions names 'marks' twice"),
    ],
)
def test_overrides_that_are_refused(options, error, words):
    with pytest.raises(error, match=words.replace("?", r"\?")):
        override(load_bench("embedded_small"), **options)


def test_jobs_in_their_order():
    bench = Bench(
        agents=("a", "b"),
        tasks=("t", "u"),
        corruptions={"clean": None, "marks": hj.Marks()},
        seeds=(0, 7),
    )
    listed = jobs(bench)
    assert len(listed) == len(set(listed)) == 16
    assert listed[:3] == [
        Job("a", "t", "clean", 0),
        Job("b", "t", "clean", 0),
        Job("a", "t", "marks", 0),
    ]


def test_a_run_whose_applications_are_missing_is_refused_with_the_profile(monkeypatch):
    packages = pytest.importorskip("online_env.embedded.packages")
    monkeypatch.setattr(packages, "missing", lambda names: [n for n in names if n == "gimp"])
    with pytest.raises(MissingPackageError, match=r"crop_picture.*\(gimp\).*--profile media"):
        check_installed("embedded", ["write_note", "crop_picture"])
    check_installed("embedded", ["write_note"])
    check_installed("mine", ["crop_picture"])


def test_a_pair_is_named_by_its_parts_and_read_back():
    bench = override(Bench(), corruption="clean,pop_ups+slow_network")
    pair = bench.planners["pop_ups+slow_network"]
    assert [part.label for part in pair.parts] == ["pop_ups", "slow_network"]
    read = read_planners(bench.to_data()["corruptions"])
    assert read["pop_ups+slow_network"].to_config() == pair.to_config()
    sets = override(Bench(), corruption="clean,everyday,marks").planners
    assert list(sets) == ["clean", *corruption_names("everyday"), "marks"]
    for text, words in {
        "pop_ups+slow": "--corruptions: no 'slow'",
        "marks+clean": "--corruptions: no 'clean'",
        "marks+marks": "--corruptions names 'marks' twice",
    }.items():
        with pytest.raises(HijackError, match=re.escape(words)):
            override(Bench(), corruption=text)


def test_corruptions_at_several_severities():
    bench = Bench(corruptions={"clean": None, "m": hj.Marks(), "lock": hj.Verification()})
    planners = at_severities(bench, "1,4-5").planners
    assert planners == {
        "clean": None,
        "m_s1": hj.Marks.at(1),
        "m_s4": hj.Marks.at(4),
        "m_s5": hj.Marks.at(5),
        "lock": hj.Verification(),
    }
    idle = override(bench, corruption="clean,verification")
    with pytest.raises(ParameterError, match=r"no corruption of the run has levels \(clean, ver"):
        at_severities(idle, "1-5")
    assert at_severities(bench, None) is bench
    for text in ("0-3", "1,1", "4-2", "harsh", ""):
        with pytest.raises(ParameterError, match=r"levels of 1 to 5, such as 1-5"):
            at_severities(bench, text)
    own_bench = Bench(corruptions={"small": hj.PopUps(width=100)})
    with pytest.raises(ParameterError, match=r"'small' is not a corruption with its default"):
        at_severities(own_bench, "1-5")
