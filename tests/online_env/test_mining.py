"""`hijack mine`: lost episodes are grouped, and each group's benchmark plays them again."""

from typing import Any

import pytest

from support import needs

pytest.importorskip("scipy", reason=needs.ONLINE)

import hijack_data as hj
from hijack_data.cli import main
from online_env.bench.config import load_bench
from online_env.report.causes import LostEpisode
from online_env.search.mining import group_lost

from support.reported import made, run_of
from support.runlog import make_run

LOCK = {"effects": [{"step": 0, "record": {"effect": "lock", "probes": [{"ok": True}]}}]}
PLANNERS = {"clean": None, "locked": hj.Verification(), "marks_s4": hj.Marks.at(4)}


def lost(task: str, label: str, cause: str, app: str) -> LostEpisode:
    record = made("a", task, label, 0.0, apps=[app])
    return LostEpisode(record=record, cause=cause, turn=None)


def test_what_episodes_share_makes_a_group() -> None:
    episodes = [
        lost("t0", "locked", "failed", "gimp"),
        lost("t1", "locked", "failed", "gimp"),
        lost("t2", "locked", "failed", "thunar"),
        lost("t3", "locked", "failed", "chrome"),
        lost("t4", "marks_s4", "out of steps", "gimp"),
    ]
    groups = group_lost(episodes, PLANNERS)
    assert [(group.key, group.tasks, group.share) for group in groups] == [
        (("a", "locked", "failed", "gimp"), ["t0", "t1"], 0.4),
        (("a", "verification", "failed"), ["t2", "t3"], 0.4),
        (("a", "marks"), ["t4"], 0.2),
    ]


def test_a_run_becomes_benchmarks(tmp_path: Any, capsys: Any) -> None:
    records = []
    for task, app in (("write_note", "mousepad"), ("rename_file", "thunar")):
        fields = {"apps": [app], "ended": "agent"}
        records += [
            made("oracle", task, "clean", 1.0, seed=3, **fields),
            made("oracle", task, "locked", 0.0, seed=3, **fields, **LOCK),
            made("oracle", task, "marks_s4", 1.0, seed=3, **fields),
        ]
    corruptions = ["clean", {"verification": {"as": "locked"}}, {"marks": {"as": "marks_s4"}}]
    settings = {"corruptions": corruptions, "max_steps": 30, "guard": "rules"}
    run = run_of(tmp_path / "run", records, **settings)
    main_code = main_exit(["mine", str(run), "-o", str(tmp_path / "lost")])
    assert main_code == 0
    printed = capsys.readouterr().out
    # Whether a picture was changed is in the steps, which are not there.
    assert "2 episodes lost of 2 disturbed; of 2 it is not known, because their" in printed
    assert "the run had --guard rules: give hijack bench the same again" in printed
    (file,) = (tmp_path / "lost").iterdir()
    text = file.read_text()
    assert text.startswith("# verification, ")
    assert "100 % of those" in text
    assert "\n# with hijack bench --guard rules\n" in text
    bench = load_bench(file)
    assert (bench.agents, bench.seeds, bench.max_steps) == (("oracle",), (3,), 30)
    assert bench.environment_errors == "after_setup", "as in runs that do not say it"
    assert set(bench.tasks) == {"write_note", "rename_file"}
    assert bench.planners == {"clean": None, "locked": hj.Verification()}
    assert main_exit(["mine", str(run), "-o", str(tmp_path / "lost")]) == 2


def test_options_of_machines_are_named_and_not_in_the_file(tmp_path: Any, capsys: Any) -> None:
    labels = (("clean", 1.0), ("locked", 0.0))
    records = [
        made("oracle", "write_note", label, score, effects=LOCK["effects"])
        for label, score in labels
    ]
    desktop = {"provider": "osworld", "size": [1920, 1080], "vm_options": {"region": "x"}}
    corruptions = ["clean", {"verification": {"as": "locked"}}]
    run = run_of(tmp_path / "run", records, corruptions=corruptions, desktop=desktop)
    assert main_exit(["mine", str(run), "-o", str(tmp_path / "lost")]) == 0
    assert "the run had --vm ... --vm-option region=x: give" in capsys.readouterr().out
    (file,) = (tmp_path / "lost").iterdir()
    assert "# with hijack bench --vm ... --vm-option region=x\n" in file.read_text()
    assert load_bench(file).provider == "osworld"


def test_a_run_without_a_configuration_is_refused(tmp_path: Any, capsys: Any) -> None:
    run = make_run(tmp_path / "run")
    assert main_exit(["mine", str(run), "-o", str(tmp_path / "lost")]) == 2
    assert "is the log of an environment" in capsys.readouterr().err


def main_exit(words: list[str]) -> Any:
    with pytest.raises(SystemExit) as end:
        main(words)
    return end.value.code
