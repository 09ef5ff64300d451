"""Give a bookmark in a folder another name."""

from online_env.tasks import Task
from online_env.tasks.kit import chromium
from online_env.tasks.kit.pages import enter, open_folder, pick, visit
from online_env.tasks.kit.sample_links import bar

NAMES = ("Read on Sunday", "For Oda", "Look at this again", "Holiday", "Print this", "Best of all")


class RenameBookmark(Task):
    """One of many bookmarks, in one of the folders; its address and all others stay."""

    name = "rename_bookmark"
    domain = "browser"
    apps = ("chrome",)
    phrasings = (
        'In the bookmarks of Chromium, in the folder "{folder}", rename the bookmark "{old}" to'
        ' "{new}".',
        'My bookmark "{old}" (folder {folder} of the bookmarks bar) should be called "{new}".'
        " Please change its name and nothing else.",
        'Rename the bookmark {old} in {folder} to "{new}".',
    )

    def draw(self, stream):
        entries = bar(stream)
        folder, children = entries[stream.integer(0, 2)]
        old, url = stream.choice(children)
        new = stream.choice(NAMES)
        return {"entries": entries, "folder": folder, "old": old, "url": url, "new": new}

    def prepare(self, machine):
        chromium.write_bookmarks(machine, self.values.entries)

    def problems(self, machine):
        yield from machine.unexpected_changes()
        yield from chromium.wrong_bookmarks(machine, self.renamed())

    def renamed(self, new=""):
        """Return the bookmarks as they should be, or with another new name."""
        names = {self.values.url: new or self.values.new}
        return [
            (folder, [(names.get(url, old), url) for old, url in pages])
            for folder, pages in self.values.entries
        ]

    def oracle(self, hand):
        visit(hand, "chrome://bookmarks/", "Bookmarks")
        open_folder(hand, self.values.folder)
        if hand.see("push-button", f"More actions for {self.values.new}"):
            return
        pick(hand, f"More actions for {self.values.old}", 0)
        enter(hand, "Name", self.values.new)
        hand.button("Save")
        hand.find("push-button", f"More actions for {self.values.new}")

    def wrong_results(self):
        drawn, write = self.values, chromium.write_bookmarks
        added = [*drawn.entries, (drawn.new, drawn.url)]
        as_folder = [(drawn.new if n == drawn.folder else n, v) for n, v in drawn.entries]
        return {
            "added, not renamed": lambda m: write(m, added),
            "the folder": lambda m: write(m, as_folder),
            "another name": lambda m: write(m, self.renamed(new=drawn.new + "!")),
            "all others removed": lambda m: write(m, self.renamed()[:1]),
        }

    def right_result(self, machine):
        chromium.write_bookmarks(machine, self.renamed()[::-1])
