"""The site: what it says is so, every public name is on it, and its code runs."""

import json
import re
import subprocess
import sys
from pathlib import Path

import pytest

import hijack_data as hj
import pipelines

ROOT = Path(__file__).resolve().parent.parent
HERE = ROOT / "docs" / "site"
sys.path.insert(0, str(HERE))  # before a package of the same name

copied = pytest.importorskip("copied")
charts = pytest.importorskip("charts")
corruption_pages = pytest.importorskip("corruption_pages")
reference = pytest.importorskip("reference")
tables = pytest.importorskip("tables")
notebooks = pytest.importorskip("notebooks")
results = pytest.importorskip("results")
make = pytest.importorskip("make")

NINE = hj.corruption_names()[:9]
MKDOCS = (ROOT / "mkdocs.yml").read_text()


def documented() -> set[str]:
    """Every name of the reference."""
    return {name for page in reference.pages().values() for name in reference.names(page)}


def test_every_public_name_is_in_the_reference():
    import online_env

    expected = {f"hijack_data.{home}.{name}" for home, names in hj._HOMES.items() for name in names}
    result = documented()
    short = {f"hijack_data.{name.rpartition('.')[2]}" for name in expected}
    assert short <= result
    assert {f"pipelines.{name}" for name in pipelines.__all__} <= result
    assert {f"online_env.{name}" for name in online_env._HOMES} <= result


@pytest.mark.parametrize("name", NINE)
def test_the_page_of_a_corruption_says_what_the_corruption_says(name: str, tmp_path: Path):
    page = corruption_pages.page(name, tmp_path)
    from hijack_data import params

    cls = type(hj.make_corruption(name))
    for key, (parameter, _) in params.parameters(cls).items():
        assert f"| `{key}` |" in page
        assert parameter.doc in page
    assert cls.summary() in page
    assert cls.paper in page
    assert ("no levels" in page) == (not cls.severities)
    for title in ("Severity", "In a recording, and live", "Code", "Seeds", "Measured"):
        assert f"## {title}" in page
    for language in ("torch", "JAX and Grain"):
        assert f'=== "{language}"' in page


def test_the_texts_are_of_the_nine():
    assert list(corruption_pages.TEXTS) == NINE
    assert {tuple(words) for words in corruption_pages.TEXTS.values()} == {
        ("title", "why", "offline", "live")
    }
    assert list(tables.paper()[0]) == ["agent", "clean", *NINE]


# Runs every name and every block in one process, since what takes time is to import the frameworks.
RUNNER = """
import importlib, inspect, json, sys, traceback


def main():
    order, found = json.load(open("order.json")), {}
    for name in order["names"]:
        module, _, last = name.rpartition(".")
        thing = getattr(importlib.import_module(module), last)
        found[name] = "" if inspect.getdoc(thing) else "no docstring"
    for title, code in order["blocks"].items():
        try:
            exec(code, {})
            found[title] = ""
        except Exception:
            found[title] = traceback.format_exc()
    json.dump(found, open("found.json", "w"))


if __name__ == "__main__":
    main()
"""


@pytest.fixture(scope="module")
def ran(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """What was wrong with each documented name and each block; empty where nothing was."""
    for module, extra in (("gymnasium", "online"), ("torch", "torch"), ("grain", "jax")):
        pytest.importorskip(module, reason=f"needs the extra [{extra}]; make env")
    folder = tmp_path_factory.mktemp("site")
    (folder / "examples").symlink_to(ROOT / "examples")
    all_blocks = list(corruption_pages.blocks())
    charted_names = {name for name, title, _ in all_blocks if title == "NumPy"}
    # One of the corruptions of the machine stands for all: their code differs in the name alone.
    values = {*charted_names, "verification"}
    blocks = {f"{name}, {title}": code for name, title, code in all_blocks if name in values}
    order = {"names": sorted(documented()), "blocks": blocks}
    (folder / "order.json").write_text(json.dumps(order))
    (folder / "run.py").write_text(RUNNER)
    process = subprocess.run(
        [sys.executable, "run.py"],
        cwd=folder,
        capture_output=True,
        text=True,
        timeout=400,
        check=False,
    )
    assert process.returncode == 0, process.stderr
    return json.loads((folder / "found.json").read_text())


def test_every_name_of_the_reference_is_documented(ran: dict[str, str]):
    assert {name: ran[name] for name in documented() if ran[name]} == {}


def test_code_of_the_pages_runs(ran: dict[str, str]):
    blocks = {title: output for title, output in ran.items() if ", " in title}
    for title in ("marks, NumPy", "marks, torch", "marks, JAX and Grain", "verification, torch"):
        assert title in blocks
    assert {title: output for title, output in blocks.items() if output} == {}


def test_charts_are_made_of_the_tables():
    page = charts.page()
    assert page.count('<figure class="chart') >= 9
    # A theme may turn light and dark round: colours are named by swatches, not by words.
    assert not re.search("darker|lighter|brighter", page)
    assert "24.21 %" in page
    (row,) = [
        row
        for row in tables.table("Severity levels, measured", "target hidden").rows
        if (row["corruption"], row["level"]) == ("pop_ups", "5")
    ]
    assert f"{tables.number(row['target hidden']):g} %" in charts.hidden_targets()
    with pytest.raises(tables.NoTable, match="no section 'None'"):
        tables.table("None", "x")
    with pytest.raises(tables.NoTable, match="no table with the columns x"):
        tables.table("Severity levels, measured", "x")


def test_tables_are_read_as_they_stand():
    text = "said\n\n| a | b |\n|---|---|\n| 1 | 2x |\n\nmore\n| c |\n| - |\n| 3 |\n"
    first, second = tables.tables(text)
    assert (first.said, first.rows) == ("said", [{"a": "1", "b": "2x"}])
    assert (second.said, second.rows) == ("more", [{"c": "3"}])
    assert tables.number("1,234.5 / 7 ms") == 1234.5
    assert tables.number("-2.2 (-3.7 to -0.7)") == -2.2
    with pytest.raises(tables.NoTable, match="holds no number"):
        tables.number("needs KVM")


def test_links_that_leave_the_site_become_names(tmp_path: Path):
    page = ROOT / "docs" / "made_up.md"
    site = {"docs/a.md": "a.md", "benchmarks/RESULTS.md": "results.md"}
    links = {
        "[A](a.md#x)": "[A](a.md#x)",
        "[R](../benchmarks/RESULTS.md)": "[R](results.md)",
        "[c](../configs/x.yaml)": "c (`configs/x.yaml`)",
        "[`c`](../configs/x.yaml)": "`c`",
        "![p](images/p.svg)": "![p](images/p.svg)",
        "[o](https://example.org)": "[o](https://example.org)",
        "[h](#here)": "[h](#here)",
    }
    for link, expected in links.items():
        file = tmp_path / "page.md"
        file.write_text(link)
        result = copied._LINK.sub(lambda match: copied._link(match, page, site), link)
        assert result == expected


def test_fences_lose_the_words_for_tests(tmp_path: Path):
    file = tmp_path / "page.md"
    file.write_text("```sh no-run it [takes](hours.md)\nx [a](b.md)\n```\n")
    assert copied.text_of(file, {}) == "```sh\nx [a](b.md)\n```\n"


def test_a_bar_in_the_code_of_a_table_is_no_backslash(tmp_path: Path):
    file = tmp_path / "page.md"
    file.write_text("| `a\\|b` | c \\| d |\n\n```console\nx \\| y\n```\n")
    assert copied.text_of(file, {}) == "| `a|b` | c \\| d |\n\n```sh\nx \\| y\n```\n"


def test_the_page_to_try_knows_which_pictures_are_not_there(tmp_path: Path):
    pictures = pytest.importorskip("pictures")
    result = pictures.file_name("marks", pictures.SCREENS[1], level=5, seed=1)
    (tmp_path / result).parent.mkdir()
    (tmp_path / result).touch()
    page = corruption_pages.try_page(tmp_path)
    (data,) = re.findall(r'id="choices">(.*)</script>', page)
    choices = json.loads(data)
    small = {file for file, *_ in pictures.wanted() if "level" in file}
    assert {file for choice in choices.values() for file in choice["missing"]} == small - {result}
    assert choices["marks"]["levels"] == [1, 2, 3, 4, 5]
    assert choices["verification"]["levels"] == [3]
    assert "{{" not in page


def test_the_suite_has_a_search_and_shows_each_screen_once():
    result = copied.searchable_suite((ROOT / "docs" / "suite.md").read_text())
    assert result.index('<input type="search"') < result.index("| domain | tasks |")
    value = re.findall(r"\]\((images/suite/[^)]+)\)", result)
    assert len({(ROOT / "docs" / file).read_bytes() for file in value}) == len(value) > 50


def test_every_page_has_its_place(tmp_path: Path):
    texts = make.all_pages(tmp_path)
    nav = str(make.settings(texts)["nav"])
    assert [name for name in texts if f"'{name}'" not in nav] == []
    values = {f"{name}.md" for names in make.SECTIONS.values() for name in names}
    assert values <= set(texts), "a section names a page that is not there"


def test_bars_of_negative_values_end_at_zero_and_colours_have_a_legend():
    bars = [charts.Bar("gain", 3.0, "+3", strong=True), charts.Bar("loss", -1.0, "-1")]
    svg = charts.chart("x", bars, legend=charts.Legend("gain", "loss"))
    assert re.findall(r"margin-left:(.*?)%;width:(.*?)%", svg) == [
        ("25.0", "75.0"),
        ("0.0", "25.0"),
    ]
    assert svg.count('style="--zero:25.0%"') == 2
    assert '<span class="key strong"><i></i>gain</span><span class="key"><i></i>loss</span>' in svg
    with pytest.raises(ValueError, match="two colours and no legend"):
        charts.chart("x", bars)


def test_a_report_is_all_that_a_result_needs(tmp_path: Path):
    from online_env.report.build import build_report
    from online_env.results import reading

    from support.reported import CONDITIONS, run_of, whole

    assert "No run of a whole agent" in results.pages(tmp_path)["results/leaderboard.md"]
    assert results.files(tmp_path) == {}
    value = whole("good", dict.fromkeys(CONDITIONS, 9)) + whole("bad", dict.fromkeys(CONDITIONS, 2))
    report = build_report(reading.read(run_of(tmp_path / "run", value)))
    path = tmp_path / "results" / "two_agents"
    path.mkdir(parents=True)
    (path / "report.json").write_text(json.dumps(report.to_data()))
    about = (
        "Made for a test.\n\n```sh no-run\nls\n```\n\n![p](p.svg) [q](../q.md#r) [h](https://h/)\n"
    )
    (path / "about.md").write_text(about)
    pages = results.pages(path.parent)
    assert "[Two agents](two_agents.md) | 200 live episodes" in pages["results/index.md"]
    result = pages["results/two_agents.md"]
    assert "Made for a test.\n\n```sh\nls\n```\n" in result
    assert "![p](two_agents/p.svg) [q](q.md#r) [h](https://h/)" in result
    assert result.count('<figure class="chart">') == 2
    assert "| `good` | 90.0 % | 100.0 % |" in result
    (path / "about.md").write_text("# Two agents without a model\n\n" + about)
    pages = results.pages(path.parent)
    assert "[Two agents without a model](two_agents.md) |" in pages["results/index.md"]
    assert pages["results/two_agents.md"].count("\n# ") == 0
    assert pages["results/two_agents.md"].startswith("# Two agents without a model\n\nMade for a")
    board = pages["results/leaderboard.md"]
    text = "instruction and pictures"
    assert f"| 1 of 2 | `good` | {text} | small | 90.0 % | 90.0 % | 100.0 % |\n" in board
    assert f"| 2 of 2 | `bad` | {text} | small | 20.0 % |" in board
    files = results.files(path.parent)
    assert set(files) == {"results/two_agents/report.html", "results/board.html"}
    assert "good" in files["results/board.html"]


def test_no_page_asks_another_host():
    """The theme's plug-in for sites on a disk adds a script from another host unless it is here."""
    (script,) = re.findall(r"polyfills: \[theme/(\S*iframe-worker\S*)\]", MKDOCS)
    for name in (script, "site.js", "site.css"):
        assert "http" not in (HERE / "theme" / name).read_text()
    assert "font: false" in MKDOCS


def test_notebooks_are_pages_with_what_they_show(tmp_path: Path):
    pages = notebooks.pages(tmp_path)
    assert len(pages) == 4
    for name, text in pages.items():
        pictures = re.findall(r"!\[[^\]]*\]\(\.\./pictures/([^)]+)\)", text)
        assert pictures, f"{name}: run examples/notebooks/run.py"
        assert all((tmp_path / picture).stat().st_size < 60_000 for picture in pictures)
        assert "../../docs" not in text


def test_messages_in_troubleshooting_are_printed_by_the_program():
    page = (ROOT / "docs" / "troubleshooting.md").read_text()
    quoted = re.findall(r"^### `([^`]+)`$", page, re.M)
    assert len(quoted) > 12
    packages = ("hijack_data", "pipelines", "online_env")
    files = [path for name in packages for path in (ROOT / name).rglob("*.py")]
    source = "\n".join(path.read_text() for path in [*files, ROOT / "Makefile"])
    joined = re.sub(r'"\s*\n\s*f?"', "", source)  # texts that go over several lines
    assert [text for text in quoted if text not in joined] == []
