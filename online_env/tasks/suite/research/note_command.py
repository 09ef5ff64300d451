"""Find a command in the handbook and save it."""

import re

from online_env.tasks import Task
from online_env.tasks.kit import plan_steps
from online_env.tasks.kit.notes import take_note, unlike
from online_env.tasks.kit.pages import arrived, enter, follow, visit
from online_env.tasks.plan_words import quoted

# What somebody needs, the page that has it, and the command.
COMMANDS = (
    ("change the passphrase of a store", "Encryption keys", "stow key change"),
    ("see which snapshots tidying up would remove", "Retention rules", "stow tidy --dry-run"),
    ("check the configuration file for mistakes", "Configuration file", "stow config check"),
    ("print the last run for other programs", "Logs and alerts", "stow log --json"),
    ("list the last three snapshots", "Restore files", "stow list --last 3"),
    ("see whether the system service runs", "Back up a server", "sudo stow service status"),
    ("remove a lock that another machine left", "Troubleshooting", "stow unlock"),
    ("install it on Fedora", "Installation", "sudo dnf install stowaway"),
    ("install it on Debian", "Installation", "sudo apt install stowaway"),
    ("restore a whole machine", "Restore files", "stow restore latest / --as-root"),
    ("read back five per cent of a store", "Quick start", "stow check --sample 5%"),
)


class NoteCommand(Task):
    """The right command among many on the pages of a handbook, into a text file."""

    name = "note_command"
    domain = "research"
    apps = ("chrome", "mousepad")
    unsolvable = {"network_error": "the handbook cannot be reached"}
    phrasings = (
        "The handbook of the backup program Stowaway is at docs.test. Which command do I need to"
        " {need}? Save the whole command, with its options, in {path}.",
        "Please find out in the handbook of Stowaway, http://docs.test, how to {need}, and write"
        " the command, exactly as given there and nothing else, to {path}.",
        "I have a question about Stowaway: how do I {need}? Look at docs.test (the page {page} has"
        " it) and put the command line into {path}.",
    )

    def draw(self, stream):
        need, page, command = stream.choice(COMMANDS)
        folder = stream.choice(("Documents", "Desktop"))
        path = f"{folder}/stowaway-{stream.integer(10, 99)}.txt"
        return {"need": need, "page": page, "command": command, "path": path}

    def initial_app(self, machine):
        return "chrome", "http://docs.test/"

    def problems(self, machine):
        yield from machine.unexpected_changes(self.values.path)
        text = machine.text(self.values.path) or ""
        prompt = "$ " if text.lstrip().startswith("$ ") else ""  # some of the pages have one
        yield from unlike(machine, self.values.path, [prompt + self.values.command], verbatim=True)

    def oracle(self, hand):
        visit(hand, "http://docs.test/", "Stowaway")
        enter(hand, "Search the documentation", self.values.page)
        hand.press("enter")
        arrived(hand, "Search")
        follow(hand, self.values.page, f"{self.values.page} - Stowaway")
        hand.find(
            ("static", "section"), re.compile(f".*{re.escape(self.values.command)}"), scroll=True
        )
        take_note(hand, self.values.path, self.values.command)

    def plan(self):
        return [
            'window "Chromium"',
            f"click {quoted(self.values.page)}",
            f"scroll down to {quoted(self.values.command)}",
            *plan_steps.take_note(self.values.path, self.values.command),
        ]

    def wrong_results(self):
        path, command = self.values.path, self.values.command
        return {
            "half the command": lambda m: m.write(path, command.rpartition(" ")[0]),
            "with a sentence": lambda m: m.write(path, f"You need {command}."),
            "in the home folder": lambda m: m.write("stowaway.txt", command),
            "one option more": lambda m: m.write(path, f"{command} --help"),
            "with a capital": lambda m: m.write(path, command.capitalize()),
            "with a full stop": lambda m: m.write(path, f"{command}."),
        }

    def right_result(self, machine):
        machine.write(self.values.path, f"$ {self.values.command}\n\n")
