"""Keep an output of a command from replacing a file of the run that it reads."""

from pathlib import Path

from ..errors import HijackError
from .run_log import EPISODE, EPISODES, LOCK, RECORDS, RUN, SEAL, SESSIONS, SIGNATURE, STEPS

RUN_FILES = frozenset({RUN, RECORDS, SESSIONS, LOCK, SEAL, SIGNATURE})
EPISODE_FILES = frozenset({EPISODE, STEPS})


def refuse_own_file(path: Path, option: str) -> None:
    """Refuse an output that would replace a file which a run consists of.

    Args:
        path: Where a command is to write.
        option: The option that named it, for the message.

    Raises:
        HijackError: The path is that of a file of a run.
    """
    real_path = path.resolve()
    at_the_top = real_path.name in RUN_FILES and (real_path.parent / RUN).is_file()
    of_an_episode = real_path.name in EPISODE_FILES and real_path.parent.parent.name == EPISODES
    if at_the_top or of_an_episode:
        raise HijackError(f"{option} {path}: is a file of the run itself; give another name")
