"""An agent that drives the corrupted Chromium by Playwright: it presses the button of its task.

    pip install playwright        # no download of a browser is needed
    hijack bench miniwob_small --agent examples/playwright_agent.py:PlaywrightAgent \\
        --tasks miniwob/click-button.html --corruptions clean,multi_apps --out runs/playwright
"""

import re

from playwright.sync_api import sync_playwright


class PlaywrightAgent:
    """Acts in the browser by itself; the runner only counts the steps."""

    uses_devtools = True

    def reset(self):
        self.close()

    def connect(self, address):
        self.playwright = sync_playwright().start()
        self.browser = self.playwright.chromium.connect_over_cdp(address)

    def predict(self, instruction, obs):
        # Chromium has an empty page of its own; of the others, the last one is in front.
        page = [page for page in self.browser.contexts[0].pages if page.url != "about:blank"][-1]
        for name in [*re.findall(r'"([^"]+)"', instruction), "Close"]:
            button = page.get_by_role("button", name=name, exact=True)
            if button.count():
                button.first.click()
                return f"I press {name}.", ["DONE"] if name != "Close" else []
        return "There is no such button.", ["FAIL"]

    def close(self):
        if getattr(self, "playwright", None) is not None:
            self.browser.close()
            self.playwright.stop()
            self.playwright = None
