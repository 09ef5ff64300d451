"""Steps of plans in words that several tasks share."""

from collections.abc import Mapping, Sequence
from types import SimpleNamespace
from typing import Any

from ..plan_words import quoted
from . import registrations, shop

SEND = ('click "Send"', "wait")  # the message that is open
CALC = 'window "LibreOffice Calc"'
WRITER = 'window "LibreOffice Writer"'
IMPRESS = 'window "LibreOffice Impress"'
SAVE_XLSX = ("press ctrl+s", 'click "Use Excel 2007-365"', "wait")
SAVE_DOCX = ("press ctrl+s", 'click "Use Word 2007-365"', "wait")
SAVE_PPTX = ("press ctrl+s", 'click "Use PowerPoint 2007-365"', "wait")


def visit(address: str, heading: str) -> list[str]:
    """Steps to open a page in the browser on the screen, and to wait for a text on it."""
    return [
        "press ctrl+l",
        f"type {quoted(address)}",
        "press delete",  # what the browser completed
        "press enter",
        f"wait for {quoted(heading)}",
    ]


def run(*commands: str) -> list[str]:
    """Steps to run commands in the visible terminal."""
    steps = ['window "Terminal"', 'wait for "user@desktop"']
    for command in commands:
        steps += [f"type {quoted(command)}", "press enter", "wait"]
    return steps


def go(folder: str) -> list[str]:
    """Steps to show a folder, given relative to the home folder, in the file manager."""
    return ["press ctrl+l", f"type {quoted(f'/home/user/{folder}')}", "press enter", "wait"]


def make_folder(name: str) -> list[str]:
    """Steps to make a folder in the one that the file manager shows."""
    return [
        "press ctrl+shift+n",
        'wait for "Create New Folder"',
        "press ctrl+a",
        f"type {quoted(name)}",
        "press enter",
        f"wait for {quoted(name)}",
    ]


def rename(old: str, new: str) -> list[str]:
    """Steps to give a file that the file manager shows another name."""
    return [
        f"click {quoted(old)}",
        "press f2",
        "wait",
        "press ctrl+a",
        f"type {quoted(new)}",
        "press enter",
        f"wait for {quoted(new)}",
    ]


def choose(names: Sequence[str]) -> list[str]:
    """Steps to select files that the file manager shows."""
    first, *other_names = names
    return [f"click {quoted(first)}", *(f"ctrl-click {quoted(name)}" for name in other_names)]


def move(names: Sequence[str], folder: str) -> list[str]:
    """Steps to move files to another folder, given relative to the home folder."""
    return [
        *choose(names),
        "press ctrl+x",
        *go(folder),
        "press ctrl+v",
        f"wait for {quoted(names[-1])}",
    ]


def name_file(path: str) -> list[str]:
    """Steps to name a file, relative to the home folder, in the dialog that opens."""
    return [
        'wait for "Cancel"',
        "press ctrl+a",
        f"type {quoted(f'/home/user/{path}')}",
        "press enter",
    ]


def open_in_editor(path: str) -> list[str]:
    """Steps to open a file, given relative to the home folder, in the editor."""
    return [
        "press ctrl+o",
        'wait for "Cancel"',
        f"type {quoted(f'/home/user/{path}')}",
        "press enter",
        "wait",
    ]


def save_as(path: str) -> list[str]:
    """Steps to save what has no file yet; the path is relative to the home folder."""
    return ["press ctrl+s", *name_file(path), f"wait for {quoted(path.rpartition('/')[2])}"]


def take_note(path: str, text: str) -> list[str]:
    """Steps to write a text file with the editor; the path is relative to the home folder."""
    return [
        "press alt+f2",
        "wait",
        f"type {quoted('mousepad')}",
        "press enter",
        'window "Mousepad"',
        f"type {quoted(text)}",
        *save_as(path),
    ]


def go_to_cell(address: str) -> list[str]:
    """Steps to select a cell, or a range of them, in the sheet on the screen."""
    return ["press ctrl+shift+t", f"type {quoted(address)}", "press enter"]


def enter_in_cell(address: str, content: str) -> list[str]:
    """Steps to write into a cell of the sheet on the screen."""
    return [*go_to_cell(address), f"type {quoted(content)}", "press enter"]


def find_in_writer(text: str) -> list[str]:
    """Steps to select a text of the document on the screen."""
    return [
        "press ctrl+f",
        "wait",
        "press ctrl+a",
        f"type {quoted(text)}",
        "press enter",
        "press esc",
    ]


def replace_in_office(old: str, new: str) -> list[str]:
    """Steps to replace a text everywhere in the document on the screen."""
    return [
        "press ctrl+h",
        'wait for "Replace All"',
        "press ctrl+a",
        f"type {quoted(old)}",
        'click right of "Replace:"',
        "press ctrl+a",
        f"type {quoted(new)}",
        'click "Replace All"',
        "wait",
        'click "Close"',
        "wait",
        "wait",
    ]


def open_in_office(path: str, visible_text: str) -> list[str]:
    """Steps to open another document, relative to the home folder, and to wait for a text on it."""
    return [
        "press ctrl+o",
        *name_file(path),
        f"wait for {quoted(visible_text)}",
        "wait",  # keys that come at once go to the document before
    ]


def command_of_gimp(words: str) -> list[str]:
    """Steps to find and run a command of GIMP."""
    return [
        'window "GIMP"',
        "press /",
        "wait",
        f"type {quoted(words)}",
        "wait",
        "press enter",
        "wait",
    ]


def export_from_gimp(name: str) -> list[str]:
    """Steps to export the picture in GIMP as PNG, beside its file."""
    return [
        "press ctrl+shift+e",
        'wait for "Export Image"',
        "press ctrl+a",
        f"type {quoted(name)}",
        "press enter",
        'wait for "Export Image as PNG"',
        "press enter",
        "wait",
    ]


def search_mail(words: str) -> list[str]:
    """Steps to look for mails, in the mailbox that the browser shows."""
    return [
        'click "Search mail"',
        f"type {quoted(words)}",
        "press enter",
        f"wait for {quoted(f'Search: {words}')}",
    ]


def compose(*, to: str = "", cc: str = "", subject: str = "", text: str = "") -> list[str]:
    """Steps to fill the fields of the message that opens; without text they stay as they are."""
    steps = ['wait for "New message"', 'click "To"']
    for content in (to, cc, subject):
        if content:
            steps += ["press ctrl+a", f"type {quoted(content)}"]
        steps.append("press tab")
    return [*steps, "press ctrl+home", f"type {quoted(text)}"]


def put_into_cart(product: SimpleNamespace, count: int) -> list[str]:
    """Steps to put a product of the shop into the cart."""
    quantity = ['click "Quantity"', f"type {quoted(str(count))}"]
    return [
        *visit(f"http://shop.test/product/{product.id}", "Quantity"),
        *(quantity if count > 1 else ()),
        'scroll down to "Add to cart"',
        'click "Add to cart"',
        'wait for "Your cart"',
    ]


def check_out(
    person: Mapping[str, str],
    *,
    delivery: str = "standard",
    payment: str = "invoice",
    message: str = "",
) -> list[str]:
    """Steps to order what is in the cart on the screen; a message comes with a wrapped present."""
    gift = [
        'scroll down to "Wrap it as a present"',
        'click "Wrap it as a present"',
        'click "Message on the card"',
        f"type {quoted(message)}",
    ]
    steps = ['scroll down to "Go to checkout"', 'click "Go to checkout"', 'click "Full name"']
    for key in shop.ADDRESS:
        steps += [f"type {quoted(person[key])}", "press tab"]
    return [
        *steps,
        f"scroll down to {quoted(shop.delivery_label(delivery))}",
        f"click {quoted(shop.delivery_label(delivery))}",
        f"scroll down to {quoted(shop.payment_label(payment))}",
        f"click {quoted(shop.payment_label(payment))}",
        *(gift if message else ()),
        'scroll down to "Place order"',
        'click "Place order"',
        'wait for "Thank you"',
    ]


def find_registration(number: int, email: str) -> list[str]:
    """Steps to find a registration for a course."""
    return [
        *visit(f"{registrations.SITE}/find", "Registration number"),
        'click "Registration number"',
        f"type {quoted(str(number))}",
        "press tab",
        f"type {quoted(email)}",
        'click "Find it"',
        'wait for "You are registered"',
    ]


def register(entry: Mapping[str, Any]) -> list[str]:
    """Steps to fill in the registration form, which is open and empty, and to send it."""
    year, month, day = entry["birth_date"].split("-")
    boxes = [registrations.content()["interests"][key] for key in entry["interests"]]
    notes = entry["notes"]
    return [
        'click "Full name"',
        f"type {quoted(entry['name'])}",
        "press tab",
        f"type {quoted(entry['email'])}",
        "press tab",
        f"type {quoted(month + day + year)}",
        'click "Country"',
        f"type {quoted(entry['country'])}",
        'click "Course"',
        f"type {quoted(registrations.course(entry['course']))}",
        f"click {quoted(registrations.level(entry['level']))}",
        *(f"click {quoted(box)}" for box in boxes),
        *(['click "Notes for the teacher"', f"type {quoted(notes)}"] if notes else ()),
        'scroll down to "Send registration"',
        'click "I accept the house rules"',
        'click "Send registration"',
        'wait for "You are registered"',
    ]
