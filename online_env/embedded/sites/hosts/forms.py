"""forms.test: a community centre where people register for courses and say how these were.

State, `forms.json`: `{"registrations": [{"number", "name", "email", "birth_date" (YYYY-MM-DD),
"country", "course", "level", "interests" (list), "notes"}], "feedback": [{"course", "rating",
"comment", "quote" (bool)}]}`, oldest first; `course`, `level`, `interests` and `rating` hold keys
of `content/forms.yaml`. A registration that was cancelled stays, with `"cancelled": true`.
"""

import re
from collections.abc import Mapping, Sequence
from datetime import date
from functools import cache
from typing import Any

from starlette.applications import Starlette
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import Response
from starlette.routing import Route

from ..hosts_and_dates import TODAY
from ..index import Document
from ..library import load
from ..pages import fields, first, page, query, see_other, site, site_state
from ..state import SiteState

HOST = "forms.test"
FIRST_NUMBER = 1001
EMAIL = re.compile(r"[^@\s]+@[^@\s]+\.[^@\s.]+")


@cache
def content() -> dict[str, Any]:
    """`content/forms.yaml`: the courses and the choices of the form."""
    return load("forms")


def documents() -> list[Document]:
    """Return the pages of this site that the search page finds."""
    courses = content()["courses"].values()
    offered = " ".join(f"{c['name']}: {c['about']}" for c in courses)
    return [
        Document(
            HOST, "/", "Northgate Community Centre", f"Courses this spring. {offered}", "Community"
        ),
        Document(
            HOST,
            "/register",
            "Course registration",
            f"Register for a spring course. {offered}",
            "Community",
        ),
    ]


def _registration(form: Mapping[str, Sequence[str]]) -> dict[str, Any]:
    names = ("name", "email", "birth_date", "country", "course", "level", "notes")
    return {n: first(form, n) for n in names} | {"interests": sorted(form.get("interests", []))}


def _problems(entry: Mapping[str, Any], agreed: bool) -> dict[str, str]:
    """Return what is wrong with a registration, by field."""
    choices = content()
    checks = {
        "name": (
            0 < len(entry["name"]) <= 100 and "\n" not in entry["name"],
            "Please enter your name.",
        ),
        "email": (
            EMAIL.fullmatch(entry["email"]),
            "Please enter an e-mail address, such as name@mail.test.",
        ),
        "birth_date": (_is_past_date(entry["birth_date"]), "Please enter your date of birth."),
        "country": (entry["country"] in choices["countries"], "Please choose a country."),
        "course": (entry["course"] in choices["courses"], "Please choose a course."),
        "level": (entry["level"] in choices["levels"], "Please choose a level."),
        "interests": (
            set(entry["interests"]) <= set(choices["interests"]),
            "Please choose from the list.",
        ),
        "notes": (len(entry["notes"]) <= 1000, "Please use at most 1000 characters."),
        "agree": (agreed, "Please accept the house rules."),
    }
    return {name: message for name, (fine, message) in checks.items() if not fine}


def _is_past_date(text: str) -> bool:
    try:
        day = date.fromisoformat(text)
    except ValueError:
        return False
    # Python also reads 19900517 and 1990-W20-4, which nobody who looks at the state expects.
    return day.isoformat() == text and date(1900, 1, 1) <= day < TODAY


def _find_registration(request: Request, entries: Sequence[Mapping[str, Any]]) -> Mapping[str, Any]:
    """Return the registration with the number in the address.

    Raises:
        HTTPException: There is none (404).
    """
    for entry in entries:
        if str(entry["number"]) == request.path_params["number"]:
            return entry
    raise HTTPException(404)


def _registrations(request: Request) -> list[dict[str, Any]]:
    return site_state(request).read("forms").get("registrations", [])


async def home(request: Request) -> Response:
    """Return the first page."""
    return page(request, "home.html")


async def register(request: Request) -> Response:
    """Return the form, and its answers."""
    if request.method != "POST":
        entry = _registration({"course": [request.query_params.get("course", "")]})
        return _sheet(request, entry)
    entry, refused = await _answers(request)
    if refused is not None:
        return refused
    with site_state(request).update("forms") as state:
        registrations = state.setdefault("registrations", [])
        entry["number"] = FIRST_NUMBER + len(registrations)
        registrations.append(entry)
    return see_other(f"/registrations/{entry['number']}")


async def _answers(
    request: Request, number: int | None = None
) -> tuple[dict[str, Any], Response | None]:
    """Return what was entered, and the form once more if it cannot be accepted."""
    form = await fields(request)
    entry = _registration(form)
    agreed = first(form, "agree") == "yes"
    problems = _problems(entry, agreed)
    if not problems:
        return entry, None
    return entry, _sheet(request, entry, number, problems=problems, agreed=agreed)


def _sheet(
    request: Request,
    entry: Mapping[str, Any],
    number: int | None = None,
    problems: Mapping[str, str] | None = None,
    agreed: bool = False,
) -> Response:
    """Return the form, for a new registration or for the one of a number."""
    return page(
        request,
        "register.html",
        422 if problems else 200,
        entry=entry,
        number=number,
        problems=problems or {},
        agreed=agreed,
    )


async def confirmation(request: Request) -> Response:
    """Return a registration."""
    entry = _find_registration(request, _registrations(request))
    return page(request, "confirmation.html", entry=entry, over=_is_over(entry))


def _is_over(entry: Mapping[str, Any]) -> bool:
    return entry.get("cancelled", False)


def _open(request: Request, entries: Sequence[Mapping[str, Any]]) -> Mapping[str, Any]:
    """Return the registration with the number in the address, which was not cancelled.

    Raises:
        HTTPException: There is none (404), or it was cancelled (409).
    """
    entry = _find_registration(request, entries)
    if _is_over(entry):
        raise HTTPException(409, "This registration was cancelled.")
    return entry


async def change(request: Request) -> Response:
    """Return the form with what was entered, and its answers."""
    entry = _open(request, _registrations(request))
    if request.method != "POST":
        return _sheet(request, entry, entry["number"], agreed=True)
    answers, refused = await _answers(request, entry["number"])
    if refused is not None:
        return refused
    with site_state(request).update("forms") as state:
        registrations = state.get("registrations", [])
        registrations[registrations.index(_open(request, registrations))] = {
            **answers,
            "number": entry["number"],
        }
    return see_other(f"/registrations/{entry['number']}")


async def cancel(request: Request) -> Response:
    """Return the question whether a registration is to be cancelled, and its answer."""
    entry = _open(request, _registrations(request))
    if request.method != "POST":
        return page(request, "cancel.html", entry=entry)
    with site_state(request).update("forms") as state:
        registrations = state.get("registrations", [])
        registrations[registrations.index(_open(request, registrations))]["cancelled"] = True
    return see_other(f"/registrations/{entry['number']}")


async def find_registration(request: Request) -> Response:
    """Return the form that asks for a number and an e-mail address."""
    number = query(request, "number")
    email = query(request, "email")
    for entry in _registrations(request):
        if str(entry["number"]) == number and entry["email"].lower() == email.lower():
            return see_other(f"/registrations/{number}")
    problem = "There is no registration with this number and e-mail." if number or email else ""
    return page(
        request, "find.html", 422 if problem else 200, number=number, email=email, problem=problem
    )


async def feedback(request: Request) -> Response:
    """Return the form for what people think of a course, and its answers."""
    if request.method != "POST":
        entry = {"course": "", "rating": "", "comment": "", "quote": False}
        return page(request, "feedback.html", entry=entry, problem="")
    form = await fields(request)
    entry = {name: first(form, name) for name in ("course", "rating", "comment")}
    entry["comment"] = entry["comment"][:1000]
    fine = entry["course"] in content()["courses"] and entry["rating"] in content()["ratings"]
    record = {**entry, "quote": first(form, "quote") == "yes"}
    if not fine:
        problem = "Please choose a course and how you liked it."
        return page(request, "feedback.html", 422, entry=record, problem=problem)
    with site_state(request).update("forms") as state:
        state.setdefault("feedback", []).append(record)
    return see_other("/thanks")


async def thanks(request: Request) -> Response:
    """Return the page after feedback."""
    return page(request, "thanks.html")


async def rules(request: Request) -> Response:
    """Return the rules of the form."""
    return page(request, "rules.html")


def make(sites: SiteState) -> Starlette:
    """Return the application."""
    routes = [
        Route("/", home),
        Route("/register", register, methods=["GET", "POST"]),
        Route("/rules", rules),
        Route("/find", find_registration),
        Route("/registrations/{number}", confirmation),
        Route("/registrations/{number}/change", change, methods=["GET", "POST"]),
        Route("/registrations/{number}/cancel", cancel, methods=["GET", "POST"]),
        Route("/feedback", feedback, methods=["GET", "POST"]),
        Route("/thanks", thanks),
    ]
    return site("forms", routes, sites, lambda _: content())
