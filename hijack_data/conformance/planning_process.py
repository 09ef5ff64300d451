"""A fresh process that plans: it reads jobs from standard input and writes digests as JSON."""

import json
import os
import pickle
import sys
from collections.abc import Mapping
from typing import Any


def digest(spec: Any, scene: Any, key: Mapping[str, Any]) -> str:
    """Return the digest of a plan, or the name of the error that planning raises."""
    try:
        return spec.plan(scene, **key).digest()
    except Exception as error:  # noqa: BLE001  (a plug-in may raise anything)
        return type(error).__name__


def main() -> None:
    """Plan the jobs from standard input: a line with the import path, then the pickled jobs."""
    with os.fdopen(os.dup(1), "w") as answer:
        os.dup2(2, 1)  # a plug-in may print
        sys.path[:] = json.loads(sys.stdin.buffer.readline())
        jobs = pickle.loads(sys.stdin.buffer.read())  # noqa: S301  (from the parent process)
        json.dump([digest(*job) for job in jobs], answer)


if __name__ == "__main__":
    main()
