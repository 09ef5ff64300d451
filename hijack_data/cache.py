"""A cache that is bounded in bytes and safe to share among threads."""

import os
from collections import OrderedDict
from threading import Lock
from typing import Any
from weakref import WeakSet


class Cache:
    """An LRU cache of at most `limit` bytes that always keeps the last value, whatever its size."""

    def __init__(self, limit: int) -> None:
        self.limit = limit
        self.used = 0
        self.items: OrderedDict[Any, tuple[Any, int]] = OrderedDict()
        self.lock = Lock()
        _caches.add(self)

    def get(self, key: Any) -> Any:
        """Return the value of a key, or `None` if it is not cached."""
        with self.lock:
            if key not in self.items:
                return None
            self.items.move_to_end(key)
            return self.items[key][0]

    def put(self, key: Any, value: Any, nbytes: int) -> None:
        """Cache a value that takes `nbytes`, and drop the least recently used ones."""
        with self.lock:
            _, replaced = self.items.pop(key, (None, 0))
            self.used += nbytes - replaced
            self.items[key] = value, nbytes
            while self.used > self.limit and len(self.items) > 1:
                _, (_, freed) = self.items.popitem(last=False)
                self.used -= freed


_caches: WeakSet[Cache] = WeakSet()


def _renew_locks() -> None:
    """Replace all locks in a forked child, where a thread that held one no longer exists."""
    for cache in _caches:
        cache.lock = Lock()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_renew_locks)
