"""search.test: one page that finds the pages of the other sites."""

from functools import cache

from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import Response
from starlette.routing import Route

from ..index import Document, find
from ..library import articles, plain
from ..pages import page, query, site
from ..state import SiteState
from . import docs, forms, news, shop, wiki

HOST = "search.test"
PER_PAGE = 8
TABS = {
    "": "All",
    "wiki.test": "Encyclopedia",
    "news.test": "News",
    "shop.test": "Shopping",
    "docs.test": "Docs",
}


@cache
def _documents() -> tuple[Document, ...]:
    documents = [d for module in (wiki, news, shop, docs, forms) for d in module.documents()]
    home = Document(
        "mail.test",
        "/",
        "Postbox: your mail",
        "Read and send mail. Inbox, sent, starred, archive.",
        "Mail",
    )
    return (*documents, home)


def _panel(text: str) -> dict[str, object] | None:
    """Return a box beside the results where an article of the wiki has just this name."""
    for article in articles("wiki").values():
        if article.title.lower() == text.lower():
            lead = plain(article.body.split("\n\n")[0])
            return {"article": article, "lead": lead}
    return None


async def home(request: Request) -> Response:
    """Return the search form."""
    return page(request, "home.html", query="")


async def results(request: Request) -> Response:
    """Return the pages of all sites with certain words."""
    text = query(request, "q")
    host = query(request, "site")
    if not text:
        return await home(request)
    host = host if host in TABS else ""
    hits = find(text, [d for d in _documents() if host in ("", d.host)])
    pages = max(1, -(-len(hits) // PER_PAGE))
    number = query(request, "page")
    current = (
        min(int(number), pages)
        if number.isascii() and number.isdigit() and len(number) < 5 and int(number)
        else 1
    )
    page_hits = hits[(current - 1) * PER_PAGE : current * PER_PAGE]
    return page(
        request,
        "results.html",
        query=text,
        site_filter=host,
        tabs=TABS,
        hits=page_hits,
        total=len(hits),
        current=current,
        pages=pages,
        panel=_panel(text) if not host else None,
    )


def make(sites: SiteState) -> Starlette:
    """Return the application."""
    return site(
        "search",
        [Route("/", home), Route("/search", results)],
        sites,
        lambda r: {"query": query(r, "q")},
    )
