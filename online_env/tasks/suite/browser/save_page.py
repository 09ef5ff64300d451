"""Save a web page as a file."""

from online_env.embedded.sites.library import articles, plain
from online_env.tasks import Task
from online_env.tasks.kit import told
from online_env.tasks.kit.apps import APPS
from online_env.tasks.kit.articles import address
from online_env.tasks.kit.pages import visit
from online_env.tasks.kit.words import TOPICS

FOLDERS = ("Documents", "Desktop", "Downloads")


class SavePage(Task):
    """An article of the wiki as an HTML file, with its pictures or without."""

    name = "save_page"
    domain = "browser"
    apps = ("chrome",)
    unsolvable = {"network_error": "the page cannot be loaded"}
    phrasings = (
        'Save the page of the article "{title}" ({url}) as a web page {file} in the folder'
        " {folder}.",
        "Please save {url} with the browser, as an HTML file named {file}, in my {folder} folder.",
        "Store {url} as {folder}/{file} (HTML).",
    )

    def draw(self, stream):
        article = stream.choice(list(articles("wiki").values()))
        file = f"{stream.choice(TOPICS)}-{stream.integer(10, 99)}.html"
        folder = stream.choice(FOLDERS)
        return {
            "title": article.title,
            "words": plain(article.body)[:40],
            "url": address(article.title),
            "file": file,
            "folder": folder,
            "path": f"{folder}/{file}",
        }

    def problems(self, machine):
        path = self.drawn.path
        yield from machine.untouched(path, f"{path.removesuffix('.html')}_files*")
        text = machine.text(path)
        if text is None:
            yield f"there is no file {path}"
            return
        for part in (f"<title>{self.drawn.title} - Openfolio</title>", "</html>"):
            if part not in text:
                yield f"{path} has no {part}"

    def oracle(self, hand):
        visit(hand, self.drawn.url, f"{self.drawn.title} - Openfolio")
        hand.find("heading", self.drawn.title)
        hand.press("ctrl", "s")
        hand.choose_file(self.drawn.path, "Save", APPS["chrome"].helper)

    def plan(self):
        return [
            'window "Chromium"',
            *told.visit(self.drawn.url, self.drawn.title),
            "press ctrl+s",
            *told.name_file(self.drawn.path),
            "wait",
        ]

    def wrong(self):
        path = self.drawn.path
        return {
            "in another folder": lambda m: m.write(f"Music/{self.drawn.file}", self.html()),
            "the text alone": lambda m: m.write(path, self.drawn.words),
            "another page": lambda m: m.write(path, self.html("Openfolio, the encyclopedia")),
            "half of it": lambda m: m.write(path, self.html().removesuffix("</html>\n")),
        }

    def right(self, machine):
        machine.write(self.drawn.path, self.html())
        machine.write(f"{self.drawn.path.removesuffix('.html')}_files/base.css", "body {}")

    def html(self, title=""):
        """Return a page with the title of the article, or with another one."""
        title = title or f"{self.drawn.title} - Openfolio"
        return f"<html><head><title>{title}</title></head><body>{self.drawn.words}</body></html>\n"
