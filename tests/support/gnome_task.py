"""A small task on GNOME: a file is renamed in GNOME Terminal."""

import time

from online_env.desktops import commands
from online_env.errors import DesktopTimeoutError
from online_env.tasks import Task

OPEN_TIMEOUT_S = 30.0


class RenameInTerminal(Task):
    """One of two files gets a new name; the other stays."""

    name = "rename_in_terminal"
    apps = ()  # GNOME's applications are not among those of the library's tasks
    phrasings = ("Rename the file {old} in Documents to {new}, in the terminal.",)

    def draw(self, stream):
        """The year in both names."""
        year = stream.integer(2019, 2025)
        return {"old": f"report-{year}.txt", "new": f"final-{year}.txt"}

    def prepare(self, machine):
        """Both files, and a terminal."""
        machine.write(f"Documents/{self.values.old}", "the report\n")
        machine.write("Documents/other.txt", "something else\n")
        commands.launch(machine.desktop, "gnome-terminal")
        end = time.monotonic() + OPEN_TIMEOUT_S
        while "user@" not in machine.desktop.execute(["wmctrl", "-l"]).output:
            if time.monotonic() > end:
                raise DesktopTimeoutError(f"GNOME Terminal shows no window in {OPEN_TIMEOUT_S:g} s")
            time.sleep(0.2)

    def problems(self, machine):
        """The file has its new name and its old content, and nothing else changed."""
        old, new = f"Documents/{self.values.old}", f"Documents/{self.values.new}"
        yield from machine.unexpected_changes(old, new)
        if machine.exists(old):
            yield f"{old} is still there"
        if machine.text(new) != "the report\n":
            yield f"{new} is not the report"

    def oracle(self, hand):
        """Types commands into the terminal, a line a step."""
        hand.click_on("terminal", app="gnome-terminal")
        for line in ("cd ~/Documents", "ls", f"mv {self.values.old} {self.values.new}", "clear"):
            hand.type(f"{line}\n")
