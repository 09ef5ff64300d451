"""What may be trained on: the committed splits, the rule of OSWorld's, and the refusals."""

import hashlib
import subprocess
import sys

import pytest

from hijack_data.config.nodes import Problems, plain
from hijack_data.config.yaml_reader import read_yaml
from hijack_data.config_files import read_config
from hijack_data.errors import UnknownNameError
from online_env.tasks import task_sets
from pipelines.train.errors import LeakError
from pipelines.train.split import check_split, members


def osworld():
    name, data = read_config("train/osworld_split")
    return plain(read_yaml(data, name, Problems()))


def test_the_suite_s_split_is_the_suite_s():
    assert members("suite/training") == tuple(task_sets.members("training"))
    assert members("suite/held_out") == tuple(task_sets.members("held_out"))


def test_osworld_s_split_follows_its_rule():
    split = osworld()
    training, held_out = split["training"], split["held_out"]
    sizes = {domain: len(training[domain]) + len(held_out[domain]) for domain in training}
    assert sum(sizes.values()) == 369
    shares = {domain: size * 128 / 369 for domain, size in sizes.items()}
    counts = {domain: int(share) for domain, share in shares.items()}
    by_rest = sorted(shares, key=lambda domain: (counts[domain] - shares[domain], domain))
    for domain in by_rest[: 128 - sum(counts.values())]:
        counts[domain] += 1
    for domain, count in counts.items():
        ids = training[domain] + held_out[domain]
        ordered = sorted(ids, key=lambda task: hashlib.sha256(task.encode()).hexdigest())
        assert training[domain] == sorted(ordered[:count])
        assert held_out[domain] == sorted(ordered[count:])


def test_sides_do_not_meet():
    for family in ("toy", "suite"):
        training, held_out = members(f"{family}/training"), members(f"{family}/held_out")
        assert not set(training) & set(held_out)
        check_split(training, held_out)
    check_split(members("osworld/training"), members("osworld/held_out"))
    assert len(members("osworld/training")) == len(members("toy/training")) == 128


@pytest.mark.parametrize("family", ["toy", "suite", "osworld"])
def test_held_out_tasks_are_refused(family):
    leaked = members(f"{family}/held_out")[0]
    with pytest.raises(LeakError, match=f"my data: task {leaked} of {family}/held_out must not"):
        check_split(["mine", leaked], source="my data")


def test_the_authors_tasks_are_trained_on_only_when_their_split_is_asked_for():
    training, held_out = members("agenthijack/training"), members("agenthijack/held_out")
    assert len(training) == 128
    everything = {*members("osworld/training"), *members("osworld/held_out")}
    assert {*training, *held_out} == everything
    with pytest.raises(LeakError, match="osworld_split='agenthijack'"):
        check_split(training)
    check_split(training, held_out, osworld_split="agenthijack")
    with pytest.raises(LeakError, match="trained on and reported"):
        check_split(training, everything, osworld_split="agenthijack")
    with pytest.raises(LeakError, match="agenthijack/held_out must not"):
        check_split(members("osworld/training"), osworld_split="agenthijack")
    with pytest.raises(UnknownNameError, match="'agenthijack'"):
        check_split(training, osworld_split="agenthijak")


def test_what_is_reported_is_refused():
    with pytest.raises(LeakError, match="tasks a, b would be trained on and reported"):
        check_split(["a", "b", "c"], ["b", "a"])
    check_split(["a", "b"], ["c"])


def test_unknown_sets():
    with pytest.raises(UnknownNameError, match="did you mean 'suite/training'"):
        members("suite/trainin")
    assert members("any_task") == ("any_task",)


def test_builds_can_ask_without_torch():
    code = (
        "import sys; from pipelines.train.split import check_split; check_split(['x']);"
        "sys.exit(any(name in sys.modules for name in ('torch', 'online_env')))"
    )
    assert subprocess.run([sys.executable, "-c", code]).returncode == 0
