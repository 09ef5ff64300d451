"""Make another search engine the default."""

from online_env.tasks import Task
from online_env.tasks.kit import chromium
from online_env.tasks.kit.pages import pick, visit

DATA = "default_search_provider_data.template_url_data"
KEY = f"{DATA}.short_name"
BUILT_IN = f"{DATA}.prepopulate_id"  # 0 if somebody made the engine, whatever its name
ENGINES = ("DuckDuckGo", "Google", "Microsoft Bing", "Ecosia", "Qwant", "Startpage")


class ChooseSearchEngine(Task):
    """The engine that the address bar uses, and whether there is a home button."""

    name = "choose_search_engine"
    domain = "browser"
    apps = ("chrome",)
    phrasings = (
        "Make {engine} the default search engine of Chromium, and {what} the home button.",
        "I want to search with {engine} when I type into the address bar. Please change that in"
        " the browser's settings; and while you are there, {what} the home button.",
        "Chromium: default search engine {engine}; {what} the home button beside the address bar.",
    )

    def draw(self, stream):
        home_button = bool(stream.integer(0, 1))
        engine = stream.choice(ENGINES)
        return {"engine": engine, "shown": home_button, "what": "show" if home_button else "hide"}

    def prepare(self, machine):
        chromium.change_setting(machine, "browser.show_home_button", not self.values.shown)

    def problems(self, machine):
        yield from machine.unexpected_changes()
        expected = {KEY: self.values.engine, "browser.show_home_button": self.values.shown}
        yield from chromium.wrong_settings(machine, expected)
        if not chromium.setting(machine, BUILT_IN):
            yield "the default search engine is not one of Chromium's own"

    def oracle(self, hand):
        engine = self.values.engine
        visit(hand, "chrome://settings/searchEngines", "Settings - Manage search")
        if not hand.see("push-button", f"More actions for {engine} (Default)"):
            pick(hand, f"More actions for {engine}", 0)
        hand.find("push-button", f"More actions for {engine} (Default)")
        visit(hand, "chrome://settings/appearance", "Settings - Appearance")
        button = hand.find("toggle-button", "Show home button")
        if ("checked" in button.states) != self.values.shown:
            hand.click(button)

    def wrong_results(self):
        def write_settings(engine, home_button, number=1):
            def change(machine):
                chromium.change_setting(machine, BUILT_IN, number)
                chromium.change_setting(machine, KEY, engine)
                chromium.change_setting(machine, "browser.show_home_button", home_button)

            return change

        engine, home_button = self.values.engine, self.values.shown
        return {
            "only the engine": write_settings(engine, not home_button),
            "only the button": write_settings("Lumen", home_button),
            "another engine": write_settings("Mojeek", home_button),
            "another engine under that name": write_settings(engine, home_button, 0),
        }

    def right_result(self, machine):
        chromium.change_setting(machine, "browser.show_home_button", self.values.shown)
        chromium.change_setting(machine, KEY, self.values.engine)
        chromium.change_setting(machine, BUILT_IN, 7)
