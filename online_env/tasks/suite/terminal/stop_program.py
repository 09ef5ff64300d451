"""End a program that hangs, and no other."""

import time

from online_env.tasks import Task
from online_env.tasks.kit import plan_steps, shell
from online_env.tasks.kit.word_lists import sample

NAMES = ("indexer", "syncer", "thumbs", "mailcheck", "rotator", "scanner")
# It ends by itself when its file is removed, so nothing is left of a home folder that is.
SCRIPT = '#!/bin/sh\nwhile [ -e "$0" ]; do sleep 1; done\n'


class StopProgram(Task):
    """Others run, too, one of which has the name of the first at the start of its own."""

    name = "stop_program"
    domain = "terminal"
    apps = ("terminal",)
    phrasings = (
        "The program {name} hangs. End it, and only it: {others} have to go on running. Do not"
        " delete or change the programs themselves (they are in Tools).",
        "Please kill {name} in the terminal. Careful, there are programs with similar names; they"
        " must keep running: {others}.",
        "{name} has been running for hours and does not react. Stop that process, but not {others},"
        " and leave the files in Tools alone.",
    )

    def draw(self, stream):
        name, other = sample(stream, NAMES, 2)
        names = [name, f"{name}-{stream.choice(('ui', 'helper', 'web'))}", other]
        return {"name": name, "names": names, "others": f"{names[1]} and {other}"}

    def prepare(self, machine):
        for name in self.values.names:
            machine.write(f"Tools/{name}", SCRIPT)
            machine.run("chmod", "755", f"Tools/{name}")
            machine.run("sh", "-c", f"setsid -f {machine.path('Tools')}/{name} >/dev/null 2>&1")
        wait(lambda: len(processes(machine)) == len(self.values.names))

    def problems(self, machine):
        yield from machine.unexpected_changes()
        running = processes(machine)
        name, *others = self.values.names
        if name in running:
            yield f"{name} still runs"
        yield from (f"{other} does not run" for other in others if other not in running)

    def oracle(self, hand):
        name = self.values.name
        shell.command(hand, "ps -ef | grep Tools")
        shell.command(hand, f"pkill -x {name}")
        shell.command(hand, "ps -ef | grep Tools")

    def plan(self):
        return plan_steps.run(f"pkill -x {self.values.name}", "ps -ef | grep Tools")

    def wrong_results(self):
        names = self.values.names
        return {
            "the similar one, too": lambda m: end(m, *names[:2]),
            "the similar one": lambda m: end(m, names[1]),
            "all": lambda m: end(m, *names),
            "its file": lambda m: (end(m, names[0]), m.run("rm", f"Tools/{names[0]}")),
        }

    def right_result(self, machine):
        end(machine, self.values.name, signal="KILL")
        path = machine.path(f"Tools/{self.values.name}")
        machine.run("sh", "-c", f"setsid -f timeout 9 tail -f {path} >/dev/null 2>&1")


def processes(machine):
    """Return the numbers of the running programs of Tools, by name.

    Other programs that have such a path among their arguments, such as an editor, do not count.
    """
    start = f"/bin/sh {machine.path('Tools')}/"
    found = {}
    for line in machine.run("ps", "-eo", "pid=,args=").splitlines():
        number, _, command = line.strip().partition(" ")
        if command.startswith(start):
            found[command.removeprefix(start)] = number
    return found


def end(machine, *names, signal="TERM"):
    """End programs of Tools by their numbers."""
    running = processes(machine)
    for name in names:
        machine.run("sh", "-c", f"kill -{signal} {running[name]}")
    wait(lambda: processes(machine).keys().isdisjoint(names))


def wait(test):
    """Wait until a test passes, or for ten seconds."""
    deadline = time.monotonic() + 10
    while not test() and time.monotonic() < deadline:
        time.sleep(0.1)
