"""Pages of the local sites as they are served, for judging what was saved of them."""

import asyncio
import importlib
import re
from html.parser import HTMLParser
from typing import Any

from ..machine import Machine

_UNSEEN = ("script", "style", "template")


def served_page(machine: Machine, host: str, path: str) -> bytes:
    """Return a page as its site sends it.

    Args:
        machine: The machine, whose stored state the site shows.
        host: The site, such as `docs.test`.
        path: The path of the address, such as `/faq`.
    """
    site = importlib.import_module(f"online_env.embedded.sites.hosts.{host.partition('.')[0]}")
    scope: dict[str, Any] = {
        "type": "http",
        "http_version": "1.1",
        "method": "GET",
        "scheme": "http",
        "path": path,
        "raw_path": path.encode(),
        "root_path": "",
        "query_string": b"",
        "headers": [(b"host", host.encode())],
    }
    sent: list[dict[str, Any]] = []

    async def receive() -> dict[str, Any]:
        return {"type": "http.request", "body": b"", "more_body": False}

    async def send(message: dict[str, Any]) -> None:
        sent.append(message)

    asyncio.run(site.make(machine.sites)(scope, receive, send))
    return b"".join(message.get("body", b"") for message in sent)


def seen_text(page: str, element: str) -> str:
    """Return the text of the elements of one name, without any spaces; "" if there is none.

    A browser that saves a page changes marks, addresses and spaces, and leaves the text.
    """
    reader = _Reader(element)
    reader.feed(page)
    reader.close()
    return re.sub(r"\s+", "", "".join(reader.texts))


class _Reader(HTMLParser):
    """Collects the text that is seen within the elements of one name."""

    def __init__(self, element: str) -> None:
        super().__init__()
        self.texts: list[str] = []
        self._element = element
        self._depth = 0
        self._hidden = 0

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self._depth += tag == self._element
        self._hidden += tag in _UNSEEN

    def handle_endtag(self, tag: str) -> None:
        self._depth -= tag == self._element and self._depth > 0
        self._hidden -= tag in _UNSEEN and self._hidden > 0

    def handle_data(self, data: str) -> None:
        if self._depth and not self._hidden:
            self.texts.append(data)
