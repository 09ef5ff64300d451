"""A controller that is killed while its desktop is locked and offline leaves nothing, and the
desktop can be ended."""

import json
import os
import signal
import subprocess
import sys

import pytest

from hijack_data.plan import Effect
from online_env.effects import perform, resume
from online_env.embedded.runtime import registry

from support.effects import reach
from support.waiting import until as wait

CONTROLLER = """
import json, sys, time
from hijack_data.plan import Effect
from online_env.embedded.desktop import EmbeddedDesktop
from online_env.effects import perform
desktop = EmbeddedDesktop.{way}
done = [perform(Effect(kind), desktop) for kind in ("firewall", "lock")]
print(json.dumps([[d.probe().ok, d.record] for d in done]), flush=True)
time.sleep(120)
"""


@pytest.fixture
def controller():
    """Starts a controller that locks a desktop and takes it off the network; returns it and its
    records."""
    started = []

    def start(way):
        code = CONTROLLER.format(way=way)
        process = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True)
        started.append(process)
        data = json.loads(process.stdout.readline())
        assert [ok for ok, _ in data] == [True, True]
        return process, [record for _, record in data]

    yield start
    for process in started:
        process.kill()
        process.wait()
        process.stdout.close()


def hijack(*arguments):
    process = subprocess.run(
        [sys.executable, "-m", "hijack_data.cli", "desktop", *arguments],
        capture_output=True,
        text=True,
        timeout=90,
        check=False,
    )
    assert process.returncode == 0, process.stderr
    return process.stdout


def test_killed_controller_takes_its_desktop_with_it(leaves_nothing, controller, up):
    name = f"{leaves_nothing}own"
    process, _ = controller(f"up(name={name!r})")
    os.kill(process.pid, signal.SIGKILL)
    wait(lambda: registry.load(name) is None)
    again = up(name=name)
    assert reach(again)
    wait(lambda: "is inactive" in again.execute(["mate-screensaver-command", "-q"]).output)


def test_desktop_of_a_killed_controller_goes_on_and_goes_down(leaves_nothing, controller):
    from online_env.embedded.desktop import EmbeddedDesktop

    name = f"{leaves_nothing}cli"
    hijack("up", "--name", name)
    try:
        process, records = controller(f"attach({name!r})")
        os.kill(process.pid, signal.SIGKILL)
        process.wait()
        desktop = EmbeddedDesktop.attach(name)
        assert not reach(desktop)
        for record in records:  # another process proves and undoes what the dead one did
            remaining_effects = resume(record, desktop)
            assert remaining_effects.probe().ok
            assert remaining_effects.undo().ok
        assert reach(desktop)
        perform(Effect("lock"), desktop)
        perform(Effect("firewall"), desktop)
        desktop.close()
    finally:
        hijack("down", name)
    assert registry.load(name) is None
