"""Make the site: `python docs/site/make.py`, or `make docs`.

It writes the pages and their pictures into build/pages, then has MkDocs make build/site of them. A
broken link, a missing anchor or a name without documentation is an error.
"""

import argparse
import os
import shutil
import subprocess
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import charts
import copied
import corruption_pages
import notebooks
import pictures
import reference
import results
import tables
import yaml

import hijack_data as hj
from hijack_data.gallery import gallery

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
PAGES = ROOT / "build" / "pages"
SETTINGS = ROOT / "build" / "mkdocs.yml"
# What stands where; a page of docs/ that is in no section is under "More".
SECTIONS: dict[str, tuple[str, ...]] = {
    "Start": ("install", "start", "concepts", "command_line", "troubleshooting", "comparison"),
    "Datasets": (
        "datasets",
        "sources",
        "input_format",
        "howto_osworld_runs",
        "composites",
        "onlooker_data",
        "configuration",
        "view",
        "verify_runs",
        "clusters",
    ),
    "Training": ("training", "labels", "coordinates", "train", "serve", "proof"),
    "Scoring": (
        "score_my_agent",
        "score_my_model",
        "guards",
        "mcp",
        "offline_scoring",
        "benchmark",
        "suite",
        "reports",
        "results_of_others",
        "certificate",
        "search",
        "pull_requests",
        "write_a_task",
    ),
    "Results": (
        "results/index",
        "results/leaderboard",
        "paper_results",
        "results/da_grpo",
        "results/desktop_training",
    ),
    "Live": (
        "live_evaluation",
        "embedded_desktop",
        "effects",
        "everyday",
        "security",
        "local_internet",
        "bring_your_own_vm",
        "browser",
        "browser_dom",
        "osworld",
        "osworld_vm",
        "recordings",
    ),
    "Project": (
        "figures",
        "results",
        "write_a_corruption",
        "architecture",
        "contributing",
        "changelog",
    ),
}

# How much more a page counts in the search than others.
SEARCH = {
    **dict.fromkeys(("install.md", "troubleshooting.md"), 2),
    **dict.fromkeys(("concepts.md", "start.md"), 2),
    **dict.fromkeys(("training.md", "score_my_model.md", "score_my_agent.md"), 2),
    **dict.fromkeys(("architecture.md", "changelog.md", "results.md"), 0.5),
}
NOTEBOOKS = ("datasets", "torch_training", "jax_grain", "live_agent")


def main() -> None:
    """Make the pages, then the site."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--pages-only", action="store_true", help="stop before MkDocs")
    only_pages = parser.parse_args().pages_only
    written = write_pages()
    print(f"{PAGES.relative_to(ROOT)}: {written} pages", flush=True)
    if only_pages:
        return
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "-f", str(SETTINGS)]
    # The theme prints an advertisement for its successor into every log.
    place = os.environ | {"NO_MKDOCS_2_WARNING": "1"}
    process = subprocess.run(command, cwd=ROOT, env=place, check=False)
    if process.returncode:
        sys.exit(process.returncode)
    count = len(list((ROOT / "build" / "site").rglob("*.html")))
    print(f"build/site: {count} pages, no broken link; open build/site/index.html")


def write_pages() -> int:
    """Write every page, the pictures and the settings; returns the number of pages."""
    shutil.rmtree(PAGES, ignore_errors=True)
    folder = PAGES / "pictures"
    for problem in pictures.make(folder):
        print(f"left out: {problem}")
    result = gallery(
        [pictures.RECORDED / f"{name}.png" for name in pictures.SCREENS], embed_width=960
    )
    (folder / "gallery.html").write_text(result.html, encoding="utf-8")
    shutil.copytree(ROOT / "docs" / "images", PAGES / "images")
    shutil.copytree(
        results.RESULTS, PAGES / "results", ignore=shutil.ignore_patterns("*.md", "run")
    )
    shutil.copytree(HERE / "theme", PAGES / "theme")
    texts = all_pages(folder)
    for name, text in (texts | results.files()).items():
        path = PAGES / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
    SETTINGS.write_text(yaml.safe_dump(settings(texts), sort_keys=False), encoding="utf-8")
    return len(texts)


def all_pages(folder: Path) -> dict[str, str]:
    """The text of every page, by file; `folder` holds the pictures."""
    files = copied.pages()
    site = {path.relative_to(ROOT).as_posix(): name for name, path in files.items()}
    site["README.md"] = "index.md"
    site |= notebooks.places()
    texts = {name: copied.text_of(path, site) for name, path in files.items()}
    landing = (HERE / "landing.md").read_text(encoding="utf-8")
    texts["index.md"] = landing.replace("{{ chart }}", charts.success("UI-TARS-1.5-7B"))
    texts["gallery.md"] = (HERE / "gallery.md").read_text(encoding="utf-8")
    texts["try.md"] = corruption_pages.try_page(folder)
    texts["verify_runs.md"] = texts["verify_runs.md"].replace(
        "<!-- every field -->", tables.fields_of_a_run()
    )
    texts["suite.md"] = copied.searchable_suite(texts["suite.md"])
    texts["figures.md"] = charts.page()
    texts["paper_results.md"] = charts.results_of_the_paper()
    texts |= results.pages() | notebooks.pages(folder)
    for name in hj.corruption_names()[:9]:
        texts[f"corruptions/{name}.md"] = corruption_pages.page(name, folder)
    return ranked(texts | reference.pages())


def ranked(texts: dict[str, str]) -> dict[str, str]:
    """The pages, with what the search puts first: answers before the reference."""
    entries = dict(texts)
    for name, text in texts.items():
        boost = SEARCH.get(name, 0.5 if name.startswith("reference/") else 1)
        if boost != 1:
            entries[name] = f"---\nsearch:\n  boost: {boost}\n---\n\n{text}"
    return entries


def settings(texts: Iterable[str]) -> dict[str, Any]:
    """The settings of this build: those of mkdocs.yml, and where every page stands."""
    result = set(texts)
    nine = [f"corruptions/{name}.md" for name in hj.corruption_names()[:9]]
    api = sorted(name for name in result if name.startswith("reference/"))
    nav: list[Any] = [{"Home": "index.md"}]
    sections = {
        title: [f"{name}.md" for name in names if f"{name}.md" in result]
        for title, names in SECTIONS.items()
    }
    corruptions: list[Any] = ["gallery.md", "try.md"]
    corruptions += [{corruption_pages.TEXTS[Path(name).stem]["title"]: name} for name in nine]
    corruptions.append({"All parameters": "corruptions.md"})
    books = [f"notebooks/{name}.md" for name in NOTEBOOKS]
    project = sections.pop("Project")
    for title, names in sections.items():
        if title == "Results":
            names += sorted({name for name in result if name.startswith("results/")} - {*names})
        nav.append({title: names})
        if title == "Start":
            nav[-1] = {title: [*names, {"Notebooks": books}]}
            nav.append({"Corruptions": corruptions})
    nav.append({"Reference": api})
    placed = {*books, *nine, *api, *project, "index.md", "gallery.md", "try.md", "corruptions.md"}
    placed |= {name for names in sections.values() for name in names}
    nav.append({"Project": [*project, *sorted(result - placed)]})
    return {"INHERIT": "../mkdocs.yml", "docs_dir": "pages", "site_dir": "site", "nav": nav}


if __name__ == "__main__":
    main()
