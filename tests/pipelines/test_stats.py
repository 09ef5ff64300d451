import html
import json
import re
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner

import hijack_data as hj
from hijack_data.cli import hijack
from pipelines import build, open_dataset
from pipelines.dataset.stats import BINS, LabelStats, percent_text, stats
from pipelines.dataset.stats_page import page
from pipelines.errors import DatasetError

PLANNERS: dict[str, Any] = {
    "cover": hj.PopUps(width=320, height=200, avoid_elements=False),
    "half": hj.Resolution(),
    "mild": hj.Marks.at(1, mark_size=5),
    "note": hj.Subtitle(subtitle_text="x", font_size=12, padding=2),
    "wide": hj.Subtitle(subtitle_text="W" * 300),
}


@pytest.fixture(params=["materialised", "lazy"])
def dataset(request: Any, recording: Any, add_line: Any, good_line: Any, tmp_path: Path) -> Path:
    source = recording(trajectories=3, steps=2)
    # hidden, partly hidden, visible
    for number, (x, y) in enumerate([(310, 190), (160, 110), (20, 20)]):
        point = {
            "action": {"type": "click", "x": x, "y": y},
            "target_box": [x - 20, y - 10, x + 10, y + 10],
        }
        add_line(source, good_line(f"<b>{number}", 0, image="images/t0-0.png", **point))
    add_line(
        source, good_line("w", 0, image="images/t0-0.png", action={"type": "wait"}, target_box=None)
    )
    add_line(source, b"rubbish")
    build(
        source,
        tmp_path / "out",
        corruptions=PLANNERS,
        output=request.param,
        rows_per_shard=17,
        seed=124,
    )
    return tmp_path / "out"


def test_figures_are_those_of_the_rows(dataset: Path) -> None:
    result = stats(dataset)
    rows = list(open_dataset(dataset))
    assert list(result.labels) == ["clean", *PLANNERS]
    assert result.rows == len(rows) == sum(data.rows for data in result.labels.values())
    assert (result.trajectories, result.steps, result.shards) == (
        7,
        10,
        len(list((dataset / "data").iterdir())),
    )
    assert result.bytes == sum(file.stat().st_size for file in (dataset / "data").iterdir())
    for label, data in result.labels.items():
        label_rows = [row for row in rows if row["corruption"] == label]
        shares = [row["target_visible"] for row in label_rows if row["target_visible"] is not None]
        figures = data.to_data()
        assert figures["rows"] == len(label_rows)
        assert figures["target_visible"]["all of it"] == shares.count(1.0)
        assert figures["target_visible"]["none"] == shares.count(0.0)
        assert sum(figures["target_visible"].values()) == len(shares)
        assert figures["without_target"] == len(label_rows) - len(shares)
        changed_shares = sorted(
            row["changed_pixels"] / (row["width"] * row["height"]) for row in label_rows
        )
        if label_rows:
            assert figures["fidelity"] == {"exact": len(label_rows)}
            assert figures["source"] == {"jsonl": len(label_rows)}
            assert (figures["changed"]["min"], figures["changed"]["max"]) == pytest.approx(
                (changed_shares[0], changed_shares[-1])
            )
    cover = result.labels["cover"].to_data()["target_visible"]
    assert (cover["none"], cover["50 to 75 %"]) == (1, 1)
    assert result.labels["mild"].to_data()["severity"] == {"None": 10}
    assert result.to_data()["not_applicable"]["wide"]
    assert result.to_data()["rejected"] == {"(record)": 1}


@pytest.mark.parametrize(
    ("share", "name"),
    [
        (0.0, "none"),
        (1e-9, "under 25 %"),
        (0.25, "25 to 50 %"),
        (0.5, "50 to 75 %"),
        (0.75, "75 to 100 %"),
        (1 - 1e-9, "75 to 100 %"),
        (1.0, "all of it"),
    ],
)
def test_bins_of_visibility(share: float, name: str) -> None:
    label_stats = LabelStats()
    row = {
        "fidelity": "exact",
        "severity": 3,
        "source": "x",
        "changed_pixels": 1,
        "width": 2,
        "height": 2,
    }
    label_stats.add(
        {**row, "target_visible": share, "event": None, "reminder": None, "inserted": False}
    )
    assert [BINS[k] for k, count in enumerate(label_stats.visible) if count] == [name]
    assert label_stats.to_data()["changed"] == {"min": 0.25, "median": 0.25, "max": 0.25}
    assert label_stats.to_data()["severity"] == {"3": 1}


def test_the_page_stands_by_itself(dataset: Path) -> None:
    text = page(dataset, stats(dataset))
    assert page(dataset, stats(dataset)) == text
    assert not re.search(r"(?:src|href)=[\"'](?!data:)", text)
    assert "<script" not in text
    assert "<b>" not in text
    assert "&lt;b&gt;" in text
    assert text.count('<div class="pair">') == 3 * 4
    assert text.count("<figure>") == 2 * 3 * 4
    assert len(re.findall(r"\d+ pixels changed, \d+ % of the target shows", text)) >= 9
    assert text.count("<tr>") == 1 + 6


def test_the_page_of_a_dataset_without_clean_rows(recording: Any, tmp_path: Path) -> None:
    for output, figures in (("materialised", 3), ("lazy", 6)):
        out = tmp_path / output
        build(
            recording(output + "-source"),
            out,
            corruptions={"half": hj.Resolution()},
            clean=False,
            output=output,
        )
        assert page(out, stats(out)).count("<figure>") == figures


def test_the_command(dataset: Path, tmp_path: Path) -> None:
    run = CliRunner().invoke(hijack, ["stats", str(dataset), "-o", str(tmp_path / "s.html")])
    assert run.exit_code == 0, run.output
    assert "wide: not applicable to 10 steps" in run.output
    assert re.search(r"cover\s.*\b10\b", run.output)
    assert "target shows" in run.output
    assert (tmp_path / "s.html").read_text().startswith("<!doctype html>")
    data = json.loads(CliRunner().invoke(hijack, ["stats", str(dataset), "--json"]).output)
    assert data == json.loads(json.dumps(stats(dataset).to_data()))
    assert data["corruptions"]["half"]["rows"] == 10


def test_what_is_no_dataset(dataset: Path, tmp_path: Path) -> None:
    with pytest.raises(DatasetError, match="not a dataset"):
        stats(tmp_path)
    (dataset / "data" / "train-00000.parquet").write_bytes(b"PAR1")
    with pytest.raises(DatasetError, match="cannot be read"):
        stats(dataset)


def test_the_page_shows_what_is_hidden_and_what_has_no_target(dataset: Path) -> None:
    text = page(dataset, stats(dataset))
    rows = {row["id"]: row for row in open_dataset(dataset)}
    covered = [
        row
        for row in rows.values()
        if row["corruption"] == "cover" and row["target_visible"] is not None
    ]
    worst = min(covered, key=lambda row: row["target_visible"])
    section = text[text.index("<h2>cover</h2>") :].partition("</section>")[0]
    assert section.index(f"{html.escape(worst['id'])}</p>") == section.index('class="id">') + len(
        'class="id">'
    )
    assert '<span class="chip hidden">0 % shows</span>' in section
    assert 'title="no target: 1"' in text
    assert "all pixels, resized to 160×100" in text
    assert re.search(r"<li>\d{1,3},\d{3} pixels changed", text)
    assert "None" not in re.sub(r"data:[^\"]*", "", text)
    assert "(s)" not in text


@pytest.mark.parametrize(
    ("share", "text"),
    [
        (0.0, "0 %"),
        (0.003, "under 1 %"),
        (0.4996, "49 %"),
        (0.29, "29 %"),
        (0.998, "99 %"),
        (1.0, "100 %"),
    ],
)
def test_a_part_of_a_target_is_neither_none_nor_all_of_it(share: float, text: str) -> None:
    assert percent_text(share) == text
