"""The views of the desktop: pictures, tree, sizes, video; and our own fast routes under `/ah/`."""

from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import JSONResponse, PlainTextResponse, Response, StreamingResponse
from starlette.routing import Route

from hijack_data import png

from ...errors import GuestError
from .machine import GuestMachine
from .request_checks import problem
from .request_fields import read_json_body
from .user_files import chunks, open_file


class Observe:
    """Routes that look."""

    def __init__(self, machine: GuestMachine) -> None:
        self._machine = machine

    def routes(self) -> list[Route]:
        """Return the routes."""
        get = ["GET"]
        post = ["POST"]
        return [
            Route("/screenshot", self.screenshot, methods=get),
            Route("/accessibility", self.accessibility, methods=get),
            Route("/terminal", self.terminal, methods=get),
            Route("/platform", self.platform, methods=get),
            Route("/cursor_position", self.cursor_position, methods=get),
            Route("/screen_size", self.screen_size, methods=post),
            Route("/window_size", self.window_size, methods=post),
            Route("/start_recording", self.start_recording, methods=post),
            Route("/end_recording", self.end_recording, methods=post),
            Route("/ah/health", self.health, methods=get),
            Route("/ah/frame", self.frame, methods=get),
            Route("/ah/tree", self.tree, methods=get),
            Route("/ah/windows", self.windows, methods=get),
            Route("/ah/windows", self.act_on_windows, methods=post),
            Route("/ah/input", self.input, methods=post),
        ]

    def screenshot(self, _: Request) -> Response:
        """Return the screen as PNG, with the pointer."""
        image, number = self._machine.screen.capture()
        headers = {"X-Frame-Id": str(number), "Cache-Control": "no-store"}
        return Response(png.encode(image), media_type="image/png", headers=headers)

    def frame(self, _: Request) -> Response:
        """Return the screen as raw RGB; `X-Width`, `X-Height`, `X-Frame-Id` tell the rest."""
        image, number = self._machine.screen.capture()
        height, width, _ = image.shape
        headers = {"X-Width": str(width), "X-Height": str(height), "X-Frame-Id": str(number)}
        return Response(image.tobytes(), media_type="application/octet-stream", headers=headers)

    def accessibility(self, _: Request) -> Response:
        """Return the accessibility tree, read now."""
        return JSONResponse({"AT": self._machine.tree.read()})

    def tree(self, _: Request) -> Response:
        """The tree, and the number of the last frame that was captured before it was read."""
        number = self._machine.screen.frame_id
        return JSONResponse({"xml": self._machine.tree.read(), "frame_id": number})

    def terminal(self, _: Request) -> Response:
        """Return the text of the terminal in front, or null."""
        return JSONResponse({"output": self._machine.tree.terminal_text(), "status": "success"})

    def platform(self, _: Request) -> Response:
        """Always Linux."""
        return PlainTextResponse("Linux")

    def cursor_position(self, _: Request) -> Response:
        """Return the place of the pointer."""
        return JSONResponse(list(self._machine.input.position()))

    def screen_size(self, _: Request) -> Response:
        """Return the size of the screen."""
        width, height = self._machine.windows.screen_size()
        return JSONResponse({"width": width, "height": height})

    async def window_size(self, request: Request) -> Response:
        """Return the size of the first window of a class.

        Raises:
            GuestError: There is none.
        """
        async with request.form() as form:
            name = form.get("app_class_name")
        if not isinstance(name, str):
            raise GuestError("app_class_name is required", 400)
        for window in await run_in_threadpool(self._machine.windows.all):
            if name.lower() in window.class_name.lower().split("."):
                x1, y1, x2, y2 = window.box
                return JSONResponse({"width": x2 - x1, "height": y2 - y1})
        raise GuestError(f"there is no window of class {name!r:.200}", 404)

    async def start_recording(self, _: Request) -> Response:
        """Start a video of the screen."""
        size = await run_in_threadpool(self._machine.windows.screen_size)
        await self._machine.recorder.start(size)
        return JSONResponse({"status": "success", "message": "Started recording successfully."})

    async def end_recording(self, _: Request) -> Response:
        """End the video and return it (mp4)."""
        file, size = open_file(str(await self._machine.recorder.stop()))
        self._machine.recorder.discard()  # the open file stays readable
        return StreamingResponse(
            chunks(file), media_type="video/mp4", headers={"Content-Length": str(size)}
        )

    def health(self, _: Request) -> Response:
        """Return whether all of the session answers.

        Always 200: the answer itself shows that the server lives.
        """
        return JSONResponse(self._machine.health())

    def windows(self, _: Request) -> Response:
        """Return the windows."""
        windows = self._machine.windows
        rows = [window.to_dict() for window in windows.all()]
        return JSONResponse({"windows": rows, "desktop_shown": windows.desktop_shown})

    async def act_on_windows(self, request: Request) -> Response:
        """Act on a window.

        The body is `{"action": "activate|close|minimise|place|show_desktop", "id", "box", "on"}`.
        """
        await run_in_threadpool(self._machine.act, await read_json_body(request))
        return JSONResponse({"status": "success"})

    async def input(self, request: Request) -> Response:
        """Play mouse and keyboard events."""
        body = await read_json_body(request)
        if "events" not in body:
            return problem(
                'events is required: {"events": [{"type": "click", "x": 10, "y": 20}]}', 400
            )
        count = await run_in_threadpool(self._machine.input.play, body["events"])
        return JSONResponse({"status": "success", "played": count})
