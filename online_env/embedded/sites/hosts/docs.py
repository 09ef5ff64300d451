"""docs.test: the documentation of a backup program."""

from starlette.applications import Starlette
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import Response
from starlette.routing import Route

from ..index import Document, find
from ..library import articles, plain, render
from ..pages import page, query, site
from ..state import SiteState

HOST = "docs.test"
_FOLDER = "docs"


def documents() -> list[Document]:
    """Return the pages of this site that the search page finds."""
    return [
        Document(
            HOST, f"/{a.slug}", a.title, f"{a.head['summary']} {plain(a.body)}", "Documentation"
        )
        for a in articles(_FOLDER).values()
    ]


def _common(request: Request) -> dict[str, object]:
    sections: dict[str, list[object]] = {}
    for article in articles(_FOLDER).values():
        sections.setdefault(article.head["section"], []).append(article)
    return {"sections": sections, "query": query(request, "q")}


async def home(request: Request) -> Response:
    """Return the contents."""
    return page(request, "home.html")


async def article(request: Request) -> Response:
    """Return one article.

    Raises:
        HTTPException: There is no such article (404).
    """
    pages = articles(_FOLDER)
    slug = request.path_params["slug"]
    if slug not in pages:
        raise HTTPException(404)
    order = list(pages)
    index = order.index(slug)
    return page(
        request,
        "article.html",
        article=pages[slug],
        text=render(pages[slug].body),
        previous=pages[order[index - 1]] if index else None,
        following=pages[order[index + 1]] if index + 1 < len(order) else None,
    )


async def search(request: Request) -> Response:
    """Return the articles with certain words."""
    return page(request, "search.html", hits=find(query(request, "q"), documents()))


def make(sites: SiteState) -> Starlette:
    """Return the application."""
    routes = [Route("/", home), Route("/search", search), Route("/{slug}", article)]
    return site("docs", routes, sites, _common)
