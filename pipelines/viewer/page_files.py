"""The page's own files; style and divider are those of the gallery."""

from functools import lru_cache
from pathlib import Path

from hijack_data.gallery.markup import source

PAGE = Path(__file__).parent / "page"


@lru_cache(maxsize=16)
def page_file(name: str) -> str:
    """Return the text of a file of the page."""
    if name == "gallery.js":
        return source("page.js")
    own = (PAGE / name).read_text(encoding="utf-8")
    if name == "view.css":
        return source("page.css") + own + page_file("run.css")
    return own
