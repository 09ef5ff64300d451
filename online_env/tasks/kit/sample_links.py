"""Pages of the local sites, as bookmarks and histories have them."""

from collections.abc import Sequence

from hijack_data.rng import Stream

from .chromium import Bookmark
from .word_lists import sample

HOSTS = ("wiki.test", "news.test", "docs.test", "shop.test")
FOLDERS = ("Recipes", "Travel", "Work", "Garden", "Hobbies", "School")
PER_FOLDER = 4
PAGES = (
    ("Tea", "http://wiki.test/wiki/Tea"),
    ("Sourdough", "http://wiki.test/wiki/Sourdough"),
    ("Tides explained", "http://wiki.test/wiki/Tide"),
    ("Honey bees", "http://wiki.test/wiki/Honey_bee"),
    ("Chess in short", "http://wiki.test/wiki/Chess"),
    ("The new bridge", "http://news.test/article/harbour-bridge-opens"),
    ("Aurora over town", "http://news.test/article/aurora-seen"),
    ("Market hall", "http://news.test/article/market-hall"),
    ("Planets", "http://news.test/article/observatory-night"),
    ("Quick start", "http://docs.test/quick-start"),
    ("Exit codes", "http://docs.test/exit-codes"),
    ("All commands", "http://docs.test/commands"),
    ("Schedules", "http://docs.test/schedules"),
    ("A mug", "http://shop.test/product/mug"),
    ("A desk lamp", "http://shop.test/product/lamp"),
    ("The whole shop", "http://shop.test/category/all"),
)
"""Names and addresses."""


def bar(stream: Stream) -> list[tuple[str, list[tuple[str, str]]]]:
    """Return a bookmarks bar: three folders, each with pages, at least one of every site."""
    folders = sample(stream, FOLDERS, 3)
    one_each = [stream.choice([p for p in PAGES if f"//{host}/" in p[1]]) for host in HOSTS]
    others = [page for page in PAGES if page not in one_each]
    chosen = [*one_each, *sample(stream, others, 3 * PER_FOLDER - len(one_each))]
    mixed = sample(stream, chosen, len(chosen))
    return [(name, mixed[n * PER_FOLDER : (n + 1) * PER_FOLDER]) for n, name in enumerate(folders)]


def without(entries: Sequence[tuple[str, list[tuple[str, str]]]], host: str) -> list[Bookmark]:
    """Return folders without the pages of a site."""
    return [(name, [p for p in pages if f"//{host}/" not in p[1]]) for name, pages in entries]
