"""The guest server as an ASGI application."""

from starlette.applications import Starlette
from starlette.types import ASGIApp

from .machine import GuestMachine
from .request_checks import HANDLERS, TokenMiddleware
from .routes_files import Files
from .routes_observe import Observe
from .routes_run import RunRoutes


def make_app(machine: GuestMachine, token: str | None, osworld: bool = False) -> ASGIApp:
    """Serve `machine`.

    Every request needs `token`; with `osworld` OSWorld's routes need none, and without a token ours
    are closed.
    """
    routes = [route for part in (Observe, RunRoutes, Files) for route in part(machine).routes()]
    return TokenMiddleware(Starlette(routes=routes, exception_handlers=HANDLERS), token, osworld)
