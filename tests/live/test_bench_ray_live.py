"""The benchmark on a desktop of a Ray that the command starts itself."""

import json
from pathlib import Path

import pytest

from support import needs

pytest.importorskip("gymnasium", reason=needs.ONLINE)
pytest.importorskip("lxml", reason=needs.ONLINE)
pytest.importorskip("ray", reason=needs.RAY)

from pipelines.proof.rebuild import rebuild

from support.docs import PAGES, TESTED_IN, blocks_of, clone
from support.pasting import Terminal
from support.waiting import until

MARK = "AGENTHIJACK_TEST_RAY"


def marked(value):
    """The processes that have the mark in their environment."""
    items = []
    for process in Path("/proc").glob("[0-9]*"):
        try:
            if f"{MARK}={value}".encode() in (process / "environ").read_bytes().split(b"\0"):
                items.append((process / "cmdline").read_bytes())
        except OSError:
            continue
    return items


def test_the_command_of_clusters_md(embedded_machine, tmp_path, monkeypatch):
    monkeypatch.delenv("RAY_ADDRESS", raising=False)
    monkeypatch.setenv(MARK, str(tmp_path))
    (page,) = [page for page in PAGES if page.name == "clusters.md"]
    terminal = Terminal(clone(tmp_path))
    terminal.active = True
    terminal.paste(block for block in blocks_of(page) if block.kind == TESTED_IN)
    run = tmp_path / "runs" / "on_ray"
    (record,) = map(json.loads, (run / "records.jsonl").read_text().splitlines())
    assert (record["status"], record["score"]) == ("ok", 1.0)
    assert rebuild(run).ok
    until(lambda: not marked(tmp_path), "the end of Ray and of the desktop")
