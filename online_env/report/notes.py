"""Sentences that a reader of a report has to know in addition to its numbers."""

import json
from collections import Counter
from collections.abc import Hashable, Iterator, Mapping
from typing import Any

from hijack_data.errors import quantity, shorten_list
from hijack_data.plan import CLEAN
from hijack_data.runs.amounts import is_count
from hijack_data.runs.privileged_inputs import describe_privileged_inputs
from hijack_data.runs.run_log import UNTIL_RETENTION

from ..results import scores
from ..results.episode_columns import EpisodeColumns
from ..results.outcomes import RESULTS
from ..results.reading import Run
from .formatting import SIGNIFICANT_P
from .identity import played_commits
from .model import UNPAIRED_NOTE, RunReport


def report_notes(report: RunReport, partial: int = 0) -> tuple[str, ...]:
    """Return the notes on a report, of whose scores `partial` are neither 0 nor 1."""
    return tuple(_notes(report, partial))


def unscored_note(run: Run) -> Iterator[str]:
    """Yield which rows of its dataset a scoring run leaves out."""
    left_out = {
        "unscored": ("row", "with an action of no known type"),
        "unchanged": ("corrupted row", "with the clean picture"),
    }
    for key, (rows, reason) in left_out.items():
        count = run.config.get(key)
        if run.is_scored and is_count(count) and count:
            yield f"Not scored: {quantity(count, rows)} {reason}."


def recovery_note(run: Run) -> Iterator[str]:
    """Yield the recovery policy of a live run, and who asked for it; nothing for a scoring run."""
    if not run.is_live:
        return
    counts_by_agent: dict[str, Counter[str]] = {}
    for record in run.last_attempts:
        counts = record.get("recovery")
        if isinstance(counts, dict) and counts.get("requests"):
            agent_counts = counts_by_agent.setdefault(record["agent"], Counter())
            agent_counts.update({key: n for key, n in counts.items() if isinstance(n, int)})
    with_guard = " with its guard" if run.config.get("guard") else ""
    requests = [
        f"{agent}{with_guard} asked {total['requests']} times to be re-initialised"
        f" ({total['false_alarms']} false alarms), and {total['repaired']} were repaired"
        for agent, total in counts_by_agent.items()
        if total["requests"]
    ]
    summary = "; ".join(requests) or "no agent asked to be re-initialised"
    yield f"Recovery policy {run.config.get('recovery', 'unknown')}: {summary}."


def error_order_note(run: Run) -> Iterator[str]:
    """Yield how many episodes met their environment errors after the set-up, unlike the paper's."""
    late = Counter(
        record["corruption"]
        for record in (run.last_attempts if run.is_live else ())
        if record.get("environment_errors") == "after_setup"
    )
    if late:
        listed = ", ".join(f"{label} {count}" for label, count in late.items())
        yield (
            f"In {quantity(late.total(), 'episode')} the network was cut after the task had been"
            f" set up ({listed}); in the paper it is cut before."
        )


def guard_note(run: Run) -> Iterator[str]:
    """Yield the guard of a run with its settings, and how often it acted, for each agent."""
    guard = run.config.get("guard")
    if not guard:
        return
    by_agent: dict[str, list[Mapping[str, Any]]] = {}
    for record in run.last_attempts:
        by_agent.setdefault(record["agent"], []).append(record)
    for agent, agent_records in by_agent.items():
        acts: Counter[str] = Counter()
        reminders = false_alarms = 0
        settings: dict[str, None] = {}
        for record in agent_records:
            guard_record = record.get("guard")
            if not isinstance(guard_record, dict):
                continue
            settings[json.dumps(guard_record["settings"], sort_keys=True)] = None
            for intervention in guard_record["interventions"]:
                acts[intervention["kind"]] += bool(intervention["actions"])
                reminders += not intervention["actions"]
                false_alarms += record["corruption"] == CLEAN
        kinds = ", ".join(f"{kind}: {count}" for kind, count in acts.most_common() if count)
        listed = f" ({kinds})" if kinds else ""
        yield (
            f"Guard {guard} {' and '.join(settings)}: in {quantity(len(agent_records), 'episode')}"
            f" of {agent} it acted {acts.total()} times{listed} and reminded {reminders} times;"
            f" {false_alarms} of these were in clean episodes (false alarms)."
        )


def repeat_note(run: Run) -> Iterator[str]:
    """Yield how many episodes with a score do not count, since their case was played again."""
    if isinstance(run.records, EpisodeColumns):
        return
    counted_ids = {id(record) for record in run.last_attempts}
    replaced = Counter(
        f"{record['agent']} under {record['corruption']}"
        for record in run.records
        if record["status"] == "ok" and id(record) not in counted_ids
    )
    if replaced:
        listed = ", ".join(f"{name} {count}" for name, count in replaced.items())
        yield (
            f"{quantity(replaced.total(), 'episode')} with a score left out: the same case (agent,"
            f" condition, task and seed) was played again, and the last attempt counts ({listed})."
        )


def commit_note(run: Run) -> Iterator[str]:
    """Yield which commits of this library played a run, if it was resumed with another one."""
    commits = played_commits(run)
    if len(commits) > 1:
        changes = (f"{commit} after {start}" for start, commit in commits[1:])
        yield (
            f"Several commits of agenthijack played the episodes: {commits[0][1]},"
            f" {', '.join(changes)}; tasks, corruptions and agents may have changed."
        )


def fraction_note(run: Run) -> Iterator[str]:
    """Yield which agents named points in fractions of the picture, which were read as pixels."""
    if run.config.get("kind") == RESULTS:  # the logs of others do not say
        return
    counts_by_agent: dict[str, Counter[str]] = {}
    for record in run.last_attempts:
        points = record.get("points")
        if isinstance(points, dict):
            numbers = {key: n for key, n in points.items() if isinstance(n, int)}
            counts_by_agent.setdefault(record["agent"], Counter()).update(numbers)
    for agent, count in counts_by_agent.items():
        if count["fractions"]:
            yield (
                f"{agent}: {count['fractions']} of {count['named']} points were below 1, and were"
                " read as pixels of the top left corner: is coordinates: fractions meant?"
            )


def design_notes(run: Run, groups: scores.GroupedRecords) -> Iterator[str]:
    """Yield how conditions were compared, and what the results of another harness do not tell."""
    if not groups.paired:
        yield UNPAIRED_NOTE
    else:
        yield from _partner_note(groups)
        yield from _invalid_partner_note(groups)
    if run.config.get("kind") != RESULTS:
        return
    left_out = run.config["left_out_by_common_tasks"]
    if left_out:
        yield f"Without {quantity(left_out, 'result')} of tasks that not all conditions have."
    reordered = run.config["seeds_matched_in_order"]
    if reordered:
        yield (
            f"{', '.join(reordered)}: a condition was played with other seeds than the clean one,"
            " so repetitions of a task are matched in their order."
        )
    merged = run.config["merged"]
    if merged:
        yield (
            f"Several sources have {', '.join(merged)} on the same tasks: their results count as"
            " repetitions."
        )
    versions = run.config["versions"]
    if len(versions) > 1:
        listed = "; ".join(f"{name}: {shorten_list(cells, 3)}" for name, cells in versions.items())
        yield f"The results are of several versions, which may differ, too ({listed})."
    yield from _other_tasks_note(groups)
    tasks = {agent: 0 for agent, _ in groups.scored}
    repeats = dict(tasks)
    for (agent, _), cell in groups.scored.items():
        tasks[agent] = max(tasks[agent], scores.count_tasks(cell))
        repeats[agent] = max(repeats[agent], len(cell) - scores.count_tasks(cell))
    single = [agent for agent, count in tasks.items() if count == 1]
    if single:
        yield (
            f"{', '.join(single)}: played on one task, so neither interval nor test says anything"
            " of other tasks."
        )
    once = [agent for agent, count in repeats.items() if not count]
    if once:
        yield (
            f"{', '.join(once)}: one result of each task and condition, so what chance does"
            " between two runs of a task is not known."
        )


def _other_tasks_note(groups: scores.GroupedRecords) -> Iterator[str]:
    """Yield which agents were scored on other tasks than the first."""
    tasks: dict[str, set[Hashable]] = {}
    for (agent, _), cell in groups.scored.items():
        tasks.setdefault(agent, set()).update(scores.distinct_tasks(cell))
    first, *further = tasks
    for agent in further:
        shared = len(tasks[first] & tasks[agent])
        if shared < max(len(tasks[first]), len(tasks[agent])):
            yield (
                f"{agent} and {first} share {shared} of {len(tasks[agent])} and"
                f" {len(tasks[first])} tasks with a score: their rates are of different tasks."
            )


def _partner_note(groups: scores.GroupedRecords) -> Iterator[str]:
    """Yield how many results have no partner, and are in no difference."""
    unpaired: dict[str, int] = {}
    for (agent, label), cell in groups.scored.items():
        if label == CLEAN or not groups.scored.get((agent, CLEAN)):
            continue
        alone = len(cell) - len(scores.pairs_in_cell((agent, label), groups)[0])
        if alone:
            unpaired[f"{agent} under {label}"] = alone
    if unpaired:
        listed = ", ".join(f"{name} {count}" for name, count in unpaired.items())
        yield (
            f"{quantity(sum(unpaired.values()), 'result')} without a clean one of the same task and"
            f" seed: in the success, and in no delta, retention or test ({listed})."
        )


def _invalid_partner_note(groups: scores.GroupedRecords) -> Iterator[str]:
    """Yield how many clean results have a partner that is invalid, and are in no difference."""
    invalid: dict[str, int] = {}
    for (agent, label), cases in groups.last.items():
        cell, clean = groups.scored[agent, label], groups.scored.get((agent, CLEAN), {})
        if label == CLEAN or len(cases) == len(cell):
            continue
        lost = sum(case in clean and case not in cell for case in cases)
        if lost:
            invalid[f"{agent} under {label}"] = lost
    if invalid:
        listed = ", ".join(f"{name} {count}" for name, count in invalid.items())
        yield (
            f"{quantity(sum(invalid.values()), 'invalid result')} whose clean one counts: the pair"
            " is in no delta, retention or test, which may flatter the agent where the corruption"
            f" was the reason ({listed})."
        )


def early_end_note(run: Run) -> Iterator[str]:
    """Yield whether a run that could end early has shown its retention, and after which task."""
    if UNTIL_RETENTION not in run.config:
        return
    from ..results.stop_rule import StopRule, settle_bets

    rule = StopRule.read(run.config)
    if rule is None:
        return
    bets, _, _ = settle_bets(run.config, run.episodes, run.records)
    stop = bets.stop(rule.retention, rule.confidence)
    tasks = f"{len(bets.clean) if stop is None else stop} of {len(run.config['tasks'])} tasks"
    verdict = "is shown" if stop is not None else "is not shown"
    if stop is None and len(bets.clean) < len(run.config["tasks"]):
        verdict += " so far"
    yield (
        f"After {tasks} a retention above {rule.retention:g} {verdict} with"
        f" {100 * rule.confidence:g} % confidence, at which the run was to end: success and"
        " intervals here are of the tasks that it played; hijack certify has the bound."
    )


def partial_note(partial: int) -> Iterator[str]:
    """Yield what the test makes of scores that are neither 0 nor 1, if there are any."""
    if partial:
        verb = "is" if partial == 1 else "are"
        yield (
            f"{quantity(partial, 'score')} {verb} between 0 and 1: p takes them for not solved, so"
            " it may miss a difference that the intervals show."
        )


def _notes(report: RunReport, partial: int) -> Iterator[str]:
    run = report.run
    if run.missing:
        progress = f"{run.planned - run.missing} of {run.planned} planned episodes are there"
        yield f"{progress}, {run.missing} are missing; hijack {run.kind} ... --resume runs them."
    if run.left_out:
        seeds = ", ".join(map(str, run.left_out))
        yield f"The run has more seeds than this report, which leaves out: {seeds}."
    if run.damaged:
        yield f"Without {quantity(run.damaged, 'line')} of the run that cannot be read."
    if not scores.can_infer():
        yield "Without intervals and tests: scipy is not installed."
    if CLEAN not in {cell.corruption for cell in report.cells}:
        yield "The run has no clean condition, so there is no delta, no retention and no test."
        if run.kind == RESULTS:
            listed = ", ".join(report.labels)
            yield f"--clean NAME names the clean one of its conditions ({listed})."
    yield from partial_note(partial)
    if run.early:
        words = (
            "1 episode with a score ended before its corruption was due: it counts as it is"
            if run.early == 1
            else f"{run.early} episodes with a score ended before their corruption was due: they"
            " count as they are"
        )
        yield f"{words}{_where_early(report)}."
    if run.changed:
        listed = ", ".join(run.changed)
        yield f"Not with the paper's parameters: {listed}."
    yield from _agent_notes(report)
    yield from _retention_notes(report)


def _retention_notes(report: RunReport) -> Iterator[str]:
    """Yield where an agent did better under a corruption than without, and what that means."""
    above = [cell for cell in report.cells if cell.retention is not None and cell.retention > 1]
    if not above:
        return
    shown_cells = [cell for cell in above if cell.p is not None and cell.p < SIGNIFICANT_P]
    listed = ", ".join(f"{cell.agent} under {cell.corruption}" for cell in above)
    verdict = (
        f"the test shows {len(shown_cells)} of {quantity(len(above), 'such gain')}"
        if shown_cells
        else "the test shows no such gain, so it may be chance"
    )
    yield (
        "A retention above 100 % means more success than on clean desktops, in the same cases"
        f" ({listed}): {verdict}."
    )


def _where_early(report: RunReport) -> str:
    """Return the cells whose episodes ended early, in brackets; none if no cell says so."""
    listed = [
        f"{cell.agent} under {cell.corruption} {cell.early} of {cell.n}"
        for cell in report.cells
        if cell.early
    ]
    return f" ({', '.join(listed)})" if listed else ""


def _agent_notes(report: RunReport) -> Iterator[str]:
    if report.run.kind != RESULTS:  # the logs of others do not say
        yield from _input_notes(report)
    incomplete = [row for row in report.summaries if row.conditions and row.paper_average is None]
    if incomplete and report.run.kind != RESULTS:
        yield (
            "The paper's average needs the clean condition and all nine corruptions under their"
            " own names."
        )
    yield from _reference_notes(report)
    yield from _case_notes(report)
    labels: dict[str, set[str]] = {}
    for cell in report.cells:
        labels.setdefault(cell.agent, set()).add(cell.corruption)
    if len(set(map(frozenset, labels.values()))) > 1:
        yield "The agents were not played under the same conditions: their means differ in kind."


def _reference_notes(report: RunReport) -> Iterator[str]:
    """Yield why there is no mCE, where one was asked for."""
    if not report.reference or any(row.mce is not None for row in report.summaries):
        return
    flawless = [
        cell.corruption
        for cell in report.cells
        if cell.agent == report.reference and cell.corruption != CLEAN and cell.success == 1
    ]
    if flawless:
        yield (
            f"There is no mCE: the reference agent {report.reference} never fails under"
            f" {', '.join(flawless)}, and an error has no ratio to 0."
        )


def _case_notes(report: RunReport) -> Iterator[str]:
    """Yield who lacks clean episodes, and where agents were not scored on as many cases."""
    lacking = [cell.agent for cell in report.cells if cell.corruption == CLEAN and not cell.n]
    if lacking:
        yield (
            f"No clean episode counts for {', '.join(lacking)}, so there is no delta, no retention"
            " and no test."
        )
    for label in report.labels:
        counts = {cell.agent: cell.n for cell in report.cells if cell.corruption == label}
        if len(set(counts.values())) > 1:
            listed = ", ".join(f"{agent} {count}" for agent, count in counts.items())
            yield (
                f"The agents do not have as many scores under the same condition ({label}:"
                f" {listed}): their rates are over different cases."
            )
            return


def _input_notes(report: RunReport) -> Iterator[str]:
    """Yield which agents were given more than instruction and pictures, or may have been."""
    agents_by_input: dict[tuple[str, ...] | None, list[str]] = {}
    for row in report.summaries:
        agents_by_input.setdefault(row.given, []).append(row.agent)
    for inputs, agents in agents_by_input.items():
        listed = ", ".join(agents)
        verb = "was" if len(agents) == 1 else "were"
        if inputs:
            description = describe_privileged_inputs(inputs)
            yield f"{listed} {verb} given {description}, which agents that are compared do not get."
        elif inputs is None:
            yield f"What {listed} {verb} given beside instruction and pictures is not recorded."
