"""The counters of a server, in Prometheus' format."""

import contextlib
import time
from collections.abc import Generator, Iterator
from typing import TYPE_CHECKING

from prometheus_client import (
    CollectorRegistry,
    Counter,
    Histogram,
    ProcessCollector,
    generate_latest,
)
from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily, Metric
from prometheus_client.registry import Collector

if TYPE_CHECKING:
    from .pool import DesktopPool

BUCKETS_S = (0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 60.0)


class _PoolCollector(Collector):
    """Reads the state of the pool whenever metrics are collected."""

    def __init__(self, pool: "DesktopPool") -> None:
        self._pool = pool

    def collect(self) -> Iterator[Metric]:
        counts = self._pool.counts()
        desktops = GaugeMetricFamily(
            "hijack_desktops", "Desktops by what they do", labels=["state"]
        )
        for state in ("free", "lent", "starting"):
            desktops.add_metric([state], getattr(counts, state))
        yield desktops
        yield GaugeMetricFamily(
            "hijack_waiting_sessions", "Sessions that wait for a desktop", counts.waiting
        )
        yield CounterMetricFamily(
            "hijack_desktops_replaced", "Desktops that ended and were replaced", self._pool.replaced
        )


class ServerMetrics:
    """Counters of one server.

    Args:
        pool: Its desktops.
    """

    def __init__(self, pool: "DesktopPool") -> None:
        registry = CollectorRegistry()
        registry.register(_PoolCollector(pool))
        ProcessCollector(registry=registry)  # memory, file descriptors, processor time
        self._registry = registry
        self.sessions = Counter("hijack_sessions", "Sessions that were opened", registry=registry)
        self.resets = Counter(
            "hijack_resets", "Calls of reset by what came of them", ["outcome"], registry=registry
        )
        self.steps = Counter("hijack_steps", "Actions that were taken", registry=registry)
        self.episodes = Counter(
            "hijack_episodes",
            "Episodes that ended, by corruption and status",
            ["corruption", "status"],
            registry=registry,
        )
        self.broken_off = Counter(
            "hijack_episodes_broken_off",
            "Episodes whose client left or was silent",
            registry=registry,
        )
        self.expired = Counter(
            "hijack_leases_expired",
            "Desktops that were taken back from a silent client",
            registry=registry,
        )
        self._reset_seconds = _seconds("hijack_reset_seconds", "Time of a reset", registry)
        self._step_seconds = _seconds("hijack_step_seconds", "Time of a step", registry)
        self._wait_seconds = _seconds(
            "hijack_wait_seconds", "Time until a desktop was free", registry
        )

    def text(self) -> bytes:
        """Return all metrics."""
        return generate_latest(self._registry)

    @contextlib.contextmanager
    def resetting(self) -> Generator[None]:
        """Time a reset, with the wait for a desktop."""
        with _timed(self._reset_seconds):
            yield

    @contextlib.contextmanager
    def stepping(self) -> Generator[None]:
        """Time a step, and count it."""
        with _timed(self._step_seconds):
            yield
        self.steps.inc()

    @contextlib.contextmanager
    def waiting(self) -> Generator[None]:
        """Time the wait for a desktop."""
        with _timed(self._wait_seconds):
            yield


def _seconds(name: str, about: str, registry: CollectorRegistry) -> Histogram:
    return Histogram(name, f"{about}, in seconds", registry=registry, buckets=BUCKETS_S)


@contextlib.contextmanager
def _timed(histogram: Histogram) -> Generator[None]:
    """Observe how long the block took, unless it raises."""
    start = time.monotonic()
    yield
    histogram.observe(time.monotonic() - start)
