"""Parts that the sites share: templates, forms as clean text, error pages."""

import unicodedata
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from http import HTTPStatus
from pathlib import Path
from typing import Any, cast
from urllib.parse import parse_qs

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from starlette.applications import Starlette
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import HTMLResponse, RedirectResponse, Response
from starlette.routing import BaseRoute

from .hosts_and_dates import TODAY, day, long_date, short_date
from .state import SiteState, StorageFullError

HERE = Path(__file__).parent
MAX_FIELD = 20_000
MAX_FIELDS = 200


@cache
def _templates() -> Environment:
    env = Environment(
        loader=FileSystemLoader(HERE / "templates"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    env.filters.update(money=money, day=day, long_date=long_date, short_date=short_date)
    env.globals.update(today=TODAY)
    return env


def money(cents: int) -> str:
    """`$1,234.50`."""
    return f"${cents // 100:,}.{cents % 100:02d}"


def page(request: Request, template: str, code: int = 200, /, **values: Any) -> HTMLResponse:
    """Return a rendered template of the site that was asked, such as `"cart.html"`."""
    site = request.app.state
    common = {"site": site.name, "path": request.url.path, **site.common(request)}
    html = _templates().get_template(f"{site.name}/{template}").render({**common, **values})
    return HTMLResponse(html, code)


def see_other(path: str) -> RedirectResponse:
    """Go to `path` after a post, so that reloading does not post again."""
    return RedirectResponse(path, HTTPStatus.SEE_OTHER)


def clean(text: str) -> str:
    """Text as it is stored: one kind of line end, no control characters, no space around it.

    It is `MAX_FIELD` long at most.
    """
    text = text.replace("\r\n", "\n").replace("\r", "\n")
    characters = (c for c in text if c in "\n\t" or unicodedata.category(c) not in ("Cc", "Cs"))
    return "".join(characters).strip()[:MAX_FIELD]


async def fields(request: Request) -> dict[str, list[str]]:
    """Return the fields of a posted form, cleaned.

    Raises:
        HTTPException: The body is not an urlencoded form (415), or has over `MAX_FIELDS` (400).
    """
    kind = request.headers.get("content-type", "").split(";")[0].strip().lower()
    if kind != "application/x-www-form-urlencoded":
        raise HTTPException(
            415, "Forms on this site are posted as application/x-www-form-urlencoded."
        )
    body = (await request.body()).decode("utf-8", "replace")
    try:
        form = parse_qs(body, keep_blank_values=True, max_num_fields=MAX_FIELDS)
    except ValueError:
        raise HTTPException(400, f"A form has at most {MAX_FIELDS} fields.") from None
    return {name: [clean(v) for v in values] for name, values in form.items()}


def first(form: Mapping[str, Sequence[str]], name: str, default: str = "") -> str:
    """Return the first value of a field."""
    return form.get(name, [default])[0]


def query(request: Request, name: str) -> str:
    """Return a cleaned parameter of the address, one line, at most 200 characters."""
    return " ".join(clean(request.query_params.get(name, "")).split())[:200]


def site_state(request: Request) -> SiteState:
    """Return the state folder that this server was started with."""
    return request.app.state.sites


def _storage_full(request: Request, error: Exception) -> Response:
    del request, error
    return HTMLResponse(
        "<!doctype html><title>Storage full</title><h1>This site can store no more.</h1>", 507
    )


def _refused(request: Request, error: Exception) -> Response:
    status = HTTPStatus(cast(HTTPException, error).status_code)
    detail = cast(HTTPException, error).detail
    values = {
        "status": status.value,
        "phrase": status.phrase,
        "detail": "" if detail == status.phrase else detail,
    }
    response = page(request, "error.html", status.value, **values)
    response.headers.update(cast(HTTPException, error).headers or {})
    return response


def nothing(request: Request) -> dict[str, Any]:
    """Return the `common` values of a site whose pages need none."""
    del request
    return {}


def site(
    name: str,
    routes: Sequence[BaseRoute],
    sites: SiteState,
    common: Callable[[Request], dict[str, Any]] = nothing,
) -> Starlette:
    """The application of one site; its error pages look like it (`templates/NAME/error.html`).

    Args:
        name: folder of its templates.
        routes: paths and endpoints.
        sites: the state folder.
        common: values that each of its pages is rendered with.
    """
    app = Starlette(
        routes=routes, exception_handlers={HTTPException: _refused, StorageFullError: _storage_full}
    )
    app.state.name = name
    app.state.sites = sites
    app.state.common = common
    return app
