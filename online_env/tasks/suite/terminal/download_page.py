"""Save a page of a web site from the terminal."""

from online_env.tasks import Task
from online_env.tasks.kit import plan_steps, shell
from online_env.tasks.kit.served_pages import served_page

SLUGS = (
    "concepts",
    "commands",
    "exit-codes",
    "faq",
    "installation",
    "retention-rules",
    "schedules",
)
HOST = "docs.test"


class DownloadPage(Task):
    """The file is the page as the server sends it, in a folder that has to be made."""

    name = "download_page"
    domain = "terminal"
    apps = ("terminal",)
    unsolvable = {"network_error": "the site cannot be reached"}
    phrasings = (
        "Download the web page http://docs.test/{slug} with curl (or wget) and save its HTML as"
        " {file} in a new folder Documents/{folder}.",
        "I want to read http://docs.test/{slug} offline. Please fetch it in the terminal and save"
        " the HTML, unchanged, as Documents/{folder}/{file}; create the folder.",
        "mkdir Documents/{folder}, then save http://docs.test/{slug} there as {file} (HTML).",
    )

    def draw(self, stream):
        slug = stream.choice(SLUGS)
        return {
            "slug": slug,
            "other": SLUGS[SLUGS.index(slug) - 1],
            "folder": f"{stream.choice(('manual', 'offline', 'saved'))}-{stream.integer(10, 99)}",
            "file": f"{slug}.html",
        }

    @property
    def path(self):
        """Where the page should be."""
        return f"Documents/{self.values.folder}/{self.values.file}"

    def problems(self, machine):
        yield from machine.unexpected_changes(self.path)
        found = machine.read(self.path)
        if found is None:
            yield f"there is no {self.path}"
        elif found.strip() != page(machine, self.values.slug).strip():
            yield f"{self.path} is not the page {self.values.slug}: {found[:80]}"

    def oracle(self, hand):
        path = self.path
        shell.command(hand, f"mkdir -p ~/Documents/{self.values.folder}")
        shell.command(hand, f"curl -o ~/{path} http://{HOST}/{self.values.slug}")
        shell.command(hand, f"head -5 ~/{path}")

    def plan(self):
        path = f"~/{self.path}"
        return [
            *plan_steps.run(
                f"mkdir -p ~/Documents/{self.values.folder}",
                f"curl -o {path} http://{HOST}/{self.values.slug}",
            ),
            "wait",
            *plan_steps.run(f"head -5 {path}"),
        ]

    def wrong_results(self):
        slug, other, path = self.values.slug, self.values.other, self.path
        return {
            "another page": lambda m: m.write(path, page(m, other)),
            "an empty file": lambda m: m.write(path, ""),
            "half of it": lambda m: m.write(path, page(m, slug)[:2000]),
            "in Documents": lambda m: m.write(f"Documents/{slug}.html", page(m, slug)),
        }

    def right_result(self, machine):
        machine.write(self.path, page(machine, self.values.slug) + b"\n")


def page(machine, slug):
    """Return a page as the site sends it."""
    return served_page(machine, HOST, f"/{slug}")
