"""The documentation is true: every Python block runs, every command works, the reference page is the registry's."""

import re
import shlex
import subprocess
import sys

import pytest

from support.docs import PAGES, ROOT, blocks, prepared, run_python


@pytest.mark.parametrize("code", list(blocks("python")))
def test_python_blocks_run(code, tmp_path):
    run_python(code, tmp_path)


@pytest.mark.parametrize("text", list(blocks("console")))
def test_commands_work(text, tmp_path):
    """Run the block's `hijack` lines in order; `make` and `pip` lines are what runs this suite."""
    folder = prepared(tmp_path)
    for line in text.splitlines():
        words = shlex.split(line, comments=True)
        if not words or words[0] != "hijack":
            continue
        words = [w for word in words[1:] for w in (sorted(map(str, folder.glob(word))) if "*" in word else [word])]
        command = [sys.executable, "-m", "hijack_data.cli", *words]
        done = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=300)
        assert done.returncode == 0, f"{line}\n{done.stdout}\n{done.stderr}"


def test_the_reference_page_is_the_registry():
    command = [sys.executable, "-m", "hijack_data.cli", "list", "--markdown"]
    made = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    assert (ROOT / "docs" / "corruptions.md").read_text() == made, "run: hijack list --markdown > docs/corruptions.md"


@pytest.mark.parametrize(
    "page", PAGES + [ROOT / n for n in ("ARCHITECTURE.md", "CONTRIBUTING.md")], ids=lambda p: p.name
)
def test_links_lead_somewhere(page):
    for target in re.findall(r"\]\(([^)#]+)\)", page.read_text()):
        assert "://" in target or (page.parent / target).exists(), f"{page.name} links to {target}, which is not there"
