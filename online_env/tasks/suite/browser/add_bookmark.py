"""Bookmark a page in one of the folders of the bookmarks bar."""

from online_env.tasks import Task
from online_env.tasks.kit import chromium, told
from online_env.tasks.kit.links import PAGES, bar
from online_env.tasks.kit.pages import enter, open_folder, pick, visit
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
        chromium.write_bookmarks(machine, self.drawn.entries)

    def problems(self, machine):
        yield from machine.untouched()
        yield from chromium.wrong_bookmarks(machine, self.added(self.drawn.folder))

    def added(self, folder, name=""):
        entry = (name or self.drawn.new, self.drawn.url)
        return [(n, [*v, entry] if n == folder else v) for n, v in self.drawn.entries]

    def oracle(self, hand):
        visit(hand, "chrome://bookmarks/", "Bookmarks")
        open_folder(hand, self.drawn.folder)
        if hand.see("push-button", f"More actions for {self.drawn.new}"):
            return
        pick(hand, "Organize", 1)
        enter(hand, "Name", self.drawn.new)
        enter(hand, "URL", self.drawn.url)
        hand.button("Save")
        hand.find("push-button", f"More actions for {self.drawn.new}")

    def plan(self):
        return [
            'window "Chromium"',
            *told.visit(self.drawn.url, self.drawn.url.removeprefix("http://")),
            "press ctrl+d",
            'wait for "Done"',
            "press ctrl+a",
            f"type {quoted(self.drawn.new)}",
            'click right of "Folder"',
            f"click {quoted(self.drawn.folder)}",
            'click "Done"',
            "wait",
        ]

    def wrong(self):
        write, drawn = chromium.write_bookmarks, self.drawn
        other = next(name for name, _ in drawn.entries if name != drawn.folder)
        return {
            "in another folder": lambda m: write(m, self.added(other)),
            "in no folder": lambda m: write(m, [*drawn.entries, (drawn.new, drawn.url)]),
            "another name": lambda m: write(m, self.added(drawn.folder, "Page")),
            "in a new folder as well": lambda m: write(
                m, [*self.added(drawn.folder), ("New", [(drawn.new, drawn.url)])]
            ),
        }

    def right(self, machine):
        chromium.write_bookmarks(machine, self.added(self.drawn.folder)[::-1])
