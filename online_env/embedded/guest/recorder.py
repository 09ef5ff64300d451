"""Recording the screen to a video, by ffmpeg."""

import asyncio
import os
import shutil
import signal
import tempfile
from pathlib import Path

from ...errors import GuestError
from .commands import Runner

FRAMES_PER_S = 15
FFMPEG_TIMEOUT_S = 15.0  # s that ffmpeg has to start, and to finish the file


class Recorder:
    """One recording at a time."""

    def __init__(self, display: str, runner: Runner) -> None:
        self._display = display
        self._runner = runner
        self._process: asyncio.subprocess.Process | None = None
        self._folder = Path()

    async def start(self, size: tuple[int, int]) -> None:
        """Start recording; returns when ffmpeg writes.

        Raises:
            GuestError: A recording is under way (400), ffmpeg is not installed (501) or fails
                (500).
        """
        if self._process is not None and self._process.returncode is None:
            raise GuestError("Recording is already in progress.", 400)
        if not shutil.which("ffmpeg", path=self._runner.environment["PATH"]):
            raise GuestError("ffmpeg is not installed in the desktop: apt-get install ffmpeg", 501)
        self._forget()
        self._folder = Path(tempfile.mkdtemp(prefix="recording-"))
        with (self._folder / "log").open("wb") as log:
            self._process = await asyncio.create_subprocess_exec(
                "ffmpeg",
                "-nostdin",
                "-y",
                "-f",
                "x11grab",
                "-draw_mouse",
                "1",
                "-framerate",
                str(FRAMES_PER_S),
                "-video_size",
                f"{size[0]}x{size[1]}",
                "-i",
                self._display,
                "-c:v",
                "libx264",
                "-preset",
                "ultrafast",
                "-vf",
                "pad=ceil(iw/2)*2:ceil(ih/2)*2",
                "-pix_fmt",
                "yuv420p",
                str(self._video),
                env=self._runner.environment,
                stdin=asyncio.subprocess.DEVNULL,
                stdout=log,
                stderr=log,
                start_new_session=True,
            )
        process = self._process
        for _ in range(int(FFMPEG_TIMEOUT_S / 0.05)):
            if process.returncode is not None:
                raise GuestError(f"ffmpeg ended at once: {self._log()}", 500)
            if self._video.exists() and self._video.stat().st_size:
                return
            await asyncio.sleep(0.05)
        self._process = None
        os.killpg(process.pid, signal.SIGKILL)
        await process.wait()
        raise GuestError(
            f"ffmpeg did not begin to write within {FFMPEG_TIMEOUT_S:g} s: {self._log()}", 500
        )

    async def stop(self) -> Path:
        """End the recording and return the file, which `discard` removes.

        Raises:
            GuestError: None is under way (400), or ffmpeg fails (500).
        """
        process = self._process
        self._process = None
        if process is None or process.returncode is not None:
            raise GuestError(f"No recording in progress to stop. FFmpeg log: {self._log()}", 400)
        process.send_signal(signal.SIGINT)
        try:
            await asyncio.wait_for(process.wait(), FFMPEG_TIMEOUT_S)
        except TimeoutError:
            os.killpg(process.pid, signal.SIGKILL)
            await process.wait()
            raise GuestError(
                f"ffmpeg did not end within {FFMPEG_TIMEOUT_S:g} s and was killed: {self._log()}",
                500,
            ) from None
        if not self._video.exists() or not self._video.stat().st_size:
            raise GuestError(f"ffmpeg wrote no video: {self._log()}", 500)
        return self._video

    def discard(self) -> None:
        """Remove the files of the last recording."""
        self._forget()

    def _forget(self) -> None:
        if self._folder.name:
            shutil.rmtree(self._folder, ignore_errors=True)
        self._folder = Path()

    @property
    def _video(self) -> Path:
        return self._folder / "recording.mp4"

    def _log(self) -> str:
        path = self._folder / "log"
        return (
            path.read_text("utf-8", "replace")[-1000:]
            if self._folder.name and path.exists()
            else "(none)"
        )
