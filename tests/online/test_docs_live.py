"""The documentation's Python blocks that start a desktop run."""

import pytest

from support.docs import blocks, run_python


@pytest.mark.usefixtures("browser_machine")
@pytest.mark.parametrize("code", list(blocks("python", live=True)))
def test_python_blocks_run(code, tmp_path):
    run_python(code, tmp_path)
