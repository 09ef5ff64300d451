"""Delete the pages of one site from the history."""

import re

from online_env.tasks import Task
from online_env.tasks.kit import chromium, plan_steps
from online_env.tasks.kit.pages import enter, visit
from online_env.tasks.kit.sample_links import HOSTS, PAGES
from online_env.tasks.kit.word_lists import sample
from online_env.tasks.plan_words import quoted


class ForgetSite(Task):
    """The history of an afternoon holds pages of several sites; those of one site go."""

    name = "forget_site"
    domain = "browser"
    apps = ("chrome",)
    phrasings = (
        "Delete all pages of {host} from Chromium's history, and keep the rest of it.",
        "Nobody should see in the browser that I was on {host}. Please remove its pages from the"
        " history, but leave the other sites there.",
        "Remove {host} from the browser history; do not delete anything else.",
    )

    def draw(self, stream):
        pages = [(url, title) for title, url in sample(stream, PAGES, 10)]
        return {"pages": pages, "host": stream.choice(sorted(hosts_of(pages)))}

    def prepare(self, machine):
        chromium.write_history(machine, self.values.pages)

    def problems(self, machine):
        yield from machine.unexpected_changes()
        kept = {
            url for url, _ in self.values.pages if self.values.host not in hosts_of([(url, "")])
        }
        found = chromium.history(machine)
        left = sorted(url for url in found if f"//{self.values.host}" in url)
        if left:
            yield f"the history still has {left}"
        for url in sorted(kept - found):
            yield f"{url} is gone from the history"

    def oracle(self, hand):
        visit(hand, "chrome://history/", "History")
        if hand.see("push-button", "Search history"):  # a narrow window hides the field
            hand.button("Search history")
        enter(hand, "Search history", self.values.host)
        hand.press("enter")
        titles = [title for url, title in self.values.pages if f"//{self.values.host}/" in url]
        hand.find(("static", "heading", "section"), re.compile("Found |No search results"))
        for title in titles:
            box = hand.see("check-box", re.compile(f".*{re.escape(title)} {self.values.host}"))
            if box is not None and "checked" not in box.states:
                hand.click(box)
        if hand.see("push-button", "Delete"):
            hand.button("Delete")
            hand.find("dialog", "Delete selected items")
            hand.button("Delete")
            hand.wait_until_gone("dialog", "Delete selected items")

    def plan(self):
        return [
            'window "Chromium"',
            *plan_steps.visit("chrome://history/", "Search history"),
            'click "Search history"',
            f"type {quoted(self.values.host)}",
            "press enter",
            'click "Found"',
            "press ctrl+a",
            'wait for "selected"',
            'click "Delete"',
            'click "Delete" near "Cancel"',
            'wait for "No search results"',
        ]

    def wrong_results(self):
        write, pages, host = chromium.write_history, self.values.pages, self.values.host
        kept = [page for page in pages if f"//{host}/" not in page[0]]
        return {
            "one page is left": lambda m: write(m, [*kept, (f"http://{host}/left", "Left")]),
            "all": lambda m: write(m, []),
            "one page too many": lambda m: write(m, kept[1:]),
        }

    def right_result(self, machine):
        chromium.write_history(
            machine, [p for p in self.values.pages if f"//{self.values.host}/" not in p[0]]
        )


def hosts_of(pages):
    """Return the sites of pages."""
    return {host for host in HOSTS if any(f"//{host}/" in url for url, _ in pages)}
