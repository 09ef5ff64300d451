"""Set an environment variable for every login."""

from online_env.tasks import Task
from online_env.tasks.kit import shell
from online_env.tasks.kit.word_lists import CITIES, GOODS
from online_env.tasks.plan_words import quoted

FILE = ".profile"
NAMES = ("PROJECT_HOME", "REPORT_LANG", "BACKUP_TARGET", "MAP_STYLE", "TEAM_NAME")
SHELL = f'timeout 9 env -i HOME="$HOME" PATH="$PATH" sh -c ". ./{FILE}; env"'


class SetVariable(Task):
    """The file has other variables, which stay; one of them has nearly the same name."""

    name = "set_variable"
    domain = "terminal"
    apps = ("terminal",)
    phrasings = (
        'Add the environment variable {key} with the value "{value}" to the file .profile in my'
        " home folder, so that it is exported at every login. Keep what is in the file.",
        "Please make sure that {key} is set to {value} and exported whenever I log in: put it into"
        " ~/.profile, next to the other lines.",
        "~/.profile should export {key}={value}. The rest of the file stays as it is.",
    )

    def draw(self, stream):
        key = stream.choice(NAMES)
        value = f"{stream.choice(GOODS)}-{stream.integer(100, 999)}"
        others = [f"{key}_OLD={stream.choice(GOODS)}", f"HOME_TOWN={stream.choice(CITIES)}"]
        lines = [
            '[ -n "$BASH_VERSION" ] && [ -f "$HOME/.bashrc" ] && . "$HOME/.bashrc"',
            *(f"export {entry}" for entry in others),
            "umask 022",
        ]
        before = "\n".join(lines) + "\n"
        return {"key": key, "value": value, "others": others, "before": before}

    def prepare(self, machine):
        machine.write(FILE, self.values.before)

    def problems(self, machine):
        yield from machine.unexpected_changes()
        lines = (machine.text(FILE) or "").splitlines()
        lost = [line for line in self.values.before.splitlines() if line not in lines]
        if lost:
            yield f"{FILE} lacks {lost}"
        result = machine.desktop.execute(["sh", "-c", f"cd && {SHELL}"])
        wanted = {f"{self.values.key}={self.values.value}", *self.values.others}
        names = {entry.partition("=")[0] for entry in wanted}
        exported = result.output.splitlines()
        found = {entry for entry in exported if entry.partition("=")[0] in names}
        if found != wanted:
            yield f"a login shell exports {sorted(found)} ({result.error.strip()[-100:]})"

    def oracle(self, hand):
        line = f"export {self.values.key}={self.values.value}"
        shell.command(hand, f"cat ~/{FILE}")
        shell.command(hand, f"grep -qxF '{line}' ~/{FILE} || echo '{line}' >> ~/{FILE}")
        shell.command(hand, f"tail -2 ~/{FILE}")

    def plan(self):
        line = f"export {self.values.key}={self.values.value}"
        return [
            'window "Terminal"',
            'wait for "user@desktop"',
            f"type {quoted(f'cat ~/{FILE}')}",
            "press enter",
            'wait for "umask"',
            f"type {quoted(f'echo {line} >> ~/{FILE}')}",
            "press enter",
            f"type {quoted(f'tail -1 ~/{FILE}')}",
            "press enter",
            f"wait for {quoted(line)}",
        ]

    def wrong_results(self):
        before, key, value = self.values.before, self.values.key, self.values.value
        line = f"export {key}={value}\n"
        return {
            "the rest is gone": lambda m: m.write(FILE, line),
            "not exported": lambda m: m.write(FILE, f"{before}{key}={value}\n"),
            "another value": lambda m: m.write(FILE, f"{before}export {key}={value}0\n"),
            "in another file": lambda m: m.write(".bashrc", line),
            "the old variable": lambda m: m.write(FILE, f"{before}export {key}_OLD={value}\n"),
            "both of them": lambda m: m.write(FILE, f"{before}{line}export {key}_OLD={value}\n"),
        }

    def right_result(self, machine):
        key, value = self.values.key, self.values.value
        end = '[ -n "$BASH_VERSION" ] && echo hello\n'
        machine.write(FILE, f"{key}='{value}'\nexport {key}\n{self.values.before}{end}")
