"""The headings of docs/troubleshooting.md that explain an error, by a part of its message."""

import re

PAGE = "docs/troubleshooting.md"
EXPLAINED = (
    "pip install",
    "is imported instead of AgentHijack's own package",
    "and nothing says whether these entries of the sample must follow",
    "nothing says whether these entries of the sample are pictures",
    "does not fit",
    "say which: --format",
    "say which with --boxes and --coordinates",
    "the recording does not say which desktop it shows",
    "the recording does not say which applications it uses",
    "was begun with other parameters",
    "neither nft nor iptables works as root",
    "the golden home is not made yet",
    "start the container with: docker run --privileged",
    "use a desktop of your own over HTTP",
    "holds a run already",
)


def page_for(message: str) -> str:
    """Return the page and heading that explain a message, or `""`."""
    for part in EXPLAINED:
        if part in message:
            return f"{PAGE}#{anchor(part)}"
    return ""


def anchor(heading: str) -> str:
    """Return a heading as the anchor that GitHub and the site give it."""
    return re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-")
