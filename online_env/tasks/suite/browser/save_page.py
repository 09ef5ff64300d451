"""Save a web page as a file."""

import re

from online_env.embedded.sites.library import articles
from online_env.tasks import Task
from online_env.tasks.kit import plan_steps
from online_env.tasks.kit.articles import address
from online_env.tasks.kit.pages import visit
from online_env.tasks.kit.served_pages import seen_text, served_page
from online_env.tasks.kit.word_lists import TOPICS
from online_env.tasks.task_apps import APPS

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
            "place": f"/wiki/{article.slug}",
            "url": address(article.title),
            "file": file,
            "folder": folder,
            "path": f"{folder}/{file}",
        }

    def problems(self, machine):
        path = self.values.path
        yield from machine.unexpected_changes(path, f"{path.removesuffix('.html')}_files*")
        text = machine.text(path)
        if text is None:
            yield f"there is no file {path}"
            return
        served = self.page_source(machine)
        for element in ("title", "article"):
            if seen_text(text, element) != seen_text(served, element):
                yield f"the {element} in {path} is not that of {self.values.url}"
        if not text.rstrip().endswith("</html>"):
            yield f"{path} ends before the page does"

    def oracle(self, hand):
        visit(hand, self.values.url, f"{self.values.title} - Openfolio")
        hand.find("heading", self.values.title)
        hand.press("ctrl", "s")
        hand.choose_file(self.values.path, "Save", APPS["chrome"].helper)

    def plan(self):
        return [
            'window "Chromium"',
            *plan_steps.visit(self.values.url, self.values.title),
            "press ctrl+s",
            *plan_steps.name_file(self.values.path),
            "wait",
        ]

    def wrong_results(self):
        path, title = self.values.path, f"<title>{self.values.title} - Openfolio</title>"
        other_slug = next(slug for slug in articles("wiki") if slug not in self.values.place)

        def save_changed(change):
            return lambda m: m.write(path, change(self.page_source(m)))

        return {
            "in another folder": lambda m: m.write(
                f"Music/{self.values.file}", self.page_source(m)
            ),
            "the text alone": save_changed(lambda page: seen_text(page, "article")),
            "another page": lambda m: m.write(path, self.page_source(m, f"/wiki/{other_slug}")),
            "the form to edit it": lambda m: m.write(
                path, self.page_source(m, self.values.place.replace("wiki", "edit", 1))
            ),
            "cut off at the end": save_changed(lambda page: page.rstrip().removesuffix("</html>")),
            "half of it": save_changed(lambda page: f"{page[: len(page) // 2]}</html>"),
            "its title alone": save_changed(lambda page: f"{title}</html>\n"),
        }

    def right_result(self, machine):
        page = re.sub(r"\s+", "\n", self.page_source(machine)).replace('src="/', 'src="./x_files/')
        machine.write(self.values.path, f"<!-- saved from {self.values.url} -->\n{page}\n")
        machine.write(f"{self.values.path.removesuffix('.html')}_files/base.css", "body {}")

    def page_source(self, machine, path=""):
        """Return a page of the wiki, by default the article's, as the site sends it."""
        return served_page(machine, "wiki.test", path or self.values.place).decode()
