"""The names in a run's log, and how its parts are chained.

`online_env` writes the log and `pipelines` reads it; neither imports the other.

    RUN/run.json                    what was to be run; `episodes` lists the ids of all episodes
    RUN/records.jsonl               one record a line, as the episodes ended
    RUN/sessions.jsonl              one line for each time that the run was resumed
    RUN/seal.json, seal.json.sig    what the run consists of, and a signature, if it was signed
    RUN/lock                        held by the process that writes the run
    RUN/requests/<id>.jsonl         what the agent of an episode asked models
    RUN/texts/                      what agents have read from pictures, shared by processes
    RUN/episodes/<id>/episode.json  the record, written last
    RUN/episodes/<id>/steps.jsonl   line k: observation k, and the action that followed it
    RUN/episodes/<id>/frames/       the clean screens, and the agent's pictures that differ

Everything names the SHA-256 of what was written before it:

* a line of `steps.jsonl` that of the line before (`previous`), the first that of the episode's id;
* `episode.json` that of the last line (`chain`), and how many there are (`lines`);
* a line of `records.jsonl` that of `episode.json` (`episode_sha256`), and that of the line before
  (`previous`), the first that of `run.json`.

So an edit is detected unless everything after it is rewritten. A complete rewrite leaves no trace
in the folder; only the signature of `seal.json` protects against it (see `hijack_data.runs.seal`).

A record states what its agent was given in addition to instruction and pictures
(`GIVEN`).
"""

import hashlib
import re
from pathlib import Path

FORMAT = "agenthijack-run"
VERSION = 3
RUN = "run.json"
RECORDS = "records.jsonl"
EPISODES = "episodes"
SESSIONS = "sessions.jsonl"
LOCK = "lock"
EPISODE = "episode.json"
STEPS = "steps.jsonl"
REQUESTS = "requests"  # what agents asked models, a file an episode
TEXTS = "texts"  # what agents have read from pictures
FRAMES = "frames"
SEAL = "seal.json"
SIGNATURE = "seal.json.sig"
SCORE_RUN = "score"  # `config.kind` of a run of `hijack score`; one of `hijack bench` has no kind
# In a record of such a run: the row of the dataset; such a record has no folder in `episodes`.
ROW = "row"
LINKS = ("previous", "episode_sha256")  # in a line of `records.jsonl`, but not in `episode.json`
GIVEN = "given"  # in a record: a list of `GIVEN_KINDS`, or `null` if unknown
# The task with the machine; the task's plan in words; the runner's process (`--in-process`).
GIVEN_KINDS = ("task", "plan", "process")
MAX_TEXT = 65_536  # characters kept of an agent's words, and of an action, in a step
CUT = "cut"  # in a step: those of `said` and `raw` that were longer; absent if none was

_LONGEST = 200  # characters of an id, which is the name of a folder
_FOREIGN = re.compile(r"[^\w.+-]+", re.ASCII)
_USUAL = re.compile(r"[:/]")  # of names such as file.py:Class and trajectory/step


def find_run(folder: Path) -> Path:
    """Return the folder of a run: `folder`, or its `run` where a result is published.

    A published result is a folder with `report.json` and the records in `run/`.
    """
    published = folder / "run"
    if not (folder / RUN).exists() and (published / RUN).is_file():
        return published
    return folder


def episode_slug(task: str, label: str, seed: int, agent: str, attempt: int) -> str:
    """Return the id of an episode, which is also the name of its folder."""
    parts = [task, label, f"s{seed}", agent]
    if attempt:
        parts.append(f"a{attempt}")
    cleaned = [_FOREIGN.sub("_", part) or "_" for part in parts]
    slug = "__".join(cleaned).lstrip(".")
    if len(slug) <= _LONGEST:
        return slug
    digest = hashlib.blake2b(slug.encode(), digest_size=8).hexdigest()
    return f"{slug[: _LONGEST - 17]}-{digest}"


def row_slug(task: str, variant: str, label: str, seed: int, agent: str) -> str:
    """Return the id of a row that is scored: trajectory, step, condition, seed and agent.

    Trajectories may be named in any script, of which an id keeps nothing: then a digest tells them
    apart.
    """
    name = f"{task}/{variant}"
    if _FOREIGN.search(_USUAL.sub("", name)):
        name += f"-{hashlib.blake2b(name.encode(), digest_size=8).hexdigest()}"
    return episode_slug(name, label, seed, agent, 0)


def sha256_hex(content: bytes) -> str:
    """Return the SHA-256 of a file, or of a line without its end, as 64 hexadecimal digits."""
    return hashlib.sha256(content).hexdigest()


def file_digest(path: Path) -> str | None:
    """Return the SHA-256 of a file; `None` if there is none, or something else in its place."""
    return sha256_hex(path.read_bytes()) if path.is_file() else None
