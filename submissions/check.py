"""Check submissions to the leaderboard by the rules of submissions/README.md.

    python submissions/check.py NAME ...

The exit code is 1 if one of them cannot be merged.
"""

import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

from hijack_data.errors import HijackError
from online_env.report.build import build_report, read_report, reports_agree
from online_env.results import reading

FOLDER = Path(__file__).parent
RUN, REPORT, KEY = "run", "report.json", "key.pub"
_NAME = re.compile(r"[a-z0-9][a-z0-9_-]*")


def find_problems(submission: Path) -> Iterator[str]:
    """Yield why a submission cannot be merged, each with its remedy."""
    if not _NAME.fullmatch(submission.name):
        yield "its name may have lower-case letters, digits, - and _ only"
    if not submission.is_dir():
        yield f"{submission} is no folder"
        return
    present = {path.name for path in submission.iterdir()}
    missing = sorted({RUN, REPORT, KEY} - present)
    if missing:
        yield f"lacks {', '.join(missing)}; see submissions/README.md"
        return
    surplus = sorted(present - {RUN, REPORT, KEY})
    if surplus:
        yield f"holds {', '.join(surplus)}, which is no part of a submission; remove it"
    try:
        yield from _find_run_problems(submission)
    except HijackError as error:
        yield str(error)
    command = [sys.executable, "-m", "hijack_data.cli", "verify", submission / RUN]
    done = subprocess.run(
        [*command, "--key", submission / KEY], capture_output=True, text=True, check=False
    )
    if done.returncode:
        yield f"hijack verify ends with {done.returncode}:\n{done.stdout}{done.stderr}".rstrip()


def _find_run_problems(submission: Path) -> Iterator[str]:
    run = reading.read(submission / RUN)
    made = build_report(run)
    if run.missing:
        yield f"{run.missing} of {run.planned} episodes are missing; play them with --resume"
    if run.damaged:
        yield f"{len(run.damaged)} lines of the run cannot be read"
    invalid = sum(row.invalid for row in made.summaries)
    if invalid:
        yield f"{invalid} episodes are invalid; hijack bench --resume plays them again"
    stored = read_report(submission / REPORT)
    if not reports_agree(made, stored):
        place = f"submissions/{submission.name}"
        yield (
            f"{REPORT} is not the report of {RUN}/; make it with this version of the library:"
            f" hijack report {place}/{RUN} -o {place}/{REPORT}"
        )


def main() -> None:
    """Check the named submissions."""
    names = sys.argv[1:]
    if not names:
        sys.exit("usage: python submissions/check.py NAME ...")
    failed = False
    for name in names:
        problems = list(find_problems(FOLDER / name))
        failed = failed or bool(problems)
        for problem in problems or ["can be merged"]:
            print(f"{name}: {problem}")
    sys.exit(failed)


if __name__ == "__main__":
    main()
