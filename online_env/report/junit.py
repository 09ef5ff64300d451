"""A run as JUnit XML, which Jenkins, GitLab, GitHub actions, Azure and CircleCI read.

The format has no standard. What is written here is what these readers have in common: `testsuites`
with `testsuite`s, whose `testcase`s hold at most one of `skipped`, `error` and `failure`.
"""

import re
import xml.etree.ElementTree as ElementTree
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeAlias

from hijack_data.file_io import make_folder, write_atomic
from hijack_data.runs.run_log import ROW

from ..results import scores
from ..results.reading import ResultRecord, Run

GATES = "gates"  # the name of the suite of gates
# Characters that XML 1.0 cannot hold, not even escaped.
_FORBIDDEN = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
XmlElement: TypeAlias = ElementTree.Element


@dataclass(frozen=True, kw_only=True)
class GateCase:
    """A gate as a test case: its name, and what is wrong; empty if it is passed."""

    name: str
    problem: str


def write(path: Path, run: Run, gates: Sequence[GateCase]) -> None:
    """Write a run as JUnit XML; its folder is made if it is missing.

    Each episode is a test case of the suite of its agent. It is an error if it is invalid, failed,
    or missing; an unsolved task does not count as an error: whether the agent solves enough is the
    question of the gates, which are failures.

    Args:
        path: The file.
        run: What was run.
        gates: The gates, as test cases of a suite of their own.

    Raises:
        HijackError: The file cannot be written.
    """
    make_folder(path.parent, path)
    root = junit_tree(run, gates)
    ElementTree.indent(root, " ")
    write_atomic(path, ElementTree.tostring(root, encoding="utf-8", xml_declaration=True))


def junit_tree(run: Run, gates: Sequence[GateCase]) -> XmlElement:
    """Return the root of the document; the arguments are those of `write`."""
    by_agent: dict[str, list[XmlElement]] = {}
    for record in scores.latest(run.records).values():
        by_agent.setdefault(str(record["agent"]), []).append(_episode(record))
    suites = [_suite(agent, cases) for agent, cases in by_agent.items()]
    missing = [_missing(name) for name in run.unplayed]
    if missing:
        suites.append(_suite("missing", missing))
    if gates:
        suites.append(_suite(GATES, [_gate(case) for case in gates]))
    root = ElementTree.Element("testsuites", name="agenthijack")
    for name in ("tests", "failures", "errors"):
        root.set(name, str(sum(int(suite.get(name, "0")) for suite in suites)))
    root.set("time", _seconds(sum(float(suite.get("time", "0")) for suite in suites)))
    root.extend(suites)
    return root


def _suite(name: str, cases: Sequence[XmlElement]) -> XmlElement:
    """Return a suite with the counts of its cases."""
    suite = ElementTree.Element("testsuite", name=_text(name), tests=str(len(cases)))
    suite.set("failures", str(sum(case.find("failure") is not None for case in cases)))
    suite.set("errors", str(sum(case.find("error") is not None for case in cases)))
    suite.set("skipped", "0")
    suite.set("time", _seconds(sum(float(case.get("time", "0")) for case in cases)))
    suite.extend(cases)
    return suite


def _episode(record: ResultRecord) -> XmlElement:
    seconds = record.get("seconds")
    task = str(record["task"])
    if ROW in record:
        task += f"/{record.get('task_seed')}"
    case = _case(
        f"{record['agent']}.{record['corruption']}",
        f"{task} seed {record['seed']}",
        seconds if isinstance(seconds, int | float) else 0.0,
    )
    if record["status"] == "ok":
        message = f"score {record['score']:.2f}: {record.get('reason', '')}"
    else:
        message = str(record.get("problem", ""))
        kind = f"{record['status']} ({record.get('cause') or 'machine'})"
        _add(case, "error", kind, message)
    out = ElementTree.SubElement(case, "system-out")
    out.text = _text("\n".join(filter(None, (record.get("id"), message))))
    return case


def _gate(gate: GateCase) -> XmlElement:
    case = _case(GATES, gate.name, 0.0)
    if gate.problem:
        _add(case, "failure", "below", gate.problem)
    return case


def _missing(name: str) -> XmlElement:
    case = _case("missing", name, 0.0)
    _add(case, "error", "missing", "a planned episode has no record; --resume runs it")
    return case


def _case(classname: str, name: str, seconds: float) -> XmlElement:
    case = ElementTree.Element("testcase", classname=_text(classname), name=_text(name))
    case.set("time", _seconds(seconds))
    return case


def _add(case: XmlElement, tag: str, kind: str, message: str) -> None:
    """Add a problem to a case."""
    problem = ElementTree.SubElement(case, tag, type=kind)
    problem.set("message", _text(message.split("\n")[0]))
    problem.text = _text(message)


def _seconds(value: float) -> str:
    return f"{value:.3f}"


def _text(value: Any) -> str:
    """Return a text that XML can hold, since texts of agents and programs may contain anything."""
    return _FORBIDDEN.sub("\N{REPLACEMENT CHARACTER}", str(value))
