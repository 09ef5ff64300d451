"""A set of corruptions under which an agent did badly: the file that `hijack search` writes.

The file is a closed world: it has these fields and no others, its digest covers all of them, and
each corruption names the digest of its plans, so that a library that plans otherwise is noticed.
"""

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import yaml

from hijack_data.config import dump, load_config
from hijack_data.errors import HijackError, shorten_list
from hijack_data.file_io import read_versioned_json, write_atomic
from hijack_data.plan import CLEAN, Plan
from hijack_data.planner import Planner
from hijack_data.types import Size

FORMAT = "agenthijack-plan-set"
VERSION = 1
PLANNED_STEPS = 15  # steps of an episode whose plans are compared when the file is read
_FIELDS = {"agent", "search", "bench", "size", "plans"}
_ENTRY_FIELDS = {"label", "corruption", "plans_sha256", "found", "confirmed"}
_LOSS_FIELDS = {"loss", "n"}


class PlanSetError(HijackError, ValueError):
    """A file that is no set of plans, was edited, or is planned otherwise by this version."""


class Loss(NamedTuple):
    """What a corruption costs: a mean difference of scores, -1 to 1, over `n` cases."""

    loss: float
    n: int


@dataclass(frozen=True, kw_only=True)
class WorstPlan:
    """A corruption that a search has found.

    Args:
        label: Its name in runs.
        planner: The corruption.
        found: Its loss over the cases of the search.
        confirmed: Its loss over cases that the search did not use.
    """

    label: str
    planner: Planner
    found: Loss
    confirmed: Loss

    @property
    def shrinkage(self) -> float:
        """How much of the loss that was found was luck: found minus confirmed."""
        return self.found.loss - self.confirmed.loss


@dataclass(frozen=True, kw_only=True)
class PlanSet:
    """The result of a search.

    Args:
        agent: Whose losses these are.
        search: How they were found, as JSON data.
        bench: A benchmark's settings without corruptions, as in its file; `None` for a search over
            the rows of a dataset.
        size: `(height, width)` of the screen for which the plans are compared.
        plans: The worst first.
    """

    agent: str
    search: Mapping[str, Any]
    bench: Mapping[str, Any] | None
    size: Size
    plans: Sequence[WorstPlan]

    @property
    def planners(self) -> dict[str, Planner | None]:
        """The clean condition and the corruptions, by label."""
        return {CLEAN: None, **{plan.label: plan.planner for plan in self.plans}}

    def selection_notice(self, agents: Sequence[str]) -> str:
        """Return why losses of the searched agent are too large when the set is played again.

        Args:
            agents: Those that play it.

        Returns:
            "" if others play it, for whom the corruptions were not chosen.
        """
        if self.agent not in agents:
            return ""
        confirmed = (
            f"{plan.label} {100 * plan.confirmed.loss:.1f}"
            for plan in self.plans
            if plan.confirmed.n
        )
        return (
            f"these corruptions were chosen as the worst of {self.agent}, so on cases of the search"
            " its losses are partly luck; on those that the search did not use it lost, in points:"
            f" {', '.join(confirmed)}"
        )

    def write(self, path: Path) -> None:
        """Write the file, whole or not at all."""
        body = {
            "agent": self.agent,
            "search": dict(self.search),
            "bench": None if self.bench is None else dict(self.bench),
            "size": list(self.size),
            "plans": [_to_data(plan, self.size) for plan in self.plans],
        }
        data = {"format": FORMAT, "version": VERSION, **body, "digest": _digest(body)}
        write_atomic(path, json.dumps(data, indent=1, ensure_ascii=False) + "\n")


def read_plan_set(path: Path) -> PlanSet:
    """Read a file that `PlanSet.write` wrote.

    Raises:
        PlanSetError: It is another file, was edited, or holds no corruption; or this version plans
            otherwise.
    """
    data = read_versioned_json(
        path,
        format=FORMAT,
        version=VERSION,
        description="a set of plans (worst.json of hijack search)",
        error=PlanSetError,
    )
    body = {key: value for key, value in data.items() if key not in ("format", "version")}
    digest = body.pop("digest", None)
    if digest != _digest(body):
        raise PlanSetError(f"{path}: was edited, its digest is another; search again")
    try:
        _check_fields(body, _FIELDS, "the file")
        height, width = body["size"]
        plans = [_from_data(entry, (height, width)) for entry in body["plans"]]
    except (HijackError, TypeError, ValueError, KeyError, AttributeError) as error:
        raise PlanSetError(f"{path}: {error}") from None
    if not plans:
        raise PlanSetError(f"{path} holds no corruption: none cost anything in its search")
    return PlanSet(
        agent=body["agent"],
        search=body["search"],
        bench=body["bench"],
        size=(height, width),
        plans=plans,
    )


def plan_episode(planner: Planner, size: Size) -> Sequence[Plan]:
    """Return the plans of an episode of seed 0 on a screen whose elements are not known.

    Args:
        planner: what plans.
        size: `(height, width)` of the screen.

    Raises:
        HijackError: it cannot be planned there.
    """
    from ..environment.script import Script  # its package needs Linux or macOS

    return Script(planner, 0, "", (), size).plan_ahead(PLANNED_STEPS)


def _to_data(plan: WorstPlan, size: Size) -> dict[str, Any]:
    (entry,) = yaml.safe_load(dump({plan.label: plan.planner}))["corruptions"]
    return {
        "label": plan.label,
        "corruption": entry,
        "plans_sha256": _plans_digest(plan.planner, size),
        "found": plan.found._asdict(),
        "confirmed": plan.confirmed._asdict(),
    }


def _from_data(entry: Mapping[str, Any], size: Size) -> WorstPlan:
    """Read one corruption.

    Raises:
        PlanSetError: Its fields are others, or this version plans it otherwise.
        ConfigError: Its corruption is none.
    """
    _check_fields(entry, _ENTRY_FIELDS, "an entry of plans")
    for name in ("found", "confirmed"):
        _check_fields(entry[name], _LOSS_FIELDS, name)
    planners = load_config({"corruptions": [entry["corruption"]]}).corruptions
    label = entry["label"]
    if list(planners) != [label]:
        raise PlanSetError(f"{label!r} is the label of {', '.join(planners)!r}")
    if _plans_digest(planners[label], size) != entry["plans_sha256"]:
        raise PlanSetError(
            f"{label}: this version of the library plans it otherwise than the one that searched;"
            " search again, or use that version"
        )
    return WorstPlan(
        label=label,
        planner=planners[label],
        found=Loss(**entry["found"]),
        confirmed=Loss(**entry["confirmed"]),
    )


def _check_fields(data: Mapping[str, Any], fields: set[str], where: str) -> None:
    """Check that data has exactly some fields.

    Raises:
        PlanSetError: A field is missing or unknown.
    """
    wrong = sorted(set(data) ^ fields)
    if wrong:
        raise PlanSetError(f"{where} lacks or has unknown fields: {shorten_list(wrong)}")


def _plans_digest(planner: Planner, size: Size) -> str:
    """Return the SHA-256 over the plans of seed 0 on a screen whose elements are not known."""
    digests = (plan.digest() for plan in plan_episode(planner, size))
    return hashlib.sha256("".join(digests).encode()).hexdigest()


def _digest(body: Mapping[str, Any]) -> str:
    text = json.dumps(body, sort_keys=True, separators=(",", ":"), ensure_ascii=False)
    return hashlib.sha256(text.encode("utf-8", "surrogatepass")).hexdigest()
