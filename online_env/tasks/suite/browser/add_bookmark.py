"""Bookmark a page in one of the folders of the bookmarks bar."""

from online_env.tasks import Task
from online_env.tasks.kit import chromium, plan_steps
from online_env.tasks.kit.pages import enter, open_folder, pick, visit
from online_env.tasks.kit.sample_links import PAGES, bar
from online_env.tasks.plan_words import quoted

NAMES = ("For the weekend", "To read", "Ask Tomas", "Good one", "Remember this", "For later")


class AddBookmark(Task):
    """A page, a name for it, and the folder where it goes."""

    name = "add_bookmark"
    domain = "browser"
    apps = ("chrome",)
    phrasings = (
        'Add a bookmark for {url} to the folder "{folder}" of Chromium\'s bookmarks bar and name'
        ' it "{new}".',
        'Please bookmark the page {url} as "{new}", in my bookmarks folder {folder}.',
        'New bookmark in Chromium: "{new}", {url}, folder {folder}.',
    )

    def draw(self, stream):
        entries = bar(stream)
        used = {url for _, children in entries for _, url in children}
        url = stream.choice([url for _, url in PAGES if url not in used])
        folder = entries[stream.integer(0, 2)][0]
        return {"entries": entries, "url": url, "folder": folder, "new": stream.choice(NAMES)}

    def prepare(self, machine):
        chromium.write_bookmarks(machine, self.values.entries)

    def problems(self, machine):
        yield from machine.unexpected_changes()
        yield from chromium.wrong_bookmarks(machine, self.added(self.values.folder))

    def added(self, folder, name=""):
        entry = (name or self.values.new, self.values.url)
        return [(n, [*v, entry] if n == folder else v) for n, v in self.values.entries]

    def oracle(self, hand):
        visit(hand, "chrome://bookmarks/", "Bookmarks")
        open_folder(hand, self.values.folder)
        if hand.see("push-button", f"More actions for {self.values.new}"):
            return
        pick(hand, "Organize", 1)
        enter(hand, "Name", self.values.new)
        enter(hand, "URL", self.values.url)
        hand.button("Save")
        hand.find("push-button", f"More actions for {self.values.new}")

    def plan(self):
        return [
            'window "Chromium"',
            *plan_steps.visit(self.values.url, self.values.url.removeprefix("http://")),
            "press ctrl+d",
            'wait for "Done"',
            "press ctrl+a",
            f"type {quoted(self.values.new)}",
            'click right of "Folder"',
            f"click {quoted(self.values.folder)}",
            'click "Done"',
            "wait",
        ]

    def wrong_results(self):
        write, drawn = chromium.write_bookmarks, self.values
        other = next(name for name, _ in drawn.entries if name != drawn.folder)
        return {
            "in another folder": lambda m: write(m, self.added(other)),
            "in no folder": lambda m: write(m, [*drawn.entries, (drawn.new, drawn.url)]),
            "another name": lambda m: write(m, self.added(drawn.folder, "Page")),
            "in a new folder as well": lambda m: write(
                m, [*self.added(drawn.folder), ("New", [(drawn.new, drawn.url)])]
            ),
        }

    def right_result(self, machine):
        chromium.write_bookmarks(machine, self.added(self.values.folder)[::-1])
