"""What a server lends and draws, and what a session does, on desktops that are none."""

import threading
from pathlib import Path

import pytest

from support import needs

pytest.importorskip("gymnasium", reason=needs.ONLINE)
pytest.importorskip("prometheus_client", reason=needs.SERVE)

import hijack_data as hj
from hijack_data.errors import HijackError, ParameterError, ParameterTypeError, UnknownNameError
from online_env.bench.config import Bench
from online_env.errors import DesktopError, MissingCapabilityError
from online_env.serving.access import read_token
from online_env.serving.episode_draws import EpisodeDraws, sides
from online_env.serving.errors import (
    DesktopLostError,
    HeldOutTaskError,
    LeaseExpiredError,
    ServerBusyError,
)
from online_env.serving.server import TOKEN, ServeOptions, make_service, override_size
from online_env.serving.sessions import DesktopSession
from online_env.tasks import task_sets
from online_env.tasks.machines import MachineSettings
from pipelines.train import split

from support.episodes import CLICK
from support.live import Marking
from support.serving import TASKS, Desktops, pool_of, service_on, until

NINE = {"clean": None, **{name: hj.make_corruption(name) for name in hj.corruption_names()}}


def test_an_episode_is_played_and_the_desktop_is_free_again():
    desktops = Desktops()
    with service_on(desktops) as service:
        session = DesktopSession(service)
        first = session.reset(seed=3, task="write_note", corruption="marks")
        assert (first.instruction, first.reward, first.done) == ("Open the file", None, False)
        assert service.pool.counts().lent == 1
        step = session.step(CLICK)
        assert (step.reward, step.done) == (0.0, False)
        last = session.step("DONE")
        assert (last.reward, last.done, last.truncated, last.status) == (1.0, True, False, "ok")
        assert service.pool.counts().free == 1
        assert (session.record["corruption"], session.record["seed"]) == ("marks", 3)
        again = session.step(CLICK)
        assert (again.reward, again.done) == (0.0, True)
        assert desktops.stages[0].resets == [("write_note", 3)]
    assert desktops.stages == []


def test_a_malformed_action_is_a_step_and_a_structured_one_is_read():
    desktops = Desktops()
    with service_on(desktops) as service:
        session = DesktopSession(service)
        session.reset(corruption="clean")
        assert session.step("import os; os.system('x')").done is False
        assert session.step({"action_type": "FLY"}, "computer_13").done is False
        with pytest.raises(UnknownNameError, match="unknown dialect 'computer_31'"):
            session.step({"action_type": "CLICK", "x": 10, "y": 20}, "computer_31")
        session.step({"action_type": "CLICK", "x": 10, "y": 20}, "computer_13")
        assert len(desktops.stages[0].desktop.ran) == 1
        session.step("DONE")
        assert (session.record["malformed"], session.record["steps"]) == (2, 4)


def test_a_limit_ends_an_episode_and_it_is_judged():
    with service_on(Desktops()) as service:
        session = DesktopSession(service)
        session.reset()
        views = [session.step(CLICK) for _ in range(4)]
        assert [view.done for view in views] == [False, False, False, True]
        assert (views[-1].truncated, views[-1].reward) == (True, 1.0)


def test_a_client_that_leaves_in_mid_episode_frees_its_desktop():
    with service_on(Desktops()) as service:
        session = DesktopSession(service)
        session.reset()
        session.step(CLICK)
        session.close()
        session.close()
        assert service.pool.counts().free == 1
        with pytest.raises(HijackError, match="this session was closed; connect again"):
            session.reset()
        assert b"hijack_episodes_broken_off_total 1.0" in service.metrics.text()


def test_a_client_that_leaves_while_it_waits_takes_no_desktop():
    with service_on(Desktops()) as service:
        session, leaving = DesktopSession(service), DesktopSession(service)
        session.reset()
        refused = []

        def wait():
            with pytest.raises(HijackError, match="this session was closed"):
                leaving.reset()
            refused.append(True)

        thread = threading.Thread(target=wait)
        thread.start()
        until(lambda: service.pool.counts().waiting == 1)
        leaving.close()
        session.close()
        thread.join()
        assert refused == [True]
        assert (service.pool.counts().free, service.pool.counts().lent) == (1, 0)


def test_a_reset_in_mid_episode_gives_up_the_episode():
    with service_on(Desktops()) as service:
        session = DesktopSession(service)
        session.reset()
        with pytest.raises(UnknownNameError):
            session.reset(task="nothing")
        assert session.step(CLICK).done is False  # what is refused changes nothing
        session.reset()
        assert service.pool.counts().lent == 1


def test_a_silent_client_loses_its_desktop_and_is_told():
    with service_on(Desktops(), lease=0.2) as service:
        silent, desktop_session = DesktopSession(service), DesktopSession(service)
        silent.reset()
        desktop_session.reset()  # waits until the lease has expired
        with pytest.raises(LeaseExpiredError, match=r"the client said nothing for .* --lease 0.2"):
            silent.step(CLICK)
        with pytest.raises(HijackError, match="call reset first"):
            silent.step(CLICK)
        assert b"hijack_leases_expired_total 1.0" in service.metrics.text()


def test_a_step_that_takes_long_is_no_silence():
    desktops = Desktops()
    with service_on(desktops, lease=0.3) as service:
        session = DesktopSession(service)
        session.reset()
        desktops.stages[0].desktop.on["run"] = lambda: threading.Event().wait(0.8)
        assert session.step(CLICK).done is False


def test_a_dead_desktop_is_replaced_and_the_session_is_told():
    desktops = Desktops()
    with service_on(desktops) as service:
        session = DesktopSession(service)
        session.reset()
        dead = desktops.stages[0]
        dead.desktop.dead = True
        with pytest.raises(DesktopLostError, match=r"the desktop is gone.*reset begins a new"):
            session.step(CLICK)
        assert session.record["status"] == "error"
        until(lambda: service.pool.counts().free == 1)
        assert desktops.stages != [dead]
        assert (desktops.made, service.pool.replaced) == (2, 1)
        assert session.reset().done is False


def test_a_desktop_that_fails_in_reset_is_replaced_and_another_is_tried():
    desktops = Desktops()
    with service_on(desktops, 2, line=2) as service:
        broken = desktops.stages[0]
        broken.fails = DesktopError("no task today")
        for _ in range(2):  # one of the two meets it
            session = DesktopSession(service)
            assert session.reset().done is False
            session.close()
        until(lambda: service.pool.counts().free == 2)
        assert broken not in desktops.stages


def test_a_reset_that_fails_everywhere_says_why():
    desktops = Desktops()
    with service_on(desktops, 2, line=2) as service:
        for stage in desktops.stages:
            stage.fails = DesktopError("no task today")
        with pytest.raises(DesktopError, match="no task today"):
            DesktopSession(service).reset()
        until(lambda: service.pool.counts().free == 2)


def test_a_corruption_that_does_not_hold_has_no_reward():
    planners = {"marking": Marking(0, sabotaged=True)}
    with service_on(Desktops(), planners=planners) as service:
        session = DesktopSession(service)
        view = session.reset(corruption="marking")
        assert (view.done, view.reward, view.status) == (True, None, "invalid")
        assert view.problem == "test_mark at step 0: nothing is marked"
        assert service.pool.counts().free == 1


def test_what_a_desktop_lacks_is_refused_and_the_desktop_stays():
    planners = {"marking": Marking(0)}
    desktops = Desktops()
    with service_on(desktops, planners=planners) as service:
        desktops.stages[0].desktop.capabilities = frozenset()
        with pytest.raises(MissingCapabilityError, match="needs windows, which this desktop lacks"):
            DesktopSession(service).reset()
        assert (service.pool.counts().free, desktops.made) == (1, 1)


def test_sessions_of_one_episode_have_logs_of_their_own(tmp_path):
    with service_on(Desktops(), 2, log=tmp_path) as service:
        sessions = [DesktopSession(service) for _ in range(2)]
        for session in sessions:
            session.reset(seed=1, task="write_note", corruption="clean")
        for session in sessions:
            session.step(CLICK)
        sessions[0].step("DONE")
        sessions[1].close()  # it is judged as it stands
    assert sorted(path.name for path in (tmp_path / "episodes").iterdir()) == [
        "write_note-1__clean__s1__client-1",
        "write_note-1__clean__s1__client-2",
    ]


def test_a_full_server_says_when_to_come_back():
    with service_on(Desktops(), line=0) as service:
        DesktopSession(service).reset()
        with pytest.raises(ServerBusyError) as refused:
            DesktopSession(service).reset()
        assert refused.value.retry_after >= 1
        assert f"try again in {refused.value.retry_after} s" in str(refused.value)
        assert b'hijack_resets_total{outcome="busy"} 1.0' in service.metrics.text()


def test_who_waits_too_long_is_told_so():
    pool = pool_of(Desktops(), line=1, wait_timeout=0.1)
    pool.start()
    pool.take()
    with pytest.raises(ServerBusyError, match="1 of 1 desktops are in use, and none became free"):
        pool.take()
    pool.close()


def test_desktops_are_lent_in_the_order_of_the_line():
    pool = pool_of(Desktops(), line=3)
    pool.start()
    seat = pool.take()
    order = []

    def wait(number):
        result = pool.take()
        order.append(number)
        pool.give_back(result)

    threads = []
    for number in range(3):
        threads.append(threading.Thread(target=wait, args=(number,)))
        threads[-1].start()
        until(lambda expected=number + 1: pool.counts().waiting == expected)
    pool.give_back(seat)
    for thread in threads:
        thread.join()
    assert order == [0, 1, 2]
    pool.close()


def test_the_end_of_a_server_ends_all_desktops_and_all_waiting():
    desktops = Desktops()
    pool = pool_of(desktops, 1)
    pool.start()
    pool.take()
    refused = []

    def wait():
        with pytest.raises(ServerBusyError, match="the server is ending"):
            pool.take()
        refused.append(True)

    thread = threading.Thread(target=wait)
    thread.start()
    until(lambda: pool.counts().waiting == 1)
    pool.close()
    thread.join()
    assert (refused, desktops.stages) == ([True], [])


def test_the_end_of_a_server_waits_for_the_reset_that_is_under_way():
    desktops = Desktops()
    with service_on(desktops) as service:
        session = DesktopSession(service)
        begun, order = threading.Event(), []

        def slowly():
            begun.set()
            threading.Event().wait(0.5)
            order.append("reset")

        desktops.stages[0].desktop.reset = slowly
        thread = threading.Thread(target=session.reset)
        thread.start()
        begun.wait(10)
        service.close()
        order.append("closed")
        thread.join()
        assert order == ["reset", "closed"]


def test_a_desktop_that_fails_when_it_is_put_back_is_replaced():
    desktops = Desktops()
    with service_on(desktops, lease=0.2) as service:
        session = DesktopSession(service)
        session.reset()
        stage = desktops.stages[0]

        def broken():
            raise ValueError("no screen")

        stage.desktop.on["screenshot"] = broken
        until(lambda: service.pool.replaced == 1)
        until(lambda: service.pool.counts().free == 1)
        assert DesktopSession(service).reset().done is False


@pytest.mark.parametrize("problem", [OSError(28, "No space left"), ValueError("a bug")])
def test_a_desktop_is_replaced_whatever_kept_it_from_starting(problem, monkeypatch):
    monkeypatch.setattr("online_env.serving.pool.RESTART_INTERVAL_S", 0.01)
    desktops = Desktops()
    pool = pool_of(desktops)
    pool.start()
    desktops.problem, desktops.failures = problem, 2
    pool.replace(pool.take())
    until(lambda: pool.counts().free == 1)
    pool.close()
    assert (desktops.made, desktops.stages) == (2, [])


def test_a_desktop_that_cannot_be_ended_is_replaced_all_the_same():
    desktops = Desktops()
    pool = pool_of(desktops)
    pool.start()
    seat = pool.take()
    seat.stack.callback(Path("/proc/1").rmdir)
    pool.replace(seat)
    until(lambda: pool.counts().free == 1)
    pool.close()


def test_a_desktop_that_does_not_start_ends_the_others():
    desktops = Desktops()
    desktops.failures = 1
    with pytest.raises(DesktopError, match="no desktop today"):
        pool_of(desktops, 3).start()
    assert desktops.stages == []


# ---- what is drawn


def choices(draws, count=200, **given):
    return [draws.choose(session=1, **given) for _ in range(count)]


def test_a_server_that_is_started_again_draws_the_same():
    first, second = (choices(EpisodeDraws(TASKS, NINE, seed=5)) for _ in range(2))
    assert [(c.task, c.seed, c.label) for c in first] == [(c.task, c.seed, c.label) for c in second]
    assert {c.label for c in first} == set(NINE)
    assert {c.task for c in first} == set(TASKS)
    result = choices(EpisodeDraws(TASKS, NINE, seed=6))
    assert [c.label for c in first] != [c.label for c in result]


@pytest.mark.parametrize(("per", "labels"), [("rollout", 10), ("group", 1), ("worker", 1)])
def test_rollouts_of_a_group_share_what_per_says(per, labels):
    draws = EpisodeDraws(TASKS, NINE, per=per)
    result = choices(draws, seed=7)
    assert [c.slot for c in result] == list(range(200))
    assert len({(c.task, c.seed) for c in result}) == 1
    assert len({c.label for c in result}) == labels


def test_a_slot_of_the_client_draws_again_what_it_drew():
    draws = EpisodeDraws(TASKS, NINE)
    result = choices(draws, 5, seed=7)
    assert [draws.choose(session=2, seed=7, slot=c.slot).label for c in result] == [
        c.label for c in result
    ]


def test_a_condition_that_draws_itself_is_served_whole_under_its_label():
    """A trigger was drawn once: the fault came at every step, under its own name, or never."""
    fault = hj.make_corruption("missed_input", step={"every": 1})
    trigger = hj.OneOf([fault], p_clean=0.8)
    planners = {
        "now_and_then": trigger,
        "marks": hj.Marks(number=1),
        "mixed": hj.OneOf([hj.Marks()]),
    }
    for choice in choices(EpisodeDraws(TASKS, planners)):
        assert choice.planner is planners[choice.label]
    drawn = choices(EpisodeDraws(TASKS, {"clean": None, **planners}, clean=0.25), 400)
    assert sum(c.label == "clean" for c in drawn) / 400 == pytest.approx(0.25, abs=0.08)


@pytest.mark.parametrize("seed", [-1, 2**64])
def test_a_seed_of_the_server_out_of_range_is_refused(seed):
    with pytest.raises(ParameterError, match=r"seed must be in \[0, 2\*\*64 - 1\]"):
        EpisodeDraws(TASKS, NINE, seed=seed)


@pytest.mark.parametrize(("clean", "share"), [(None, 0.1), (0.0, 0.0), (0.5, 0.5), (1.0, 1.0)])
def test_the_share_of_clean_episodes(clean, share):
    result = choices(EpisodeDraws(TASKS, NINE, clean=clean), 1000)
    assert sum(c.label == "clean" for c in result) / 1000 == pytest.approx(share, abs=0.05)


@pytest.mark.parametrize(
    ("given", "error", "words"),
    [
        ({"task": "write_nots"}, UnknownNameError, "did you mean 'write_note'"),
        ({"task": 3}, ParameterTypeError, "task must be the name of a task, got 3"),
        ({"task": "copy_folder"}, HeldOutTaskError, "copy_folder is held out"),
        ({"task": "my_task.py:MyTask"}, UnknownNameError, "no task 'my_task.py:MyTask' is served"),
        ({"corruption": "mark"}, UnknownNameError, "did you mean 'marks'"),
        ({"corruption": "evil.py:Evil"}, UnknownNameError, "no corruption 'evil.py:Evil' is"),
        ({"corruption": {"marks": {}}}, ParameterTypeError, "corruption must be a name"),
        ({"seed": -1}, ParameterError, "seed must be in"),
        ({"seed": "3"}, ParameterTypeError, "seed must be an integer"),
        ({"slot": -1}, ParameterTypeError, "slot must be an integer of at least 0"),
    ],
)
def test_what_is_not_served_is_refused(given, error, words):
    draws = EpisodeDraws(TASKS, NINE, held_out=["copy_folder"])
    with pytest.raises(error, match=words):
        draws.choose(session=1, **given)


def test_servers_are_for_training_unless_they_are_told_otherwise():
    bench = Bench(tasks=task_sets.members("small"))
    held_out = set(task_sets.members("held_out"))
    training = ServeOptions(bench=bench).draws()
    assert training.tasks
    assert not held_out & set(training.tasks)
    assert training.held_out == held_out & set(bench.tasks)
    assert ServeOptions(bench=bench, is_evaluation=True).draws().tasks == bench.tasks
    with pytest.raises(HeldOutTaskError, match="--evaluation serves them for scoring"):
        ServeOptions(bench=Bench(tasks=("copy_folder",))).draws()
    assert sides(["copy_folder", "of_mine"]) == {
        "training": ("of_mine",),
        "held_out": ("copy_folder",),
    }


def test_the_authors_training_tasks_of_osworld_are_served_where_that_split_is_chosen():
    theirs, held_out = split.members("agenthijack/training"), split.members("agenthijack/held_out")
    bench = Bench(tasks=(*theirs, *held_out))
    draws = ServeOptions(bench=bench, osworld_split="agenthijack").draws()
    assert draws.tasks == theirs
    assert draws.held_out == set(held_out)
    assert draws.sides == {"training": theirs}
    assert not set(theirs) <= set(ServeOptions(bench=bench).draws().tasks)


def test_nothing_to_draw_is_an_error():
    with pytest.raises(ParameterError, match="no task is left"):
        EpisodeDraws([], NINE)
    with pytest.raises(ParameterError, match="no corruption is left"):
        EpisodeDraws(TASKS, {})
    with pytest.raises(ParameterError, match="the clean condition is not among"):
        EpisodeDraws(TASKS, {"marks": hj.make_corruption("marks")}, clean=0.5)


# ---- options


def test_the_token_leaves_the_environment(monkeypatch):
    monkeypatch.setenv(TOKEN, "s" * 32)
    assert read_token(None, TOKEN) == "s" * 32
    assert read_token(None, TOKEN) is None  # desktops do not inherit it


def test_a_token_file_is_for_its_owner(tmp_path):
    file = tmp_path / "token"
    with pytest.raises(ParameterError, match="No such file"):
        read_token(file, TOKEN)
    file.write_text("s" * 32 + "\n")
    file.chmod(0o644)
    with pytest.raises(ParameterError, match=f"others may read it; chmod 600 {file}"):
        read_token(file, TOKEN)
    file.chmod(0o600)
    assert read_token(file, TOKEN) == "s" * 32
    file.write_text("short")
    with pytest.raises(ParameterError, match="at least 16 printable characters"):
        read_token(file, TOKEN)


def test_more_desktops_than_machines_are_refused_and_not_waited_for():
    machines = MachineSettings(vm=("docker",), count=2)
    bench = Bench(provider="osworld", machines=machines, tasks=TASKS, size=(360, 640))
    with pytest.raises(ParameterError, match="--desktops 3: only 2 machines are named"):
        make_service(ServeOptions(bench=bench, desktops=3))


@pytest.mark.parametrize("size", ["1280", "1280*720", "x720", "99999x720"])
def test_a_size_is_width_and_height(size):
    assert override_size(Bench(), "1280x720") == Bench(size=(720, 1280))
    with pytest.raises(ParameterError, match="--size must be WIDTHxHEIGHT"):
        override_size(Bench(), size)
