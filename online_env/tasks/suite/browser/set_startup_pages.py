"""Have the browser open other pages when it starts."""

import re

from online_env.tasks import Task
from online_env.tasks.kit import chromium
from online_env.tasks.kit.pages import enter, follow, pick, tick, visit
from online_env.tasks.kit.word_lists import sample

PLACE = "On startup"
OLD = re.compile("More actions for (search.test|Lumen)")  # its title, once it was open
HOSTS = ("wiki.test", "news.test", "mail.test", "docs.test", "shop.test", "forms.test")


class SetStartupPages(Task):
    """The page that is set goes, one or two others come."""

    name = "set_startup_pages"
    domain = "browser"
    apps = ("chrome",)
    phrasings = (
        "When Chromium starts, it opens search.test. Change the settings so that it opens {pages}"
        " instead, and nothing else.",
        "Please set up the browser to start with {pages}; search.test should no longer be opened.",
        "Chromium's start-up page should be {pages}, not search.test any more.",
    )

    def draw(self, stream):
        hosts = sample(stream, HOSTS, stream.integer(1, 2))
        urls = [f"http://{host}/" for host in hosts]
        return {"hosts": hosts, "urls": urls, "pages": " and ".join(urls)}

    def prepare(self, machine):
        chromium.change_setting(machine, "session.restore_on_startup", chromium.GIVEN_PAGES)
        chromium.change_setting(machine, "session.startup_urls", ["http://search.test/"])

    def problems(self, machine):
        yield from machine.unexpected_changes()
        pages = chromium.setting(machine, "session.startup_urls") or []
        kind = chromium.setting(machine, "session.restore_on_startup")
        if sorted(pages) != sorted(self.values.urls) or kind != chromium.GIVEN_PAGES:
            yield f"at the start the browser opens {pages} (kind {kind})"

    def oracle(self, hand):
        visit(hand, "chrome://settings/onStartup", f"Settings - {PLACE}")
        tick(hand, "radio-button", "Open a specific page or set of pages")
        for host, url in zip(self.values.hosts, self.values.urls, strict=True):
            if hand.see("push-button", f"More actions for {host}"):
                continue
            follow(hand, "Add a new page")
            enter(hand, "Site URL", url)
            hand.button("Add")
            hand.find("push-button", f"More actions for {host}")
        if hand.see("push-button", OLD):
            pick(hand, OLD, 1)
            hand.find("push-button", f"More actions for {self.values.hosts[0]}")
            hand.wait_until_gone("push-button", OLD)

    def wrong_results(self):
        def write_settings(kind, *urls):
            def change(machine):
                chromium.change_setting(machine, "session.restore_on_startup", kind)
                chromium.change_setting(machine, "session.startup_urls", list(urls))

            return change

        pages, startup_mode = self.values.urls, chromium.GIVEN_PAGES
        return {
            "added to the old one": write_settings(startup_mode, "http://search.test/", *pages),
            "another page": write_settings(startup_mode, "http://example.test/"),
            "a new tab": write_settings(5, *pages),
            "as the home page": lambda m: chromium.change_setting(m, "homepage", pages[0]),
        }

    def right_result(self, machine):
        chromium.change_setting(machine, "session.startup_urls", self.values.urls[::-1])
