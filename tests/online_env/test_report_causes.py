"""Why disturbed episodes were lost: each rule on an episode of its kind, and what is not explained."""

import json
from pathlib import Path

import pytest

pytest.importorskip("scipy", reason="needs the extra [online]")

import hijack_data as hj
from hijack_data.cli import main
from online_env.report import build_report, formats
from online_env.report.build import read_report
from online_env.report.causes import CAUSES, RULES
from online_env.report.document import ReportDocument
from online_env.report.model import DisturbedCount, LossCause, from_data

from support.reported import made, read_run

CLEAN_CODE = [f"pyautogui.click({100 * n}, 50)" for n in range(1, 5)] + ["DONE"]
SPRITE = {"draw": "window", "size": [300, 200]}
POP_UP = {"ops": [{"op": "paste", "sprite": SPRITE, "at": [[700, 500]]}]}
FAULT = {"step": 0, "probe": {"ok": True}}
OTHER = "pyautogui.click(900, 900)"


def locked(held=None, step=0):
    effect = {"step": step, "record": {"effect": "lock", "probes": [{"ok": True}]}}
    return [effect if held is None else {**effect, "held_at_end": held}]


def played(run_folder, label, code, score, lines=(), **more):
    """The record of an episode, whose steps are written; `lines` replaces fields by step."""
    record = made(
        "a",
        "t0",
        label,
        score,
        **{
            "steps": len(code),
            "malformed": 0,
            "apps": ["geany"],
            "ended": "agent",
            "effects": [],
            **more,
        },
    )
    folder = run_folder / "episodes" / record["id"]
    folder.mkdir(parents=True)
    steps = [
        {
            "step": step,
            "raw": value,
            "code": value,
            "error": None,
            "image_sha256": "a",
            "seen_sha256": "a",
        }
        for step, value in enumerate([*code, None])
    ]
    for step, fields in dict(lines).items():
        steps[step] |= fields
    (folder / "steps.jsonl").write_text("".join(f"{json.dumps(line)}\n" for line in steps))
    return record


def explained(tmp_path, code, lines=(), label="verification", steps=True, **more):
    """The row of the cause of an episode whose case was solved clean."""
    logged = tmp_path / "logged"
    records = [
        played(logged, "clean", CLEAN_CODE, 1.0),
        played(logged, label, code, more.pop("score", 0.0), lines, **more),
    ]
    run = read_run(tmp_path / "run", records)
    if steps:
        (logged / "episodes").rename(run.folder / "episodes")
    report = build_report(run, causes=True)
    assert [(row.n, row.disturbed, row.lost) for row in report.disturbed] == [(1, 1, 1)]
    (row,) = report.causes
    assert (row.agent, row.corruption, row.app, row.n) == ("a", label, "geany", 1)
    return row.cause, row.turns


def test_each_rule_explains_an_episode_of_its_kind(tmp_path):
    unread = {"error": "no such action"}
    entries = {"seen_sha256": "b"}
    request = {"policy": "repair", "requests": 1, "false_alarms": 0, "repaired": 1, "free": 0}
    helped = {"raw": "REINIT", "code": "REINIT", "result": {"helped": True}}
    vain = {**helped, "result": {"helped": False}}
    lock = {"effects": locked()}
    near = [f"pyautogui.click({100 * n + 7}, 46)" for n in range(1, 5)] + ["DONE"]
    pop_ups = {step: entries | {"plan": POP_UP} for step in range(5)}
    inside = [*CLEAN_CODE[:2], "pyautogui.click(800, 600)", *CLEAN_CODE[3:]]
    cases = {
        "failed": (CLEAN_CODE[:3], {}, {"effects": locked(), "score": None}, (2,)),
        "malformed": (["?"] * 5, {2: unread, 3: unread, 4: unread}, lock, (2,)),
        "wrong recovery": (inside, pop_ups, {"label": "pop_ups"}, (2,)),
        "recovered too late": (CLEAN_CODE, {2: helped}, lock | {"recovery": request}, (2,)),
        "never saw it": (near, {}, lock, (0,)),
        "stopped early": ([OTHER, "DONE"], {}, lock, (1,)),
        "saw it and went on": (
            [*CLEAN_CODE[:2], OTHER, *CLEAN_CODE],
            {},
            {"effects": locked(step=2)},
            (2,),
        ),
        "out of steps": ([OTHER] * 15, {}, lock | {"ended": "max_steps"}, (14,)),
        "unexplained": ([OTHER] * 6, {}, lock, ()),
    }
    assert set(cases) == set(CAUSES) == {*(rule.cause for rule in RULES), "unexplained"}
    page = (Path(__file__).resolve().parents[2] / "docs/reports.md").read_text()
    assert all(f"| {cause} |" in page for cause in CAUSES)
    for cause, (code, lines, more, turns) in cases.items():
        assert explained(tmp_path / cause, code, lines, **more) == (cause, turns)
    # a pop-up is only drawn, but a click where the agent clicks clean is not made on it
    on_target = {
        0: entries | {"plan": {"ops": [{"op": "paste", "sprite": SPRITE, "at": [[90, 40]]}]}}
    }
    requests = lock | {"recovery": request | {"policy": "none", "repaired": 0}}
    more_cases = {
        "never saw it": (CLEAN_CODE, on_target, {"label": "pop_ups"}, (0,)),
        "recovered too late": ([OTHER] * 6, {}, {"effects": locked(held=False)}, ()),
        "stopped early": (CLEAN_CODE[2:], {}, {"inputs": [FAULT]}, (2,)),
        "saw it and went on": ([OTHER] * 6, {3: vain}, requests, (3,)),
    }
    for cause, (code, lines, more, turns) in more_cases.items():
        assert explained(tmp_path / f"{cause} again", code, lines, **more) == (cause, turns)


def test_the_box_of_a_pop_up_is_read_as_it_is_planned():
    """The rule reads `size` and `at` of a window: so PopUps writes them."""
    plan = hj.PopUps().plan(hj.Scene((1080, 1920)), seed=0, sample="x", step=0).to_data()
    (paste,) = plan["ops"]
    (width, height), ((x, y),) = paste["sprite"]["size"], paste["at"]
    assert (paste["op"], paste["sprite"]["draw"]) == ("paste", "window")
    assert 0 <= x < x + width <= 1920
    assert 0 <= y < y + height <= 1080


def test_without_steps_only_records_explain_and_the_rest_is_unexplained(tmp_path):
    lock = {"effects": locked(), "steps": False}
    assert explained(tmp_path / "a", CLEAN_CODE, **lock) == ("unexplained", ())
    assert explained(tmp_path / "b", CLEAN_CODE[:2], **lock) == ("stopped early", (1,))
    drawn = made("a", "t0", "marks", 0.0, effects=[])
    late = made("a", "t0", "verification", 0.0, effects=[])  # ended before its effect was due
    run = read_run(tmp_path / "run", [made("a", "t0"), drawn, late])
    report = build_report(run, causes=True)
    assert report.disturbed == (DisturbedCount(agent="a", n=2, disturbed=0, unknown=1, lost=0),)
    assert report.causes == ()


def test_what_fails_clean_or_undisturbed_is_no_loss(tmp_path):
    effects = locked()
    records = [
        made("a", "t0", score=0.0),
        made("a", "t0", "verification", 0.0, effects=effects),
        made("a", "t1"),
        made("a", "t1", "verification", 1.0, effects=effects),
        made("a", "t2", "verification", 0.0, effects=effects),  # never played clean
        made("a", "t3"),
        made("a", "t3", "verification", 0.0, status="invalid", effects=effects),
    ]
    report = build_report(read_run(tmp_path / "run", records), causes=True)
    assert report.disturbed == (DisturbedCount(agent="a", n=3, disturbed=3, unknown=0, lost=0),)
    assert report.causes == ()
    assert build_report(read_run(tmp_path / "again", records)).disturbed == ()  # not asked for


def test_causes_are_in_the_forms_that_show_them(tmp_path):
    records = [
        record
        for task, app in (("t0", "geany"), ("t1", "chrome"))
        for record in (
            made("a", task, apps=[app]),
            made(
                "a", task, "verification", 0.0, apps=[app], effects=locked(), steps=2, ended="agent"
            ),
        )
    ]
    report = build_report(read_run(tmp_path / "run", records), causes=True)
    row = LossCause(
        agent="a", corruption="verification", app="geany", cause="stopped early", n=1, turns=(1,)
    )
    assert row in report.causes
    assert from_data(json.loads(json.dumps(report.to_data())), "again") == report
    document = ReportDocument(report=report, full=True)
    output = "a: 2 of 2 corrupted episodes were disturbed, and 2 of these scored less than clean."
    for name in ("terminal", "markdown", "html"):
        text = formats.write(document, name)
        assert output in text
        assert "stopped early" in text
    assert "| a | stopped early | 2 | 100.0 | 1 |" in formats.write(document, "markdown")
    for words, shows in (([], False), (["--full"], True)):
        file = tmp_path / f"{shows}.json"
        with pytest.raises(SystemExit):
            main(["report", str(tmp_path / "run"), "-o", str(file), *words])
        assert bool(read_report(file).causes) == shows
    assert "it ended with fewer actions than clean" in formats.write(document, "html")
