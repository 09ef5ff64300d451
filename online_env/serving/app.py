"""The web application: OpenEnv's routes, `/health` and `/metrics`."""

from functools import partial

from openenv.core.env_server.http_server import create_app  # pyright: ignore[reportMissingImports]
from openenv.core.env_server.types import ConcurrencyConfig  # pyright: ignore[reportMissingImports]
from starlette.requests import Request
from starlette.responses import JSONResponse, Response
from starlette.routing import Route
from starlette.types import ASGIApp

from hijack_data.errors import HijackError

from .access import HEALTH, AccessGuard
from .errors import ServerBusyError
from .limits import RequestLimits
from .openenv_env import NAME, DesktopAction, DesktopEnvironment, DesktopObservation, DesktopState
from .service import DesktopService

METRICS = "/metrics"
PROMETHEUS = "text/plain; version=0.0.4; charset=utf-8"
SESSION_TIMEOUT_LEASES = 4  # number of leases after which OpenEnv ends a session without a desktop
MIN_SESSION_TIMEOUT_S = 3600.0  # seconds


def make_app(service: DesktopService, *, sessions: int, token: str | None) -> ASGIApp:
    """Return the application of a server.

    Args:
        service: What the sessions share.
        sessions: How many clients may be connected at a time.
        token: The token that clients must send; without one only programs of this machine are
            answered.
    """
    app = create_app(
        partial(DesktopEnvironment, service),
        DesktopAction,
        DesktopObservation,
        env_name=NAME,
        state_cls=DesktopState,
        concurrency_config=ConcurrencyConfig(
            max_concurrent_envs=sessions,
            session_timeout=max(MIN_SESSION_TIMEOUT_S, SESSION_TIMEOUT_LEASES * service.lease),
        ),
    )

    async def health(_: Request) -> Response:
        return _health(service)

    async def metrics(_: Request) -> Response:
        return Response(service.metrics.text(), media_type=PROMETHEUS)

    # Placed before OpenEnv's own route, which would call a server without a desktop healthy.
    app.router.routes.insert(0, Route(HEALTH, health))
    app.router.routes.insert(0, Route(METRICS, metrics))
    app.add_exception_handler(HijackError, _answer_error)
    return AccessGuard(RequestLimits(app), token)


def _health(service: DesktopService) -> Response:
    counts = service.pool.counts()
    is_healthy = counts.free + counts.lent > 0
    content = {
        "status": "healthy" if is_healthy else "unhealthy",
        "desktops": {"free": counts.free, "lent": counts.lent, "starting": counts.starting},
        "waiting": counts.waiting,
    }
    return JSONResponse(content, 200 if is_healthy else 503)


async def _answer_error(_: Request, error: Exception) -> Response:
    """Answer OpenEnv's HTTP routes, which do not support sessions, with the error."""
    if isinstance(error, ServerBusyError):
        headers = {"Retry-After": str(error.retry_after)}
        return JSONResponse({"detail": str(error)}, 503, headers)
    return JSONResponse({"detail": str(error)}, 400)
