"""The agent `pixel` on a real desktop: it is told a plan, and sees only the picture."""

from pathlib import Path

import pytest

from support import needs

pytest.importorskip("lxml", reason=needs.ONLINE)
pytest.importorskip("starlette", reason=needs.ONLINE)
pytest.importorskip("rapidocr", reason=needs.OCR)


def test_it_does_a_task_by_reading_the_screen(embedded_machine: None, tmp_path: Path) -> None:
    from online_env import EmbeddedDesktop, SmallTasks
    from online_env.bench.config import Bench
    from online_env.bench.episodes import LiveEpisodes
    from online_env.bench.jobs import Job

    bench = Bench(agents=("pixel",), tasks=("set_variable",), max_steps=30)
    with EmbeddedDesktop.up() as desktop:
        episodes = LiveEpisodes(bench, tmp_path, SmallTasks(desktop))
        record = episodes(Job("pixel", "set_variable", "clean", 0), 0)
    assert (record["status"], record["score"]) == ("ok", 1.0), record
    assert record["usage"]["reading"]["pictures"] >= 3
