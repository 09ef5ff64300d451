"""Seeded web pages: bars, menus, forms, tables and cards in many looks, with labels of one list.

The list is short (`ACTIONS`, `PLACES`, `FIELDS`) so that a small network can learn to read it in
minutes; where a label stands, what it looks like and what surrounds it is drawn for each page.
"""

import html
import random
from collections.abc import Callable
from dataclasses import dataclass

ACTIONS = (
    "Save",
    "Cancel",
    "Delete",
    "Edit",
    "Open",
    "Print",
    "Share",
    "Copy",
    "Undo",
    "Upload",
    "Search",
    "Send",
    "Reply",
    "Archive",
    "Add item",
    "Next page",
    "Previous",
    "Continue",
    "Sign in",
    "Buy now",
    "Checkout",
    "Export",
    "Apply",
    "Subscribe",
)
PLACES = (
    "Home",
    "Products",
    "About us",
    "Contact",
    "Help",
    "Settings",
    "Profile",
    "Orders",
    "Messages",
    "Calendar",
    "News",
    "Gallery",
    "Reports",
    "Billing",
    "Security",
    "History",
    "Drafts",
    "Dashboard",
)
FIELDS = (
    "Full name",
    "Email",
    "Password",
    "Phone",
    "Address",
    "City",
    "Company",
    "Date",
    "Card number",
    "Quantity",
)
PROSE = (
    "the harbour opens again in spring and visitors may come by boat or on foot most stalls sell"
    " bread tea and small repairs while the old tram waits by the square for those who would rather"
    " ride than walk up the hill to see what the town has kept of its walls towers and gardens"
)
FONTS = ("Noto Sans", "DejaVu Sans", "Liberation Sans")


@dataclass
class Page:
    """State while a page is written: its random numbers and the unused labels."""

    rng: random.Random
    actions: list[str]
    places: list[str]
    fields: list[str]

    def button(self) -> str:
        """A button, or a link that looks like one."""
        label = html.escape(self.actions.pop())
        tag = self.rng.choice(("button", "button", "a href=#"))
        kind = self.rng.choice(("first", "second", "second"))
        return f'<{tag} class="b {kind}">{label}</{tag.split()[0]}>'

    def link(self) -> str:
        """A link to a place."""
        return f"<a href=#>{html.escape(self.places.pop())}</a>"

    def field(self) -> str:
        """A text field, a list or a text area with its label."""
        name = self.fields.pop()
        inner = self.rng.choice(
            ("<input>", "<input>", "<input>", "<select><option></select>", "<textarea></textarea>")
        )
        return f"<label class=f><span>{html.escape(name)}</span>{inner}</label>"

    def text(self, low: int, high: int) -> str:
        """Some words that mean nothing here."""
        words = PROSE.split()
        at = self.rng.randrange(len(words))
        words = (words * 2)[at : at + self.rng.randint(low, high)]
        return " ".join(words).capitalize() + "."

    def many(self, make: Callable[[], str], low: int, high: int) -> str:
        """Several of one kind."""
        return "".join(make() for _ in range(self.rng.randint(low, high)))


def form(page: Page) -> str:
    """Fields above a row of buttons."""
    columns = page.rng.choice((1, 2, 2))
    fields = page.many(page.field, 2 * columns, 3 * columns)
    return (
        f'<form class="box grid c{columns}">{fields}</form><p'
        f" class=row>{page.many(page.button, 2, 4)}</p>"
    )


def listing(page: Page) -> str:
    """A table with a button in each row."""
    rows = page.many(
        lambda: f"<tr><td>{page.text(2, 5)}<td>{page.rng.randint(1, 999)}<td>{page.button()}", 3, 4
    )
    return f"<table class=box>{rows}</table>"


def cards(page: Page) -> str:
    """Boxes with a picture of one colour, some text and a button."""
    columns = page.rng.choice((2, 3))

    def card() -> str:
        hue = page.rng.randrange(360)
        shot = f'<i class=shot style="background:hsl({hue} 45% {page.rng.randint(40, 75)}%)"></i>'
        return f"<section class=box>{shot}<p>{page.text(2, 6)}</p>{page.button()}</section>"

    return f'<div class="grid c{columns}">{page.many(card, columns, 2 * columns)}</div>'


def article(page: Page) -> str:
    """Text with links in it."""
    parts = page.many(lambda: f"{page.text(4, 12)} {page.link()} ", 3, 6)
    return (
        f"<h2>{page.text(2, 4)}</h2><p class=box>{parts}</p><p"
        f" class=row>{page.many(page.button, 1, 3)}</p>"
    )


def tools(page: Page) -> str:
    """A tool bar above an empty sheet."""
    sheet = f"<div class=box style='height:120px'>{page.text(6, 20)}</div>"
    return f"<p class=row>{page.many(page.button, 4, 7)}</p>{sheet}"


def style(rng: random.Random) -> str:
    """The look of a page: colours, font, sizes, corners, spacing."""
    hue = rng.randrange(360)
    dark = rng.random() < 0.2
    paper, ink = (
        (f"hsl({hue} 15% 14%)", "#eee")
        if dark
        else (f"hsl({hue} 40% {rng.randint(95, 100)}%)", "#1c2026")
    )
    box = f"hsl({hue} 15% 20%)" if dark else "#fff"
    accent = f"hsl({rng.randrange(360)} {rng.randint(45, 85)}% {rng.randint(28, 42)}%)"
    size = rng.randint(15, 17)
    pad = rng.randint(4, 9)
    radius = rng.choice((0, 3, 6, 14))
    weight = rng.choice((400, 400, 600, 700))
    border = rng.choice(("#8886", "#8883", accent))
    label, end, filled = (
        rng.choice(("column", "column", "row")),
        rng.choice(("start", "end")),
        rng.random() < 0.6,
    )
    bar, bar_ink = (accent, "#fff") if filled else (box, ink)
    return f"""* {{ box-sizing: border-box; margin: 0; }}
body {{ font: {size}px/1.35 "{rng.choice(FONTS)}"; background: {paper}; color: {ink}; }}
body {{ height: 100vh; overflow: hidden; }}
header {{ display: flex; gap: {2 * pad}px; padding: {pad + 2}px 14px; align-items: center; }}
header {{ background: {bar}; border-bottom: 1px solid {border}; color: {bar_ink}; }}
a {{ color: {"#9cf" if dark else accent}; font-weight: {weight}; }} header a {{ color: inherit; }}
.b {{ display: inline-block; font: inherit; font-weight: {weight}; padding: {pad - 1}px {pad + 6}px; }}
.b {{ border: 1px solid {border}; border-radius: {radius}px; text-decoration: none; }}
.first {{ background: {accent}; color: #fff; }} .second {{ background: {box}; color: {ink}; }}
.box {{ background: {box}; border: 1px solid {border}; border-radius: {radius}px; padding: {pad + 4}px; }}
.row {{ display: flex; flex-wrap: wrap; gap: {pad}px; margin: {pad}px 0; justify-content: {end}; }}
.grid {{ display: grid; gap: {pad + 2}px; }} .c2 {{ grid-template-columns: 1fr 1fr; }}
.c3 {{ grid-template-columns: 1fr 1fr 1fr; }}
.f {{ display: flex; flex-direction: {label}; gap: 3px 8px; }} .f span {{ min-width: {7 * size}px; }}
input, select, textarea {{ font: inherit; flex: 1; min-width: 60px; height: {size + 2 * pad}px; resize: none;
  border: 1px solid {border}; border-radius: {radius}px; background: {box}; width: 100%; }}
table {{ width: 100%; border-collapse: collapse; }} td {{ padding: 3px 6px; border-bottom: 1px solid {border}; }}
.shot {{ display: block; height: {rng.randint(30, 60)}px; }} h2 {{ font-size: 1.2em; margin: 4px 0; }}
.split {{ display: flex; gap: 12px; padding: 10px 14px; }} .split > main {{ flex: 1; min-width: 0; }}
aside {{ display: flex; flex-direction: column; gap: {pad}px; min-width: 110px; order: {rng.choice((0, 0, 2))}; }}"""


def write(seed: int) -> str:
    """Return the page of a seed as HTML."""
    rng = random.Random(f"page-{seed}")
    page = Page(rng, *(rng.sample(names, len(names)) for names in (ACTIONS, PLACES, FIELDS)))
    look = style(rng)
    head = (
        f"<header><b>{page.text(1, 1)[:-1]}</b>{page.many(page.link, 3, 5)}</header>"
        if rng.random() < 0.8
        else ""
    )
    side = f"<aside>{page.many(page.link, 4, 6)}</aside>" if rng.random() < 0.6 else ""
    parts = rng.sample((form, listing, cards, article, tools), 2)
    body = "".join(part(page) for part in parts)
    text = f"<!doctype html><html lang=en><meta charset=utf-8><style>{look}</style>{head}"
    return f"{text}<div class=split>{side}<main>{body}</main></div></html>"
