"""Recording the screen of a guest, by an ffmpeg that is a script."""

import asyncio

import pytest

from support import needs

pytest.importorskip("starlette", reason=needs.ONLINE)

from online_env.embedded.guest import commands, recorder
from online_env.errors import GuestError


@pytest.fixture
def ffmpeg(tmp_path, monkeypatch):
    """Makes a recorder whose ffmpeg is a script; `$file` is what it is to write."""
    monkeypatch.setattr(recorder.tempfile, "tempdir", str(tmp_path / "tmp"))
    (tmp_path / "tmp").mkdir()
    (tmp_path / "bin").mkdir()

    def make(script):
        program = tmp_path / "bin/ffmpeg"
        program.write_text(f"#!/bin/bash\nfor file; do :; done\n{script}\n")
        program.chmod(0o755)
        return recorder.Recorder(":7", commands.Runner(str(tmp_path / "bin")))

    make.folder = tmp_path / "tmp"
    return make


WAITS = "trap 'echo -n end >> $file; exit' INT; echo $@ > $file; while :; do sleep 0.02; done"


def test_a_recording_is_ended_politely_and_removed_when_it_was_sent(ffmpeg):
    async def scenario():
        result = ffmpeg(WAITS)
        await result.start((641, 481))
        with pytest.raises(GuestError, match=r"^Recording is already in progress\.$") as error:
            await result.start((640, 480))
        assert error.value.status == 400
        video = await result.stop()
        text = video.read_text()
        assert text.endswith("end")
        for part in ("-video_size 641x481", "-i :7", "-framerate 15"):
            assert part in text
        result.discard()
        assert list(ffmpeg.folder.iterdir()) == []
        with pytest.raises(GuestError, match=r"No recording in progress to stop\. .*: \(none\)$"):
            await result.stop()

    asyncio.run(scenario())


@pytest.mark.parametrize(
    ("script", "message"),
    [
        ("echo no screen >&2; exit 1", "ffmpeg ended at once: no screen\n"),
        (
            "trap '' INT; echo x > $file; echo stuck; exec sleep 60",
            "ffmpeg did not end within 0.3 s",
        ),
        (
            "trap 'rm $file; exit' INT; echo x > $file; while :; do sleep 0.02; done",
            "wrote no video",
        ),
    ],
)
def test_a_recording_that_fails_is_told_with_the_log(ffmpeg, monkeypatch, script, message):
    async def scenario():
        result = ffmpeg(script)
        await result.start((640, 480))
        monkeypatch.setattr(recorder, "FFMPEG_TIMEOUT_S", 0.3)
        await result.stop()

    with pytest.raises(GuestError) as error:
        asyncio.run(scenario())
    assert message in str(error.value)
    assert error.value.status == 500
