"""Success by application: worked out by hand, in every form that shows it."""

import json

import pytest

pytest.importorskip("scipy", reason="needs the extra [online]")

from online_env.report import build_report, formats
from online_env.report.document import ReportDocument
from online_env.report.model import AppSuccess, from_data

from support.reported import made, read_run, scored

APPS = {"t0": ["geany"], "t1": ["geany"], "t2": ["chrome", "geany"], "t3": []}


def played(agent, label, scores, **more):
    """Records of t0, t1, ... in their applications."""
    return [
        made(agent, task, label, score, apps=apps, **more)
        for (task, apps), score in zip(APPS.items(), scores, strict=False)
    ]


@pytest.fixture
def report(tmp_path):
    items = [
        *played("b", "clean", [1, 1, 1, 0]),
        *played("b", "marks", [0, 1, 0.5, 0]),
        *played("b", "subtitle", [0, 0, 0, 1]),
        *played("a", "clean", [1, 0]),
    ]
    return build_report(read_run(tmp_path / "run", items))


def test_each_application_has_its_clean_and_its_corrupted_success(report):
    assert report.applications == (
        AppSuccess(agent="b", app="", tasks=1, clean=0.0, corrupted=0.5),
        AppSuccess(agent="b", app="geany", tasks=2, clean=1.0, corrupted=0.25),
        AppSuccess(agent="b", app="several", tasks=1, clean=1.0, corrupted=0.25),
        AppSuccess(agent="a", app="geany", tasks=2, clean=0.5, corrupted=None),
    )


def test_only_the_last_attempt_counts_and_nothing_that_is_invalid(tmp_path):
    (again,) = played("a", "clean", [1])
    items = [
        *played("a", "clean", [0, 1, 1]),
        again | {"attempt": 1, "id": again["id"] + "__a1"},
        *(record | {"status": "invalid", "score": None} for record in played("a", "marks", [1])),
    ]
    report = build_report(read_run(tmp_path / "run", items))
    assert [(row.app, row.clean, row.corrupted) for row in report.applications] == [
        ("geany", 1.0, None),
        ("several", 1.0, None),
    ]


def test_variants_are_one_task(tmp_path):
    values = [record for seed in range(3) for record in played("a", "clean", [1, 0, 1], seed=seed)]
    report = build_report(read_run(tmp_path / "run", values, seeds=[0, 1, 2]))
    assert [(row.app, row.tasks) for row in report.applications] == [("geany", 2), ("several", 1)]


@pytest.mark.parametrize(
    "found",
    [
        scored("a", "clean", [1, 0]),  # no record names an application
        [record | {"apps": ["geany"]} for record in scored("a", "clean", [1, 0])],
        [record | {"apps": "geany"} for record in scored("a", "clean", [1, 0])],  # an edited one
    ],
)
def test_with_one_application_there_is_no_table(found, tmp_path):
    report = build_report(read_run(tmp_path / "run", found))
    assert report.applications == ()
    for form in ("markdown", "html"):
        written = formats.write(ReportDocument(report=report), form)
        assert "By application" not in written


def test_every_form_that_shows_applications_shows_the_same(report):
    document = ReportDocument(report=report)
    lines = formats.write(document, "markdown").splitlines()
    start = lines.index("By application, clean → corrupted:")
    assert lines[start + 2 : start + 7] == [
        "| application | tasks | b, % | a, % |",
        "| --- | ---: | ---: | ---: |",
        "| none named | 1 | 0.0 → 50.0 |  |",
        "| geany | 2 | 100.0 → 25.0 | 50.0 |",
        "| several | 1 | 100.0 → 25.0 |  |",
    ]
    page = formats.write(document, "html")
    assert "<h2>By application</h2>" in page
    assert "<td>100.0 → 25.0</td><td>50.0</td>" in page


def test_a_report_keeps_its_applications(report):
    data = json.loads(json.dumps(report.to_data()))
    assert from_data(data, "r.json") == report
