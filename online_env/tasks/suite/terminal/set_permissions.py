"""Make scripts executable, and keep a secret from others."""

from online_env.tasks import Task
from online_env.tasks.kit import plan_steps, shell
from online_env.tasks.kit.sample_files import content, mode
from online_env.tasks.kit.word_lists import GOODS, sample

WORK = ("backup", "report", "cleanup", "upload", "rotate", "convert", "publish")
RUNS = 0o500  # the shell also has to read a script
OTHERS_WRITE = 0o022
SECRETS = ("passwords.txt", "token.txt", "private.key", "bank.csv")


class SetPermissions(Task):
    """All scripts of a folder, but no other file; and one file for the owner alone."""

    name = "set_permissions"
    domain = "terminal"
    apps = ("terminal",)
    phrasings = (
        "Make all scripts (*.sh) in Documents/{folder} executable. The file {secret} in the same"
        " folder should be readable and writable for me only, and for nobody else.",
        "Please set permissions in ~/Documents/{folder}: every .sh file must be executable,"
        " and {secret} must be 600.",
        "In my folder Documents/{folder} the shell scripts cannot be run because they are not"
        " executable. Change that. And nobody but me should be able to read or write {secret}"
        " there.",
    )

    def draw(self, stream):
        folder = stream.choice(("scripts", "jobs", "server", "automation"))
        thing = stream.choice(GOODS)
        scripts = [f"{word}-{thing}.sh" for word in sample(stream, WORK, stream.integer(3, 5))]
        secret, other = sample(stream, SECRETS, 2)
        place = f"Documents/{folder}"
        return {
            "folder": folder,
            "place": place,
            "scripts": [f"{place}/{name}" for name in scripts],
            "secret": secret,
            "key": f"{place}/{secret}",
            "others": [f"{place}/{other}", f"{place}/readme.sh.txt"],
        }

    def prepare(self, machine):
        for path in self.values.scripts:
            machine.write(path, f"#!/bin/sh\necho 'This is {path}.'\n")
        for path in (self.values.key, *self.values.others):
            machine.write(path, f"Content of {path}\n")
        machine.run("chmod", "644", *self.values.scripts, self.values.key, *self.values.others)

    def problems(self, machine):
        scripts, key = self.values.scripts, self.values.key
        yield from machine.unexpected_changes(*scripts, key)
        was = machine.before.files
        now = machine.snapshot().files
        for path in (*scripts, key):
            look = now.get(path, "")
            if content(look) != content(was[path]):
                yield f"{path} cannot be read, or is not what it was"
            elif path == key and mode(look) != 0o600:
                yield f"{path} has the mode {mode(look):o}, not 600"
            elif path != key and (mode(look) & RUNS != RUNS or mode(look) & OTHERS_WRITE):
                yield f"{path} has the mode {mode(look):o}, and should be executable"

    def oracle(self, hand):
        shell.command(hand, f"cd ~/{self.values.place}")
        shell.command(hand, "chmod +x *.sh")
        shell.command(hand, f"chmod 600 {self.values.secret}")
        shell.command(hand, "ls -l")

    def plan(self):
        return plan_steps.run(
            f"cd ~/{self.values.place}", "chmod +x *.sh", f"chmod 600 {self.values.secret}", "ls -l"
        )

    def wrong_results(self):
        scripts, key = self.values.scripts, self.values.key
        other = self.values.others[0]
        return {
            "the secret is as before": lambda m: m.run("chmod", "755", *scripts),
            "one script is left": lambda m: self.change(m, scripts[1:], key),
            "another secret": lambda m: self.change(m, scripts, other),
            "all files": lambda m: self.change(m, [*scripts, other], key),
            "everybody may write": lambda m: self.change(m, scripts, key, "777"),
            "scripts that nobody may read": lambda m: self.change(m, scripts, key, "111"),
        }

    def right_result(self, machine):
        self.change(machine, self.values.scripts, self.values.key, "744")

    def change(self, machine, scripts, key, mode="755"):
        """Set modes."""
        machine.run("chmod", mode, *scripts)
        machine.run("chmod", "600", key)
