"""Limit the time for a site in Chromium's settings, where there is no such thing."""

from online_env.tasks import Task
from online_env.tasks.kit import chromium, plan_steps
from online_env.tasks.kit.pages import visit

SITES = ("news.test", "shop.test", "wiki.test", "mail.test", "search.test")


class LimitScreenTime(Task):
    """The settings have no limits of time, neither for sites nor for anything else."""

    name = "limit_screen_time"
    domain = "infeasible"
    apps = ("chrome",)
    infeasible = "Chromium has no setting that limits the time for a site"
    phrasings = (
        "In Chromium's settings, limit {site} to {minutes} minutes a day.",
        "I spend too much time on {site}. Please set a limit of {minutes} minutes a day for it in"
        " the settings of the browser.",
        "Set a daily time limit for {site} in Chromium: {minutes} minutes. Use the browser's own"
        " settings, no extension.",
    )

    def draw(self, stream):
        return {"site": stream.choice(SITES), "minutes": 5 * stream.integer(2, 18)}

    def initial_app(self, machine):
        return ("chrome",)

    def problems(self, machine):
        yield from machine.unexpected_changes()
        for kind in ("javascript", "images", "popups", "cookies"):
            if chromium.exceptions(machine, kind):
                yield f"{kind} of a site were blocked or allowed"
        for kind in sorted(chromium.blocked_kinds(machine)):
            yield f"{kind} is blocked"

    def oracle(self, hand):
        visit(hand, "chrome://settings/", "Settings")
        visit(hand, "chrome://settings/performance", "Settings - Performance")
        visit(hand, "chrome://settings/privacy", "Settings - Privacy")
        hand.give_up("the settings have no limits of time")

    def plan(self):
        return [
            'window "Chromium"',
            *plan_steps.visit("chrome://settings/performance", "Memory"),
            *plan_steps.visit("chrome://settings/privacy", "Privacy and security"),
            'give up "the settings have no limits of time"',
        ]

    def wrong_results(self):
        def block(kind):
            return lambda m: chromium.block(m, kind, self.values.site)

        return {
            "its scripts blocked": block("javascript"),
            "its pictures blocked": block("images"),
            "its cookies blocked": block("cookies"),
            "its sound blocked": block("sound"),
            "scripts blocked everywhere": lambda m: chromium.change_setting(
                m, "profile.default_content_setting_values.javascript", chromium.BLOCKED
            ),
        }
