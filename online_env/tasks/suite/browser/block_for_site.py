"""Forbid a site something, for one site and one kind of content."""

import re

from online_env.tasks import Task
from online_env.tasks.kit import chromium, plan_steps
from online_env.tasks.kit.pages import enter, visit
from online_env.tasks.kit.word_lists import sample
from online_env.tasks.plan_words import quoted

# What is blocked, the page of the settings, the beginning of its title, and the stored name.
KINDS = (
    ("images", "images", "Images"),
    ("JavaScript", "javascript", "JavaScript"),
    ("sound", "sound", "Sound"),
)
HOSTS = ("news.test", "shop.test", "wiki.test", "docs.test", "forms.test", "mail.test")


class BlockForSite(Task):
    """One site is not allowed one thing; the general rule and other sites stay."""

    name = "block_for_site"
    domain = "browser"
    apps = ("chrome",)
    phrasings = (
        "In Chromium's site settings, do not allow {host} to use {what}. It is allowed for all"
        " other sites.",
        "Please block {what} on {host}, and only there, in the settings of the browser.",
        "Chromium: {what} not allowed for {host}; leave it as it is for other sites.",
    )

    def draw(self, stream):
        what, kind, title = stream.choice(KINDS)
        host, other = sample(stream, HOSTS, 2)
        return {"what": what, "kind": kind, "title": title, "host": host, "other": other}

    def problems(self, machine):
        yield from machine.unexpected_changes()
        host = re.escape(self.values.host)
        pattern = re.compile(rf"(http://)?(\[\*\.\])?{host}(:80)?,\*")
        rules = chromium.exceptions(machine, self.values.kind)
        is_done = rules and all(
            pattern.fullmatch(site) and rule == chromium.BLOCKED for site, rule in rules.items()
        )
        if not is_done:
            yield f"for {self.values.kind} the rules are {rules}"
        for kind in sorted(chromium.blocked_kinds(machine) - {self.values.kind}):
            yield f"{kind} is blocked, too"
        general = f"profile.default_content_setting_values.{self.values.kind}"
        if chromium.setting(machine, general) == chromium.BLOCKED:
            yield f"{self.values.kind} is blocked for all sites"

    def oracle(self, hand):
        drawn = self.values
        page = f"chrome://settings/content/{drawn.kind}"
        visit(hand, page, f"Settings - {drawn.title}")
        hand.find("push-button", "Add site to not-allowed list", scroll=True)
        if hand.see("static", re.compile(rf"(http://)?{re.escape(drawn.host)}")):
            return
        hand.button("Add site to not-allowed list")
        enter(hand, "Site", drawn.host)
        hand.button("Add")
        hand.find("static", re.compile(rf"(http://)?{re.escape(drawn.host)}"))

    def plan(self):
        return [
            'window "Chromium"',
            *plan_steps.visit(f"chrome://settings/content/{self.values.kind}", self.values.title),
            'scroll down to "Not allowed to"',
            'click "Add" near "Not allowed to"',
            'wait for "Add a site"',
            'click "example.com"',
            f"type {quoted(self.values.host)}",
            'click "Add" near "Cancel"',
            "wait",
        ]

    def wrong_results(self):
        kind, host, other = self.values.kind, self.values.host, self.values.other
        general = f"profile.default_content_setting_values.{kind}"
        exception = f"profile.content_settings.exceptions.{kind}"
        neighbour = next(name for _, name, _ in KINDS if name != kind)
        return {
            "another site": lambda m: chromium.block(m, kind, other),
            "not this scheme": lambda m: chromium.block(m, kind, f"https://{host}:443"),
            "something else as well": lambda m: [
                chromium.block(m, kind, host),
                chromium.block(m, neighbour, host),
            ],
            "cookies as well": lambda m: [
                chromium.block(m, kind, host),
                chromium.block(m, "cookies", host),
            ],
            "one site more": lambda m: chromium.block(m, kind, host, other),
            "all sites": lambda m: chromium.change_setting(m, general, chromium.BLOCKED),
            "allowed": lambda m: chromium.change_setting(
                m, exception, {f"{host},*": {"setting": 1}}
            ),
        }

    def right_result(self, machine):
        host = self.values.host
        chromium.block(machine, self.values.kind, f"http://{host}:80", f"[*.]{host}")
