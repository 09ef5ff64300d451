"""A cache that is bounded in bytes and may be shared by threads."""

import os
from collections import OrderedDict
from threading import Lock
from typing import Any
from weakref import WeakSet


class Cache:
    """Values by key, least recently used first out: at most `limit` bytes, but always the last."""

    def __init__(self, limit: int) -> None:
        self.limit = limit
        self.used = 0
        self.items: OrderedDict[Any, tuple[Any, int]] = OrderedDict()
        self.lock = Lock()
        _caches.add(self)

    def get(self, key: Any) -> Any:
        """Return the value, or `None`."""
        with self.lock:
            if key not in self.items:
                return None
            self.items.move_to_end(key)
            return self.items[key][0]

    def put(
        self,
        key: Any,
        value: Any,
        nbytes: int,
    ) -> None:
        """Keep a value that takes `nbytes`."""
        with self.lock:
            _, replaced = self.items.pop(key, (None, 0))
            self.used += nbytes - replaced
            self.items[key] = value, nbytes
            while self.used > self.limit and len(self.items) > 1:
                _, (_, freed) = self.items.popitem(last=False)
                self.used -= freed


_caches: WeakSet[Cache] = WeakSet()


def _renew_locks() -> None:
    """In a forked child: a thread that held a lock at the fork is not there to release it."""
    for cache in _caches:
        cache.lock = Lock()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_renew_locks)
