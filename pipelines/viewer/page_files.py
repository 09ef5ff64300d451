"""The files of the page; its base style and the divider come from the gallery."""

from functools import lru_cache
from pathlib import Path

from hijack_data.gallery.markup import Html, fill_text, source

PAGE = Path(__file__).parent / "page"
# The scripts of the page of a run, in the order in which they are loaded.
RUN_SCRIPTS = (
    "gallery.js",
    "common.js",
    "run_data.js",
    "run_table.js",
    "run_list.js",
    "run_strokes.js",
    "run_episode.js",
    "run.js",
)


@lru_cache(maxsize=16)
def page_file(name: str) -> str:
    """Return the text of a file of the page."""
    if name == "gallery.js":
        return source("page.js")
    text = (PAGE / name).read_text(encoding="utf-8")
    if name == "view.css":
        return source("page.css") + text + page_file("run.css")
    return text


def run_page(head: Html, data: Html) -> str:
    """Return the page of a run.

    Args:
        head: its style and scripts, as links or inline.
        data: JSON of exported episodes; `{}` for a page that asks a server.
    """
    view = Html(page_file("run_view.html"))
    return fill_text(page_file("run.html"), head=head, data=data, view=view)
