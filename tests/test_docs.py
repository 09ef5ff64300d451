"""The documentation is true: what it prints runs as pasted, or says why it does not, and then could
run."""

import re
import runpy
import subprocess
import sys
from functools import cache
from importlib import import_module as load_module
from pathlib import Path

import pytest
import yaml

from hijack_data.config import load_config

from support.commands import of_hijack, problem
from support.docs import (
    ACTIVATE,
    KINDS,
    NO_RUN,
    OTHER,
    PAGES,
    PYTHON,
    ROOT,
    RUN,
    SHELL,
    TESTED_IN,
    blocks_of,
    clone,
    pages_with,
    prepared,
    python_blocks,
    run_python,
)
from support.pasting import Terminal

ALL = [block for page in PAGES for block in blocks_of(page)]
YAML = [block for block in ALL if block.language == "yaml"]
COMMANDS = [block for block in ALL if block.language in SHELL]


@pytest.mark.parametrize("block", list(python_blocks(RUN)))
def test_python_blocks_run(block, tmp_path):
    run_python(block.text, tmp_path)


@pytest.mark.parametrize("page", pages_with(RUN), ids=lambda page: page.name)
def test_commands_work_as_pasted(page, tmp_path):
    """The blocks of a page in their order, from the root of a clone, after `make env`."""
    blocks = [block for block in blocks_of(page) if block.language in SHELL and block.kind == RUN]
    if any("--engine ray" in block.text for block in blocks):
        pytest.importorskip(
            "ray", reason="needs the extra [ray]; .venv/bin/pip install -e '.[ray]'"
        )
    Terminal(prepared(clone(tmp_path))).paste(blocks)


@pytest.mark.parametrize("block", ALL, ids=lambda block: block.name)
def test_every_block_says_what_it_is(block):
    assert "`" not in block.kind + block.words, "a fence whose words hold a backtick is none"
    assert block.language in (*SHELL, *PYTHON, *OTHER), (
        f"```{block.language}: which language is it?"
    )
    if block.language not in OTHER:
        assert block.kind in KINDS, f"```{block.language} {block.kind}: one of {KINDS[1:]}"
        assert bool(block.words) == (block.kind in (NO_RUN, TESTED_IN)), (
            "why is it not run, or where?"
        )
        return
    started = r"\s*(\$ |sudo |hijack |\.venv/|make |pip |python3? |apt-get )"
    commands = [line for line in block.text.splitlines() if re.match(started, line)]
    assert commands == [], "a command stands in a block of shell commands"


@pytest.mark.parametrize("block", COMMANDS, ids=lambda block: block.name)
def test_every_command_could_run(block):
    assert block.lines
    assert {line: result for line in block.lines if (result := problem(line))} == {}


@pytest.mark.parametrize(
    "block", [b for b in ALL if b.kind == TESTED_IN], ids=lambda block: block.name
)
def test_what_is_run_elsewhere_is_run_there(block):
    text = (ROOT / block.words).read_text()
    if block.words.endswith(".py"):
        assert block.page.name in text, f"{block.words} does not read {block.page.name}"
        return
    assert [line for line in block.lines if line not in text] == []


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_a_page_makes_the_environment_active_before_it_uses_it(page):
    lines = [line for block in blocks_of(page) if block.language in SHELL for line in block.lines]
    ours = [line for line in lines if re.match(r"(hijack|python|pip)\b", line)]
    if ours:
        assert ACTIVATE in lines[: lines.index(ours[0])], (
            f"{ours[0]}: pasted after `make env`, it is not found"
        )


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_commands_in_the_text_exist(page):
    prose = re.sub(r"^( *)```.*?^\1```", "", page.read_text(), flags=re.S | re.M)
    named = re.findall(r"`(?:sudo )?(?:\.venv/bin/)?hijack ([^`]+)`", prose)
    wrong = {words: value for words in named if (value := of_hijack(words.split()))}
    assert wrong == {}
    # Python of a virtual environment is not root's: sudo would not find it.
    assert "sudo hijack" not in page.read_text()


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("hijack bild x", "no command 'bild'"),
        ("hijack build x --ot y", "hijack build has no --ot"),
        ("hijack desktop upp", "no command 'upp'"),
        ("sudo .venv/bin/hijack desktop record --asets x", "hijack record has no --asets"),
        (
            "hijack bench configs/benchmark/none.yaml",
            "no configs/benchmark/none.yaml in the repository",
        ),
        ("make dem", "no target ['dem']"),
        ("python benchmarks/none.py", "no file ['benchmarks/none.py']"),
        (
            "python -m online_env.embedded.sites --stat x",
            "online_env.embedded.sites has no ['--stat']",
        ),
        ("hijak list", "what is 'hijak'?"),
        ("hijack osworld prefetch TASKS --out cache [--only ID] [--dry-run]", ""),
        ("hijack build recordings --no-clean -h", ""),
    ],
)
def test_a_broken_command_is_found(line, words):
    assert problem(line).startswith(words)
    assert bool(problem(line)) == bool(words)


@pytest.mark.parametrize("block", YAML, ids=lambda block: block.name)
def test_configurations_are_valid(block, tmp_path):
    """Those of a benchmark name agents, and agents have files; both live with the extra `online`."""
    file = tmp_path / "shown.yaml"
    file.write_text(block.text)
    if block.page.name == "benchmark.md":
        pytest.importorskip("gymnasium", reason="needs the extra [online]")
        assert load_module("online_env.bench.config").load_bench(file).planners
    elif block.page.name == "score_my_model.md":
        pytest.importorskip("gymnasium", reason="needs the extra [online]")
        assert load_module("online_env.agents.agent_files").read_agent(str(file)).model.model
    elif block.page.name == "pull_requests.md":  # a workflow that uses our action
        jobs = yaml.safe_load(block.text)["jobs"].values()
        steps = [step for job in jobs for step in job["steps"] if "OWNER/" in step.get("uses", "")]
        for step in steps:
            action_path = step["uses"].partition("/agenthijack/")[2].partition("@")[0]
            action = yaml.safe_load((ROOT / action_path / "action.yml").read_text())
            assert set(step["with"]) <= set(action["inputs"])
        assert steps
    else:
        assert load_config(file).corruptions


def test_nothing_that_is_printed_asks_sudo_for_a_program_it_does_not_find():
    packages = ("hijack_data", "pipelines", "online_env")
    files = [path for name in packages for path in (ROOT / name).rglob("*.py")]
    assert [path for path in files if "sudo hijack" in path.read_text()] == []


def test_the_reference_page_is_the_registry():
    command = [sys.executable, "-m", "hijack_data.cli", "list", "--markdown"]
    stdout = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    assert (ROOT / "docs" / "corruptions.md").read_text() == stdout, (
        "run: hijack list --markdown > docs/corruptions.md"
    )


@pytest.mark.parametrize(
    "page", PAGES + [ROOT / n for n in ("ARCHITECTURE.md", "CONTRIBUTING.md")], ids=lambda p: p.name
)
def test_links_lead_somewhere(page):
    for target in re.findall(r"\]\(([^)\s]+)\)", page.read_text()):
        name, _, anchor = target.partition("#")
        file = page.parent / name if name else page
        assert "://" in target or file.exists(), f"{page.name} links to {target}: no such file"
        if anchor and file.suffix == ".md" and "://" not in target:
            assert anchor in list_anchors(file), f"{page.name} links to {target}: no such heading"


@cache
def list_anchors(page: Path) -> set[str]:
    """Return the anchors of a page's headings, as GitHub names them."""
    anchors: set[str] = set()
    text = re.sub(r"^```.*?^```", "", page.read_text(), flags=re.DOTALL | re.MULTILINE)
    for title in re.findall(r"^#+ +(.*)", text, re.MULTILINE):
        words = re.sub(r"\[(.*?)\]\(.*?\)", r"\1", title).lower()
        anchor = re.sub(r"[^\w -]", "", words).replace(" ", "-")
        number = sum(re.sub(r"-\d+$", "", other) == anchor for other in anchors)
        anchors.add(f"{anchor}-{number}" if number else anchor)
    return anchors


def test_every_table_of_the_results_has_a_script():
    """`benchmarks/run.py` writes the page anew and keeps the sections that it knows."""
    run = runpy.run_path(str(ROOT / "benchmarks" / "run.py"))
    page = (ROOT / "benchmarks" / "RESULTS.md").read_text()
    titles = re.findall(r"^## (.*)$", page, re.MULTILINE)
    assert set(titles) <= set(run["SCRIPTS"].values())
    for name in run["SCRIPTS"]:
        assert (ROOT / "benchmarks" / f"{name}.py").is_file()
