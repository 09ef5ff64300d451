"""Tasks of a family that cannot be played here: a run is refused, or goes on without them."""

from collections.abc import Callable
from dataclasses import replace

from hijack_data.errors import ConfigError, ParameterError

from ..tasks import TASKS, find_family
from .config import Bench
from .providers import EMBEDDED


def only_playable(bench: Bench, unplayable: str, say: Callable[[str], object]) -> Bench:
    """Return the benchmark without the tasks of a family that cannot be played.

    Args:
        bench: The benchmark.
        unplayable: `refuse` the run, `skip` the tasks, or let their episodes count `zero`.
        say: Called with a line for each task that is left out, and one for all.

    Raises:
        ConfigError: The run is to be refused because of them, or no task is left.
    """
    family = find_family(bench.tasks)
    if family is None:
        return bench
    classes = {name: TASKS.get(name) for name in bench.tasks}
    reasons = family.find_unplayable(classes.values(), bench.files, bench.machines)
    if not reasons:
        return bench
    playable = tuple(name for name in bench.tasks if name not in reasons)
    count = f"{len(reasons)} of {len(bench.tasks)} tasks can't be played"
    if unplayable == "refuse" or not playable:
        lines = [f"{name}: {reason}" for name, reason in reasons.items()]
        remedy = "leave them out (--unplayable skip), or count them as 0 (--unplayable zero)"
        raise ConfigError([*lines, f"{count}; {remedy}"])
    for name, reason in reasons.items():
        say(f"not played: {name}: {reason}")
    say(f"{count} and {'count 0' if unplayable == 'zero' else 'are left out'}")
    return replace(
        bench,
        tasks=playable,
        unplayable={
            name: {
                "reason": reason,
                "apps": list(classes[name].apps),
                "infeasible": bool(classes[name].infeasible),
            }
            for name, reason in reasons.items()
        },
        unplayable_score=0.0 if unplayable == "zero" else None,
    )


def check_machines(bench: Bench, episodes: int) -> None:
    """Check that tasks of a family can be played on what the benchmark names; nothing is started.

    A `HijackError` says what is wrong with machines of the user.

    Args:
        bench: The benchmark.
        episodes: How many episodes will be played.

    Raises:
        ParameterError: The tasks are not played on embedded desktops.
    """
    family = find_family(bench.tasks)
    if family is None:
        return
    if bench.provider == EMBEDDED and family.provider != EMBEDDED:
        raise ParameterError(
            f"{family.title}'s tasks are played by desktop: {{provider: {family.provider}}}, and"
            f" {bench.source} has {EMBEDDED}"
        )
    if bench.machines is not None:
        family.check_machines(bench.machines, episodes)
