"""Make scripts executable, and keep a secret from others."""

from online_env.tasks import Task
from online_env.tasks.kit import plan_steps, shell
from online_env.tasks.kit.sample_files import kind_and_digest, mode
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
        item = stream.choice(GOODS)
        scripts = [f"{word}-{item}.sh" for word in sample(stream, WORK, stream.integer(3, 5))]
        secret, other_file = sample(stream, SECRETS, 2)
        folder_path = f"Documents/{folder}"
        return {
            "folder": folder,
            "place": folder_path,
            "scripts": [f"{folder_path}/{name}" for name in scripts],
            "secret": secret,
            "key": f"{folder_path}/{secret}",
            "others": [f"{folder_path}/{other_file}", f"{folder_path}/readme.sh.txt"],
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
        after = machine.snapshot().files
        for path in (*scripts, key):
            look = after.get(path, "")
            if kind_and_digest(look) != kind_and_digest(was[path]):
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
        other_file = self.values.others[0]
        return {
            "the secret is as before": lambda m: m.run("chmod", "755", *scripts),
            "one script is left": lambda m: self.change(m, scripts[1:], key),
            "another secret": lambda m: self.change(m, scripts, other_file),
            "all files": lambda m: self.change(m, [*scripts, other_file], key),
            "everybody may write": lambda m: self.change(m, scripts, key, "777"),
            "scripts that nobody may read": lambda m: self.change(m, scripts, key, "111"),
        }

    def right_result(self, machine):
        self.change(machine, self.values.scripts, self.values.key, "744")

    def change(self, machine, scripts, key, mode="755"):
        """Set modes."""
        machine.run("chmod", mode, *scripts)
        machine.run("chmod", "600", key)
