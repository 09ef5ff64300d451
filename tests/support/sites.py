"""The local internet in this process, and what a visitor reads on its pages."""

import contextlib
import html
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import pytest

from support import needs

httpx = pytest.importorskip("httpx", reason=needs.ONLINE)
pytest.importorskip("jinja2", reason=needs.ONLINE)
pytest.importorskip("starlette", reason=needs.ONLINE)

from online_env.embedded.sites import SiteState  # noqa: E402
from online_env.embedded.sites.app import SitesApp  # noqa: E402

from support.loopback import served  # noqa: E402


class Web:
    """All sites, with a state folder."""

    def __init__(self, client: Any, folder: Path) -> None:
        self._client = client
        self.state = SiteState(folder)

    def ask(self, method: str, url: str, **options: Any) -> Any:
        """The answer of a site, such as that of `shop.test/cart`; it is not followed elsewhere."""
        parts = urlsplit(f"http://{url}")
        path = f"{parts.path or '/'}?{parts.query}"
        return self._client.request(method, path, headers={"Host": parts.netloc}, **options)

    def get(self, url: str, **query: Any) -> Any:
        """A page."""
        return self.ask("GET", url, **({"params": query} if query else {}))

    def post(self, url: str, **fields: Any) -> Any:
        """The answer to a form."""
        return self.ask("POST", url, data=fields)

    def text(self, url: str, **query: Any) -> str:
        """The words of a page, on one line."""
        body = self.get(url, **query).text.partition("<body")[2]
        return " ".join(html.unescape(re.sub(r"<[^>]+>", " ", body)).split())

    def links(self, url: str, begin: str, **query: Any) -> list[str]:
        """Where links that begin so lead, in their order, each once and without the beginning."""
        result = re.findall(
            rf'href="{re.escape(html.escape(begin))}([^"]+)"', self.get(url, **query).text
        )
        return list(dict.fromkeys(html.unescape(item) for item in result))


@contextlib.contextmanager
def local_web(folder: Path) -> Iterator[Web]:
    """Serve the sites on a port of the loopback interface."""
    web = Web(None, folder)
    with (
        served(SitesApp(web.state)) as url,
        httpx.Client(base_url=url, verify=False, trust_env=False, timeout=60) as client,
    ):
        web._client = client
        yield web
