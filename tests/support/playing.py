"""What plays episodes in processes of their own, without a desktop."""

import os
import signal
import time
from pathlib import Path

from hijack_data.errors import UnknownNameError
from online_env.bench.workers import answer_calls


class Unportable(Exception):
    """Cannot be made anew from its arguments."""

    def __init__(self, one, two):
        super().__init__(f"{one} and {two}")


def serve(connection, setup):
    """Answer with the process that plays; the task's name says what else happens."""

    def episode(job, attempt):
        mark = Path(setup.folder) / f"{job.task}-{attempt}"
        mark.write_text(str(os.getpid()))
        if job.task == "refused":
            raise UnknownNameError("no such thing")
        if job.task == "unportable":
            raise Unportable("this", "that")
        if job.task == "killed_once" and attempt == 0:
            os.kill(os.getpid(), signal.SIGKILL)
        if job.task == "exits":
            os._exit(3)
        if job.task == "slow":
            time.sleep(60)
        return {
            "id": f"{job.task}-{attempt}",
            "agent": job.agent,
            "task": job.task,
            "task_seed": 0,
            "corruption": job.corruption,
            "seed": job.seed,
            "status": "ok",
            "score": 1.0,
            "reason": "",
            "problem": "",
            "steps": 1,
            "seconds": 0.1,
            "process": os.getpid(),
            "attempt": attempt,
        }

    answer_calls(connection, episode)
