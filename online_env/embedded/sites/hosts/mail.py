"""mail.test: the mailbox of one person, already signed in.

State, `mail.json`: `{"sent": [message], "drafts": [message], "flags": {ID: {"read": bool,
"starred": bool, "folder": "inbox" | "archive" | "trash"}}, "received": [mail]}`. A message is
`{"id", "to": [address], "cc": [address], "subject", "body"}`. What is in the inbox to begin with is
in `content/mail.yaml`; a task may add mails of that shape to `received`.
"""

from collections.abc import Mapping
from functools import cache
from typing import Any

from starlette.applications import Starlette
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import Response
from starlette.routing import Route

from ..hosts_and_dates import TODAY
from ..library import load
from ..pages import fields, first, page, query, see_other, site, site_state
from ..state import SiteState
from .forms import EMAIL

HOST = "mail.test"
FOLDERS = {
    "inbox": "Inbox",
    "starred": "Starred",
    "sent": "Sent",
    "drafts": "Drafts",
    "archive": "Archive",
    "trash": "Trash",
}
_ACTIONS: dict[str, dict[str, Any]] = {
    "star": {"starred": True},
    "unstar": {"starred": False},
    "read": {"read": True},
    "unread": {"read": False},
    "archive": {"folder": "archive"},
    "trash": {"folder": "trash"},
    "inbox": {"folder": "inbox"},
}


@cache
def content() -> dict[str, Any]:
    """`content/mail.yaml`."""
    return load("mail")


def received(state: dict[str, Any]) -> list[dict[str, Any]]:
    """Return the received messages with their flags, newest first."""
    messages = [*state.get("received", []), *content()["messages"]]
    flags = state.get("flags", {})
    fresh = {
        "read": False,
        "starred": False,
        "folder": "inbox",
        "to": [content()["owner"]["address"]],
        "cc": [],
    }
    return [
        {**fresh, **m, **flags.get(m["id"], {})}
        for m in sorted(messages, key=lambda m: m["date"], reverse=True)
    ]


def _own_messages(state: dict[str, Any], folder: str) -> list[dict[str, Any]]:
    """Sent messages or drafts, newest first, in the shape of the received ones."""
    common = {
        "from": content()["owner"],
        "date": f"{TODAY}T12:00",
        "read": True,
        "starred": False,
        "folder": folder,
    }
    return [{**common, **m} for m in reversed(state.get(folder, []))]


def _in_folder(state: dict[str, Any], folder: str) -> list[dict[str, Any]]:
    if folder in ("sent", "drafts"):
        return _own_messages(state, folder)
    mails = received(state)
    if folder == "starred":
        return [m for m in mails if m["starred"] and m["folder"] != "trash"]
    return [m for m in mails if m["folder"] == folder]


def _common(request: Request) -> dict[str, object]:
    state = site_state(request).read("mail")
    unread = sum(not m["read"] for m in _in_folder(state, "inbox"))
    return {
        "owner": content()["owner"],
        "folders": FOLDERS,
        "folder": None,
        "unread": unread,
        "drafts": len(state.get("drafts", [])),
        "query": query(request, "q"),
    }


async def folder(request: Request) -> Response:
    """Return the messages of a folder.

    Raises:
        HTTPException: There is no such folder (404).
    """
    name = request.path_params.get("folder", "inbox")
    if name not in FOLDERS:
        raise HTTPException(404)
    messages = _in_folder(site_state(request).read("mail"), name)
    return page(request, "list.html", folder=name, heading=FOLDERS[name], messages=messages)


async def search(request: Request) -> Response:
    """Return the messages with certain words."""
    text = query(request, "q").lower()
    state = site_state(request).read("mail")
    everything = received(state) + _own_messages(state, "sent")
    matches = [
        m for m in everything if text in f"{m['from']['name']} {m['subject']} {m['body']}".lower()
    ]
    return page(
        request,
        "list.html",
        heading=f"Search: {query(request, 'q')}",
        messages=matches if text else [],
    )


def _find(state: dict[str, Any], ident: str) -> dict[str, Any]:
    for letter in received(state) + _own_messages(state, "sent"):
        if letter["id"] == ident:
            return letter
    raise HTTPException(404)


async def message(request: Request) -> Response:
    """One message."""
    ident = request.path_params["id"]
    letter = _find(site_state(request).read("mail"), ident)
    if not letter["read"]:
        _flag(site_state(request), ident, {"read": True})
    return page(request, "message.html", message=letter, folder=letter["folder"])


def _flag(sites: SiteState, ident: str, change: dict[str, Any]) -> None:
    with sites.update("mail") as state:
        state.setdefault("flags", {}).setdefault(ident, {}).update(change)


async def act(request: Request) -> Response:
    """Move or mark messages.

    Raises:
        HTTPException: There is no such message or action (404).
    """
    ident = request.path_params["id"]
    action = request.path_params["action"]
    idents = {m["id"] for m in received(site_state(request).read("mail"))}
    if action not in _ACTIONS or ident not in idents:
        raise HTTPException(404)
    folder = first(await fields(request), "back", "inbox")
    _flag(site_state(request), ident, _ACTIONS[action])
    if folder == "message":
        return see_other(f"/message/{ident}")
    return see_other(f"/folder/{folder}" if folder in FOLDERS else "/")


async def compose(request: Request) -> Response:
    """Return the form for a new message."""
    draft = {"to": query(request, "to"), "cc": "", "subject": "", "body": ""}
    replied = query(request, "reply")
    passed_on = query(request, "forward")
    draft_id = query(request, "draft")
    state = site_state(request).read("mail")
    if replied:
        original = _find(state, replied)
        quoted = "\n".join(f"> {line}" for line in original["body"].splitlines())
        subject = (
            original["subject"]
            if original["subject"].startswith("Re: ")
            else f"Re: {original['subject']}"
        )
        draft |= {"to": original["from"]["address"], "subject": subject, "body": f"\n\n{quoted}"}
    if passed_on:
        draft |= forwarded(_find(state, passed_on))
    for saved in state.get("drafts", []):
        if saved["id"] == draft_id:
            draft = {**saved, "to": ", ".join(saved["to"]), "cc": ", ".join(saved["cc"])}
    return page(
        request,
        "compose.html",
        draft=draft,
        opened=draft.get("id", ""),
        problem="",
        contacts=content()["contacts"],
    )


def forwarded(original: Mapping[str, Any]) -> dict[str, str]:
    """Return the subject and the body of a message that hands on another one."""
    sender = f"{original['from']['name']} <{original['from']['address']}>"
    head = f"\n\n---------- Forwarded message ----------\nFrom: {sender}"
    body = f"{head}\nSubject: {original['subject']}\n\n{original['body']}"
    return {"subject": f"Fwd: {original['subject']}", "body": body}


async def send(request: Request) -> Response:
    """Send a message, or keep it as a draft."""
    form = await fields(request)
    is_draft = first(form, "action") == "draft"
    to, cc = (_addresses(first(form, name)) for name in ("to", "cc"))
    letter = {
        "to": to,
        "cc": cc,
        "subject": first(form, "subject")[:200],
        "body": first(form, "body"),
    }
    problem = "" if is_draft else _problem(to, cc)
    if problem:
        draft = {**letter, "to": first(form, "to"), "cc": first(form, "cc")}
        return page(
            request,
            "compose.html",
            422,
            draft=draft,
            opened=first(form, "draft"),
            problem=problem,
            contacts=content()["contacts"],
        )
    _store(
        site_state(request), "drafts" if is_draft else "sent", letter, replaces=first(form, "draft")
    )
    return see_other("/folder/drafts" if is_draft else "/folder/sent")


def _addresses(text: str) -> list[str]:
    return [a.strip() for a in text.replace(";", ",").split(",") if a.strip()]


def _problem(to: list[str], cc: list[str]) -> str:
    if not to:
        return "Please enter at least one recipient."
    invalid = [a for a in to + cc if not EMAIL.fullmatch(a)]
    return f"{invalid[0]} is no e-mail address." if invalid else ""


def _store(sites: SiteState, folder: str, letter: dict[str, Any], replaces: str) -> None:
    with sites.update("mail") as state:
        state["drafts"] = [d for d in state.get("drafts", []) if d["id"] != replaces]
        state["count"] = state.get("count", 0) + 1
        state.setdefault(folder, []).append({"id": f"s{state['count']:02d}", **letter})


def make(sites: SiteState) -> Starlette:
    """Return the application."""
    routes = [
        Route("/", folder),
        Route("/folder/{folder}", folder),
        Route("/search", search),
        Route("/compose", compose),
        Route("/message/{id}", message),
        Route("/message/{id}/{action}", act, methods=["POST"]),
        Route("/send", send, methods=["POST"]),
    ]
    return site("mail", routes, sites, _common)
