"""Delete the bookmarks that lead to one site."""

from online_env.tasks import Task
from online_env.tasks.kit import chromium, plan_steps
from online_env.tasks.kit.pages import enter, visit
from online_env.tasks.kit.sample_links import HOSTS, bar, without
from online_env.tasks.plan_words import quoted


class DeleteBookmarks(Task):
    """Bookmarks of one site are in several folders; all of them go, and no others."""

    name = "delete_bookmarks"
    domain = "browser"
    apps = ("chrome",)
    phrasings = (
        "Delete all bookmarks in Chromium that lead to {host}. Keep the others, and the folders.",
        "I no longer need the bookmarks of pages on {host}. Please remove them from the browser,"
        " whatever folder they are in, but no folders and no other bookmarks.",
        "Remove every {host} bookmark from Chromium; leave the rest, with its folders.",
    )

    def draw(self, stream):
        return {"entries": bar(stream), "host": stream.choice(HOSTS)}

    def prepare(self, machine):
        chromium.write_bookmarks(machine, self.values.entries)

    def going(self):
        """Return the bookmarks that go."""
        pairs = [pair for _, value in self.values.entries for pair in value]
        return [pair for pair in pairs if f"//{self.values.host}/" in pair[1]]

    def problems(self, machine):
        yield from machine.unexpected_changes()
        yield from chromium.wrong_bookmarks(machine, without(self.values.entries, self.values.host))

    def oracle(self, hand):
        visit(hand, "chrome://bookmarks/", "Bookmarks")
        for name, _ in self.going():
            enter(hand, "Search bookmarks", name)
            hand.press("enter")
            hand.wait_until_gone("push-button", f"More actions for {self.values.entries[0][0]}")
            if hand.see("push-button", f"More actions for {name}"):
                hand.click_on("static", name)
                hand.press("delete")
                hand.wait_until_gone("push-button", f"More actions for {name}")

    def plan(self):
        steps = ['window "Chromium"']
        for name, _ in self.going():
            steps += [
                *plan_steps.visit("chrome://bookmarks/", "Search bookmarks"),
                'click "Search bookmarks"',
                "press ctrl+a",
                f"type {quoted(name)}",
                "press enter",
                "wait",
                f'click {quoted(name)} near "Bookmarks"',
                "press delete",
                "wait",
            ]
        return steps

    def wrong_results(self):
        write, entries, host = chromium.write_bookmarks, self.values.entries, self.values.host
        remaining = without(entries, host)
        other_host = next(name for name in HOSTS if name != host)
        return {
            "another site": lambda m: write(m, without(entries, other_host)),
            "one is left": lambda m: write(m, [*remaining, self.going()[0]]),
            "with their folders": lambda m: write(m, remaining[1:]),
            "all": lambda m: write(m, []),
        }

    def right_result(self, machine):
        chromium.write_bookmarks(machine, without(self.values.entries, self.values.host)[::-1])
