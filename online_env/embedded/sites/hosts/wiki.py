"""wiki.test: an encyclopedia that anyone may edit.

State, `wiki.json`: `{"pages": {TITLE: {"text": Markdown, "revisions": [{"number", "summary",
"size", "by", "when"}]}}}`; a page that nobody edited is not in it. Edits of the machine's user have
no `by` and no `when`, which are plain texts.
"""

import re
from typing import Any
from urllib.parse import quote

from starlette.applications import Starlette
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import Response
from starlette.routing import Route

from ..index import Document, find
from ..library import articles, plain, render
from ..pages import clean, fields, first, page, query, see_other, site, site_state
from ..state import SiteState

HOST = "wiki.test"
_FOLDER = "wiki"
MAX_TITLE = 80
OWNER = "Robin Hale"  # the machine's user, as in the mailbox


def documents() -> list[Document]:
    """The pages of this site that the search page finds: the articles as they were shipped."""
    return [
        Document(HOST, f"/wiki/{a.slug}", a.title, plain(a.body), "Encyclopedia", a.head["picture"])
        for a in articles(_FOLDER).values()
    ]


def _current(pages: dict[str, Any]) -> dict[str, str]:
    """Return the text of every article now, by title."""
    return {a.title: a.body for a in articles(_FOLDER).values()} | {
        t: p["text"] for t, p in pages.items()
    }


def _pages(request: Request) -> dict[str, Any]:
    return site_state(request).read("wiki").get("pages", {})


def _title(request: Request) -> str:
    """Return the title in the address: `Honey_bee` is `Honey bee`.

    Raises:
        HTTPException: It is not a title (404).
    """
    title = " ".join(clean(request.path_params["title"]).replace("_", " ").split())
    if not 1 <= len(title) <= MAX_TITLE or re.search(r"[\[\]{}|<>#/?%\\]", title):
        raise HTTPException(404)
    return title[0].upper() + title[1:]


def address(title: str) -> str:
    """Return the path of an article."""
    return "/wiki/" + quote(title.replace(" ", "_"))


def _common(request: Request) -> dict[str, object]:
    return {
        "query": query(request, "q"),
        "address": address,
        "titles": sorted(_current(_pages(request))),
        "title": None,
    }


def _head(title: str) -> dict[str, Any]:
    shipped = articles(_FOLDER).get(title.replace(" ", "_"))
    return dict(shipped.head) if shipped else {"facts": {}, "category": ""}


async def home(request: Request) -> Response:
    """Return the first page."""
    by_category: dict[str, list[object]] = {}
    for article in articles(_FOLDER).values():
        by_category.setdefault(article.head["category"], []).append(article)
    featured = articles(_FOLDER)["Lighthouse"]
    return page(
        request,
        "home.html",
        categories=by_category,
        featured=featured,
        lead=_lead(featured.body),
        recent=sorted(_pages(request)),
    )


def _lead(body: str) -> str:
    return render(body.split("\n\n")[0]).html


async def article(request: Request) -> Response:
    """Return one article."""
    title = _title(request)
    pages = _pages(request)
    text = _current(pages).get(title)
    if text is None:
        return page(request, "missing.html", 404, title=title)
    return page(
        request,
        "article.html",
        title=title,
        text=render(text),
        head=_head(title),
        edited=title in pages,
    )


async def edit(request: Request) -> Response:
    """Return the form to change an article, and its answers."""
    title = _title(request)
    if request.method != "POST":
        text = _current(_pages(request)).get(title, "")
        return page(request, "edit.html", title=title, text=text, problem="")
    form = await fields(request)
    text = first(form, "text")
    if not text:
        return page(
            request, "edit.html", 422, title=title, text="", problem="An article cannot be empty."
        )
    with site_state(request).update("wiki") as state:
        entry = state.setdefault("pages", {}).setdefault(title, {"revisions": []})
        revision = {
            "number": len(entry["revisions"]) + 1,
            "summary": first(form, "summary")[:200],
            "size": len(text),
        }
        entry["text"] = text
        entry["revisions"].append(revision)
    return see_other(address(title))


async def history(request: Request) -> Response:
    """Return the versions of an article.

    Raises:
        HTTPException: There is no such article (404).
    """
    title = _title(request)
    pages = _pages(request)
    if title not in _current(pages):
        raise HTTPException(404)
    revisions = pages.get(title, {}).get("revisions", [])
    return page(
        request,
        "history.html",
        title=title,
        revisions=revisions[::-1],
        owner=OWNER,
        shipped=bool(_head(title)["facts"]),
    )


async def everything(request: Request) -> Response:
    """Return all articles."""
    return page(request, "all.html")


async def search(request: Request) -> Response:
    """Return the articles with certain words."""
    text = query(request, "q")
    current = _current(_pages(request))
    exact = next((t for t in current if t.lower() == text.lower()), None)
    if exact is not None:
        return see_other(address(exact))
    pages = [
        Document(HOST, address(t), t, plain(body), "Encyclopedia") for t, body in current.items()
    ]
    return page(request, "search.html", hits=find(text, pages))


def make(sites: SiteState) -> Starlette:
    """Return the application."""
    routes = [
        Route("/", home),
        Route("/all", everything),
        Route("/search", search),
        Route("/wiki/{title}", article),
        Route("/edit/{title}", edit, methods=["GET", "POST"]),
        Route("/history/{title}", history),
    ]
    return site("wiki", routes, sites, _common)
