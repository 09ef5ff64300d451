"""Loading in advance what the libraries load at first use."""

import importlib

LATER = (
    "anyio._backends._asyncio",
    "anyio.from_thread",
    "anyio.to_thread",
    "uvicorn.protocols.http.h11_impl",
    "uvicorn.loops.asyncio",
    "uvicorn.logging",
    "python_multipart.multipart",
    "starlette.formparsers",
    "starlette.middleware.errors",
    "starlette.middleware.exceptions",
    "mss.linux",
    "mss.linux.xshmgetimage",
    "mss.linux.xgetimage",
    "jeepney.io.blocking",
    "jeepney.auth",
    "Xlib.support.unix_connect",
    "Xlib.xauth",
    "uvicorn.lifespan.off",
    "Xlib.protocol.display",
    "encodings.idna",
    "encodings.ascii",
    "encodings.latin_1",
    "encodings.utf_16",
    "concurrent.futures.thread",
    "asyncio.unix_events",
    "html",
    "html.entities",
    "traceback",
    "tempfile",
    "mimetypes",
    "http.client",
    "urllib.request",
    "ssl",
    "secrets",
    "shutil",
    "stringprep",
    "unicodedata",
)


def everything() -> None:
    """Import the modules that are otherwise imported while serving.

    An embedded desktop shows none of them: what is forgotten here cannot be imported there. A
    missing one is an `ImportError`.
    """
    listed: list[tuple[str, str]] = importlib.import_module("Xlib.ext").__extensions__
    extensions = (f"Xlib.ext.{name}" for _, name in listed)
    for name in (*LATER, *extensions):
        importlib.import_module(name)
    importlib.import_module("hijack_data.png").fastest_zlib()
