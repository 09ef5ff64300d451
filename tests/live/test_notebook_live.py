"""The notebook of a live agent runs, and each episode in it counts."""

from pathlib import Path

from support import notebooks


def test_the_live_notebook_runs(embedded_machine: None, tmp_path: Path):
    result = notebooks.run("live_agent", tmp_path)
    printed = [
        "".join(output["text"])
        for cell in notebooks.code_cells(result)
        for output in cell["outputs"]
        if output["output_type"] == "stream"
    ]
    assert printed == ["ok 0.0\n", "ok 0.0\n"]
