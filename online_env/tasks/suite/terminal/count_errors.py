"""Count the lines of a log that report an error, and save the number."""

from online_env.tasks import Task
from online_env.tasks.kit import plan_steps, shell
from online_env.tasks.kit.word_lists import GOODS

SERVICES = ("printer", "mailer", "backup", "webshop", "heating")
LEVELS = ("INFO", "INFO", "WARNING", "ERROR")
TEXTS = (
    "order of one {thing} stored",
    "no error while the {thing} was checked",
    "{thing} not found, tried again",
    "Error page for {thing} sent",
)


class CountErrors(Task):
    """The word also stands in other lines, in small letters."""

    name = "count_errors"
    domain = "terminal"
    apps = ("terminal",)
    phrasings = (
        "How many lines of Documents/logs/{log} contain the word ERROR (in capital letters)? Write"
        " just the number into the file Documents/{answer}.",
        "Count the lines with ERROR in ~/Documents/logs/{log} and save the count, nothing else, as"
        " ~/Documents/{answer}. Only capital letters count.",
        "Please use the terminal to find out how often {log} (in Documents/logs) reports ERROR, in"
        " lines, in capitals. I want the bare number in a file {answer} in Documents.",
    )

    def draw(self, stream):
        service = stream.choice(SERVICES)
        lines = []
        for index in range(stream.integer(60, 140)):
            text = stream.choice(TEXTS).format(thing=stream.choice(GOODS))
            time = f"{8 + index // 60:02}:{index % 60:02}"
            lines.append(f"{time} {stream.choice(LEVELS)} {service}: {text}")
        return {
            "log": f"{service}.log",
            "path": f"Documents/logs/{service}.log",
            "lines": lines,
            "count": sum(" ERROR " in line for line in lines),
            "answer": f"{service}-errors.txt",
        }

    def prepare(self, machine):
        machine.write(self.values.path, "\n".join(self.values.lines) + "\n")
        machine.write("Documents/logs/old.log", "07:59 ERROR nothing of today\n")

    def problems(self, machine):
        answer = f"Documents/{self.values.answer}"
        yield from machine.unexpected_changes(answer)
        found = machine.text(answer)
        if found is None or found.strip() != str(self.values.count):
            yield f"{answer} holds {(found or '')[:80]!r}, not {self.values.count}"

    def oracle(self, hand):
        shell.command(hand, f"head -5 {self.values.path}")
        shell.command(hand, f"grep -c ERROR {self.values.path} > Documents/{self.values.answer}")
        shell.command(hand, f"cat Documents/{self.values.answer}")

    def plan(self):
        path, answer = self.values.path, f"Documents/{self.values.answer}"
        return plan_steps.run(f"grep -c ERROR {path} > {answer}", f"cat {answer}")

    def wrong_results(self):
        lines = self.values.lines
        everywhere = sum("error" in line.lower() for line in lines)
        return {
            "small letters, too": lambda m: self.save(m, everywhere),
            "all lines": lambda m: self.save(m, len(lines)),
            "the lines themselves": lambda m: self.save(m, "\n".join(lines)),
            "in the folder of the logs": lambda m: m.write(
                f"Documents/logs/{self.values.answer}", str(self.values.count)
            ),
        }

    def right_result(self, machine):
        self.save(machine, f" {self.values.count}")

    def save(self, machine, answer):
        """Write an answer."""
        machine.write(f"Documents/{self.values.answer}", str(answer))
