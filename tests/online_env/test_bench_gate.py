"""A gate for releases: scores that are refused, scores that are too low, and the JUnit file."""

import os

import click
import pytest
from click.testing import CliRunner

pytest.importorskip("gymnasium", reason="needs the extra [online]")

from lxml import etree

from hijack_data.errors import HijackError, ParameterError, UnknownNameError
from hijack_data.runs.run_log import row_slug
from online_env.report.gate import ReleaseGate, ScoreGate
from online_env.report.gate_options import gate_options
from online_env.results import records, scores

AGENTS = ("oracle", "my.py:Mine")
LABELS = ("clean", "marks", "network_error")
# What Jenkins, GitLab, GitHub actions and Azure have in common: no other element or attribute.
COMMON = """
<xs:schema xmlns:xs="http://www.w3.org/2001/XMLSchema">
  <xs:complexType name="problem"><xs:simpleContent><xs:extension base="xs:string">
    <xs:attribute name="type" type="xs:string" use="required"/>
    <xs:attribute name="message" type="xs:string" use="required"/>
  </xs:extension></xs:simpleContent></xs:complexType>
  <xs:attributeGroup name="counts">
    <xs:attribute name="name" type="xs:string" use="required"/>
    <xs:attribute name="tests" type="xs:nonNegativeInteger" use="required"/>
    <xs:attribute name="failures" type="xs:nonNegativeInteger" use="required"/>
    <xs:attribute name="errors" type="xs:nonNegativeInteger" use="required"/>
    <xs:attribute name="time" type="xs:decimal" use="required"/>
  </xs:attributeGroup>
  <xs:element name="testsuites"><xs:complexType>
    <xs:sequence><xs:element name="testsuite" minOccurs="0" maxOccurs="unbounded">
      <xs:complexType>
        <xs:sequence><xs:element name="testcase" maxOccurs="unbounded"><xs:complexType>
          <xs:sequence>
            <xs:choice minOccurs="0">
              <xs:element name="error" type="problem"/>
              <xs:element name="failure" type="problem"/>
            </xs:choice>
            <xs:element name="system-out" type="xs:string" minOccurs="0"/>
          </xs:sequence>
          <xs:attribute name="classname" type="xs:string" use="required"/>
          <xs:attribute name="name" type="xs:string" use="required"/>
          <xs:attribute name="time" type="xs:decimal" use="required"/>
        </xs:complexType></xs:element></xs:sequence>
        <xs:attributeGroup ref="counts"/>
        <xs:attribute name="skipped" type="xs:nonNegativeInteger" use="required"/>
      </xs:complexType></xs:element></xs:sequence>
    <xs:attributeGroup ref="counts"/>
  </xs:complexType></xs:element>
</xs:schema>
"""


@pytest.fixture(autouse=True)
def quick(monkeypatch):
    """Leave out the intervals, which take a second each time."""
    monkeypatch.setattr(scores, "can_infer", lambda: False)


def make_record(task, corruption, score, agent="oracle", **more):
    return {
        "id": f"{task}__{corruption}__s0__{agent}",
        "agent": agent,
        "task": task,
        "task_seed": 0,
        "corruption": corruption,
        "seed": 0,
        "status": "ok",
        "score": score,
        "reason": "as it was",
        "problem": "",
        "seconds": 2.5,
        **more,
    }


def run_of(folder, *found, episodes=()):
    records.create(folder, {}, episodes).release()
    records.append_all(folder, found)
    return records.read(folder)


@pytest.fixture
def run(tmp_path):
    """Clean 1.0; marks 0.5; network_error 0.25, for the oracle alone."""
    values = [make_record(task, "clean", 1.0) for task in "tuvw"]
    values += [
        make_record(task, "marks", score) for task, score in zip("tuvw", (1, 1, 0, 0), strict=True)
    ]
    values += [make_record(task, "network_error", float(task == "t")) for task in "tuvw"]
    return run_of(tmp_path / "run", *values)


def gate_of(*texts, agents=("oracle",), labels=LABELS, junit=None):
    return ReleaseGate.read(texts, junit, agents, labels)


def single_verdict(text, run):
    (verdict,) = gate_of(text).verdicts(run)
    return verdict


# Which scores


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("success", 1.0),
        ("success.clean", 1.0),
        ("success.marks", 0.5),
        ("retention", 0.375),
        ("retention.network_error", 0.25),
        ("delta", -0.625),
        ("delta.marks", -0.5),
        ("corrupted", 0.375),
        ("average", 1.75 / 3),
        ("worst", 0.25),
    ],
)
def test_every_score_is_compared_with_its_threshold(name, value, run):
    verdict = single_verdict(f"{name}={value - 1e-3}", run)
    assert verdict.value == pytest.approx(value)
    assert verdict.passed
    if value < 1:
        assert not single_verdict(f"{name}={value + 1e-3}", run).passed


def test_retention_is_over_all_pairs_as_in_the_report(tmp_path):
    """Not the mean of the corruptions' means, which have different cases."""
    items = [
        make_record("t", "clean", 1.0),
        make_record("u", "clean", 0.5),
        make_record("v", "clean", 1.0),
    ]
    items += [
        make_record("t", "marks", 1.0),
        make_record("u", "marks", 0.0),
        make_record("v", "network_error", 0.5),
    ]
    items.append(make_record("w", "marks", 1.0))  # never clean
    run = run_of(tmp_path / "run", *items)
    assert single_verdict("retention=0", run).value == pytest.approx(1.5 / 2.5)
    assert single_verdict("delta=-1", run).value == pytest.approx(-1 / 3)


def test_rounding_fails_no_gate(run):
    assert single_verdict(f"average={0.1 + 0.2 + 0.28333333333333344}", run).passed
    assert single_verdict("success.marks=0.5", run).passed


def test_the_lower_end_of_an_interval_is_a_score_too(run, monkeypatch):
    monkeypatch.undo()
    pytest.importorskip("scipy", reason="needs the extra [online]")
    verdict = single_verdict("ci_low.marks=0.4", run)
    assert not verdict.passed
    assert 0 <= verdict.value < 0.4


def test_a_line_says_what_is_below_what(run):
    assert str(single_verdict("retention=0.8", run)) == "retention of oracle is 0.375, below 0.8"
    assert (
        str(single_verdict("success=0.8", run)) == "success.clean of oracle is 1.000, at least 0.8"
    )
    nearly = single_verdict("retention=0.3750001", run)
    assert str(nearly) == "retention of oracle is 0.375, below 0.3750001"


@pytest.mark.parametrize("name", ["retention", "average", "worst", "corrupted", "delta"])
def test_a_mean_is_not_taken_over_the_conditions_that_happen_to_be_there(name, tmp_path):
    run = run_of(
        tmp_path / "run",
        make_record("t", "clean", 1.0),
        make_record("t", "marks", 1.0),
        make_record("t", "network_error", None, status="invalid", problem="no firewall"),
    )
    verdict = single_verdict(f"{name}=0", run)
    assert not verdict.passed
    assert "cannot be computed, no episode counts" in str(verdict)
    assert f": network_error (oracle:{name}=0)" in str(verdict)
    assert single_verdict("success.marks=0.9", run).passed
    assert not single_verdict("success.network_error=0", run).passed


def test_a_gate_is_for_each_agent_or_for_one():
    two = ("a", "my.py:Mine", "do_nothing")
    gates = gate_of("worst=0.5", agents=two).gates
    assert [gate.agent for gate in gates] == ["a", "my.py:Mine"]  # nobody releases do_nothing
    beside = gate_of("worst=0.5", agents=("my.py:Mine", "pixel", "pixel_onlooker")).gates
    assert [gate.agent for gate in beside] == ["my.py:Mine"]
    yardsticks = gate_of("worst=0.5", agents=("oracle", "do_nothing")).gates
    assert [gate.agent for gate in yardsticks] == ["oracle", "do_nothing"]
    (agent_gate,) = gate_of("my.py:Mine:success.marks=0.25", agents=AGENTS).gates
    assert agent_gate == ScoreGate(score="success", label="marks", agent="my.py:Mine", least=0.25)
    (dotted,) = gate_of("success.many.marks=1", labels=("clean", "many.marks")).gates
    assert dotted.label == "many.marks"


@pytest.mark.parametrize(
    ("text", "error", "words"),
    [
        ("retension=0.8", UnknownNameError, "no score 'retension'; did you mean 'retention'"),
        ("success.mark=0.8", UnknownNameError, "no condition 'mark'; did you mean 'marks'"),
        ("orakle:success=0.8", UnknownNameError, "no agent 'orakle'; did you mean 'oracle'"),
        ("retention", ParameterError, "write SCORE=X"),
        ("retention=80", ParameterError, r"'80' must be a number from 0 to 1 \(80 % is 0.8\)"),
        ("retention=nan", ParameterError, "must be a number"),
        ("retention=-0.1", ParameterError, "must be a number from 0 to 1"),
        ("delta=-1.1", ParameterError, "from -1 to 1"),
        ("retention=0,8", ParameterError, "must be a number"),
        ("average.marks=0.8", ParameterError, "average has no conditions; write average=X"),
        ("retention.clean=1", ParameterError, "compares a corruption with clean"),
    ],
)
def test_what_is_no_gate_is_refused(text, error, words):
    with pytest.raises(error, match=words):
        gate_of(text)


def test_a_score_that_the_run_will_not_have_is_refused():
    with pytest.raises(ParameterError, match="needs the clean condition"):
        gate_of("retention=0.8", labels=("marks",))
    with pytest.raises(UnknownNameError, match="no condition 'clean'"):
        gate_of("success=0.8", labels=("marks",))
    for name in ("worst", "retention", "corrupted"):
        with pytest.raises(ParameterError, match="the run has no corruption"):
            gate_of(f"{name}=0.8", labels=("clean",))


# The options


def test_any_command_can_take_the_options(run, tmp_path):
    @click.command()
    @gate_options
    def judge(fail_under, junit):
        passed = ReleaseGate.read(fail_under, junit, ["oracle"], LABELS).conclude(run)
        raise SystemExit(0 if passed else 1)

    def judged(*words):
        return CliRunner().invoke(judge, list(words))

    good = judged("--fail-under", "success=0.9", "--fail-under", "worst=0.2")
    assert (good.exit_code, good.stderr.count("gate passed: ")) == (0, 2)
    bad = judged("--fail-under", "success=0.9", "--fail-under", "retention=0.8")
    assert bad.exit_code == 1
    assert bad.stderr.splitlines()[1:] == [
        "hijack: gate failed: retention of oracle is 0.375, below 0.8"
    ]
    assert judged().exit_code == 0


# The JUnit file


def validated(path):
    """The document, which is one that CI systems read."""
    tree = etree.parse(path)
    etree.XMLSchema(etree.fromstring(COMMON)).assertValid(tree)
    for suite in tree.iter("testsuite"):
        cases = suite.findall("testcase")
        assert int(suite.get("tests")) == len(cases)
        for item in ("failure", "error"):
            matches = [case for case in cases if case.find(item) is not None]
            assert int(suite.get(f"{item}s")) == len(matches)
        names = {(case.get("classname"), case.get("name")) for case in cases}
        assert len(names) == len(cases)
    return tree.getroot()


def test_a_junit_file_has_failures_for_gates_and_errors_for_what_has_no_score(tmp_path):
    lost_id = "t__network_error__s0__oracle"
    items = [
        make_record("t", "clean", 1.0),
        make_record("t", "marks", 0.0),
        make_record(
            "u", "marks", None, status="invalid", problem="not <proved> & \x00\x1b[31m \ud800"
        ),
        make_record("u", "clean", None, status="error", cause="agent", problem="raised\nin line 3"),
        make_record("t", "clean", 1.0, agent="my.py:Mine"),
    ]
    planned_ids = [*(record["id"].replace("my.py:Mine", "my.py_Mine") for record in items), lost_id]
    for record in items:
        record["problem"] = record["problem"].encode("utf-8", "replace").decode()
    run = run_of(tmp_path / "run", *items, episodes=planned_ids)
    path = tmp_path / "new" / "deep" / "junit.xml"
    gate = ReleaseGate.read(
        ["oracle:success.marks=0.5", "my.py:Mine:success=0.5"], path, AGENTS, LABELS
    )
    assert not gate.conclude(run)
    root = validated(path)
    assert [root.get(key) for key in ("tests", "failures", "errors")] == ["8", "1", "3"]
    suites = {suite.get("name"): suite for suite in root}
    assert list(suites) == ["oracle", "my.py:Mine", "missing", "gates"]
    (failure,) = root.iter("failure")
    assert failure.get("message") == "success.marks of oracle is 0.000, below 0.5"
    assert failure.getparent().get("name") == "oracle:success.marks=0.5"
    errors = {case.getparent().get("name"): case for case in root.iter("error")}
    assert errors["u seed 0"].get("type") in ("invalid (machine)", "error (agent)")
    assert errors[lost_id].get("type") == "missing"
    messages = {error.get("message") for error in errors.values()}
    texts = "".join(error.text for error in root.iter("error"))
    assert "raised\nin line 3" in texts
    assert "not <proved> & \ufffd\ufffd[31m" in texts
    assert all("\n" not in message for message in messages)
    unsolved = root.xpath("//testcase[@classname='oracle.marks'][@name='t seed 0']")
    assert [case.find("error") for case in unsolved] == [None]
    assert "score 0.00: as it was" in unsolved[0].findtext("system-out")


def test_rows_of_a_dataset_that_were_not_scored_are_errors_too(tmp_path):
    ids = [row_slug("t/0", f"000{n}", "clean", 0, "fail") for n in (0, 1)]
    row = make_record("t/0", "clean", 1.0, agent="fail") | {
        "id": ids[0],
        "task_seed": "0000",
        "row": "r",
    }
    settings = {"kind": "score", "agents": ["fail"], "corruptions": ["clean"]}
    with records.create(tmp_path / "run", settings, ids):
        records.append(tmp_path / "run", row)
    path = tmp_path / "junit.xml"
    ReleaseGate.read([], path, ["fail"], ["clean"]).conclude(records.read(tmp_path / "run"))
    root = validated(path)
    assert [root.get(key) for key in ("tests", "errors")] == ["2", "1"]
    (error,) = root.iter("error")
    assert (error.getparent().get("name"), error.get("type")) == (ids[1], "missing")


def test_only_the_last_attempt_is_a_test_case(tmp_path):
    again = make_record("t", "clean", 1.0, attempt=1) | {"id": "t__clean__s0__oracle__a1"}
    first = make_record("t", "clean", None, status="invalid", attempt=0)
    run = run_of(tmp_path / "run", first, again, episodes=[first["id"]])
    path = tmp_path / "junit.xml"
    assert gate_of(junit=path).conclude(run)
    root = validated(path)
    assert [root.get(key) for key in ("tests", "errors", "time")] == ["1", "0", "2.500"]


def test_a_place_that_cannot_be_written_is_refused_before_the_run(tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(HijackError, match=r"--junit .*: is a folder"):
        gate_of(junit=tmp_path)
    with pytest.raises(HijackError, match="is not a folder that can be written"):
        gate_of(junit=tmp_path / "file" / "junit.xml")
    if os.geteuid():
        tmp_path.chmod(0o500)
        with pytest.raises(HijackError, match="is not a folder that can be written"):
            gate_of(junit=tmp_path / "junit.xml")
