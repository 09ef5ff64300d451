"""Files in and out of the desktop, and its wallpaper."""

import mimetypes
import os
import shutil
import tempfile
import urllib.request
from http.client import HTTPException
from pathlib import Path
from typing import BinaryIO, cast

from starlette.concurrency import run_in_threadpool
from starlette.datastructures import UploadFile
from starlette.requests import Request
from starlette.responses import JSONResponse, PlainTextResponse, Response, StreamingResponse
from starlette.routing import Route

from ...errors import GuestError
from .machine import GuestMachine
from .request_checks import JsonAnswer
from .request_fields import BAD_REQUEST, read_json_body, text
from .user_files import FAILED, NOT_FOUND, chunks, expand, listing, open_file, save

DOWNLOAD_TRIES = 3
DOWNLOAD_TIMEOUT = 300
DOWNLOAD_CHUNK = 65536
BACKDROP = ("xfconf-query", "-c", "xfce4-desktop")
BACKDROP_TIMEOUT = 10.0
UNKNOWN_TYPE = "application/octet-stream"


class Files:
    """Routes about files."""

    def __init__(self, machine: GuestMachine) -> None:
        self._machine = machine

    def routes(self) -> list[Route]:
        """Return the routes."""
        table = {
            "/file": self.file,
            "/setup/upload": self.upload,
            "/setup/download_file": self.download,
            "/list_directory": self.list_directory,
            "/desktop_path": self.desktop_path,
            "/wallpaper": self.wallpaper,
            "/setup/change_wallpaper": self.change_wallpaper,
        }
        return [Route(path, endpoint, methods=["POST"]) for path, endpoint in table.items()]

    async def file(self, request: Request) -> Response:
        """Return the content of a file."""
        async with request.form() as form:
            path = expand(form.get("file_path"))
        return await run_in_threadpool(_send, path)

    async def upload(self, request: Request) -> Response:
        """Write a file.

        Raises:
            GuestError: A field is missing.
        """
        async with request.form(max_files=1, max_fields=8) as form:
            data = form.get("file_data")
            path = form.get("file_path")
            if not isinstance(data, UploadFile) or not isinstance(path, str):
                raise GuestError("file_path (text) and file_data (file) are required", BAD_REQUEST)
            source = cast(BinaryIO, data.file)
            size = await run_in_threadpool(save, expand(path), source)
        return PlainTextResponse(f"File Uploaded: {size} bytes")

    async def download(self, request: Request) -> Response:
        """Fetch a file from the desktop's network."""
        body = await read_json_body(request)
        url = text(body, "url")
        path = expand(text(body, "path"))
        size = await run_in_threadpool(_download, url, path)
        return PlainTextResponse(f"File downloaded successfully: {size} bytes")

    async def list_directory(self, request: Request) -> Response:
        """Return the content of a folder."""
        body = await read_json_body(request)
        path = expand(body.get("path"))
        tree = await run_in_threadpool(listing, path)
        return JsonAnswer({"directory_tree": tree})

    def desktop_path(self, _: Request) -> Response:
        """Return the folder whose files lie on the desktop.

        Raises:
            GuestError: There is none.
        """
        path = Path.home() / "Desktop"
        if not path.is_dir():
            raise GuestError(f"there is no folder {path}", NOT_FOUND)
        return JSONResponse({"desktop_path": str(path)})

    async def wallpaper(self, _: Request) -> Response:
        """Return the picture behind the icons.

        Raises:
            GuestError: There is none.
        """
        for name in await self._backdrops():
            path = (await self._backdrop("-p", name)).strip()
            if path:
                return await run_in_threadpool(_send, path)
        raise GuestError("Wallpaper file not found", NOT_FOUND)

    async def change_wallpaper(self, request: Request) -> Response:
        """Show another picture behind the icons.

        Raises:
            GuestError: The picture or the desktop is missing.
        """
        body = await read_json_body(request)
        path = expand(text(body, "path"))
        if not os.path.isfile(path):
            raise GuestError(f"File not found: {path}", NOT_FOUND)
        names = await self._backdrops()
        for name in names:
            await self._backdrop("-p", name, "-s", path)
        if not names:
            raise GuestError("the desktop has no backdrop to change: does xfdesktop run?", FAILED)
        return PlainTextResponse("Wallpaper changed successfully")

    async def _backdrops(self) -> list[str]:
        listed = await self._backdrop("-l")
        return [name for name in listed.split() if name.endswith("/last-image")]

    async def _backdrop(self, *words: str) -> str:
        """Return the output of a question to the desktop's settings."""
        outcome = await self._machine.runner.run([*BACKDROP, *words], BACKDROP_TIMEOUT)
        return outcome.output


def _send(path: str) -> Response:
    file, size = open_file(path)
    name = os.path.basename(path).encode("ascii", "replace").decode().replace('"', "'")
    headers = {"Content-Length": str(size), "Content-Disposition": f'attachment; filename="{name}"'}
    kind, _ = mimetypes.guess_type(path)
    return StreamingResponse(chunks(file), media_type=kind or UNKNOWN_TYPE, headers=headers)


def _download(url: str, path: str) -> int:
    if not url.startswith(("http://", "https://")):
        raise GuestError(
            f"a download needs an http or https address, got {url!r:.200}", BAD_REQUEST
        )
    problem = ""
    for _ in range(DOWNLOAD_TRIES):
        try:
            return _fetch(url, path)
        except (OSError, ValueError, HTTPException) as error:  # a URLError is an OSError
            problem = str(error) or type(error).__name__
    raise GuestError(f"Failed to download {url}. No retries left. Error: {problem}", FAILED)


def _fetch(url: str, path: str) -> int:
    with (
        urllib.request.urlopen(url, timeout=DOWNLOAD_TIMEOUT) as source,
        tempfile.TemporaryFile() as buffer,
    ):
        length = source.headers.get("Content-Length")
        shutil.copyfileobj(source, buffer, DOWNLOAD_CHUNK)
        received = buffer.tell()
        if length and received != int(length):
            raise OSError(f"{received} of {length} bytes came")
        buffer.seek(0)
        return save(path, cast(BinaryIO, buffer))
