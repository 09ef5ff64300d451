"""news.test: the newspaper of a small harbour town."""

from starlette.applications import Starlette
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import Response
from starlette.routing import Route

from ..index import Document
from ..library import articles, plain, render
from ..pages import page, site
from ..state import SiteState

HOST = "news.test"
_FOLDER = "news"
SECTIONS = ("Local", "Business", "Science", "Culture", "Sport")


def documents() -> list[Document]:
    """Return the pages of this site that the search page finds."""
    return [
        Document(HOST, f"/article/{a.slug}", a.title, f"{a.head['lead']} {plain(a.body)}", "News")
        for a in articles(_FOLDER).values()
    ]


def _common(request: Request) -> dict[str, object]:
    del request
    return {"sections": SECTIONS, "articles": list(articles(_FOLDER).values()), "section": None}


async def home(request: Request) -> Response:
    """Return the front page."""
    return page(request, "home.html")


async def section(request: Request) -> Response:
    """Return the articles of a section.

    Raises:
        HTTPException: There is no such section (404).
    """
    name = request.path_params["name"].capitalize()
    if name not in SECTIONS:
        raise HTTPException(404)
    selection = [a for a in articles(_FOLDER).values() if a.head["section"] == name]
    return page(request, "section.html", section=name, chosen=selection)


async def article(request: Request) -> Response:
    """Return one article.

    Raises:
        HTTPException: There is no such article (404).
    """
    story = articles(_FOLDER).get(request.path_params["slug"])
    if story is None:
        raise HTTPException(404)
    other_pages = [a for a in articles(_FOLDER).values() if a is not story]
    other_pages.sort(key=lambda a: a.head["section"] != story.head["section"])
    return page(
        request,
        "article.html",
        article=story,
        text=render(story.body),
        others=other_pages[:4],
        section=story.head["section"],
    )


def make(sites: SiteState) -> Starlette:
    """Return the application."""
    routes = [
        Route("/", home),
        Route("/section/{name}", section),
        Route("/article/{slug}", article),
    ]
    return site("news", routes, sites, _common)
