"""What an agent does in its last second is judged: a right state, and then a wrong change.

Applications write late: Chromium up to ten seconds after a change, the server of Xfce's settings
some seconds, an office program when it has saved. One task a kit is tried; with `LATE_CHANGES=all`
in the environment, all tasks on settings, bookmarks, history and documents are (about 15 minutes).
"""

import os
from collections.abc import Callable, Iterator
from typing import Any

import pytest

from support import needs

pytest.importorskip("lxml", reason=needs.ONLINE)
pytest.importorskip("starlette", reason=needs.ONLINE)
pytest.importorskip("jinja2", reason=needs.ONLINE)

from online_env import tasks
from online_env.embedded.sites import SiteState
from online_env.tasks import Hand, Machine, Task
from online_env.tasks.kit import browser, office, pages
from online_env.tasks.suite.browser.set_startup_pages import HOSTS

Change = Callable[[Task, Machine, Hand], object]


def bookmark_page(task: Task, machine: Machine, hand: Hand) -> None:
    pages.visit(hand, "http://search.test/", "Lumen")
    hand.press("ctrl", "d")
    hand.find("push-button", "Done", app=browser.APP)
    hand.press("enter")


def visit_again(task: Task, machine: Machine, hand: Hand) -> None:
    hand.press("ctrl", "l")
    hand.replace(f"http://{task.values.host}/\n")
    hand.wait("page", lambda node: node.role == "document-web" and "History" not in node.name)


def do_another_variant(task: Task, machine: Machine, hand: Hand) -> None:
    def choice(second: Task) -> Any:
        return {key: vars(second.values)[key] for key in ("host", "size", "shown") if key in keys}

    keys = vars(task.values)
    remaining = (task.variant(seed) for seed in range(1, 99))
    next(second for second in remaining if choice(second) != choice(task)).oracle(hand)


def add_start_page(task: Task, machine: Machine, hand: Hand) -> None:
    host = next(host for host in HOSTS if host not in task.values.hosts)
    pages.visit(hand, "chrome://settings/onStartup", "Settings - On startup")
    browser.follow(hand, "Add a new page")
    browser.enter(hand, "Site URL", f"http://{host}/")
    hand.button("Add")
    hand.find("push-button", f"More actions for {host}", app=browser.APP)


def set_property(channel: str, name: str, kind: str, value: str) -> Change:
    argv = ["xfconf-query", "-c", channel, "-p", f"/{name}", "-n", "-t", kind, "-s", value]
    return lambda task, machine, hand: machine.run(*argv)


def write_and_save(*keys: tuple[str, ...], text: str = "") -> Change:
    def change(task: Task, machine: Machine, hand: Hand) -> None:
        for combination in keys:
            hand.press(*combination)
        hand.type(text)
        hand.press("ctrl", "s")
        hand.button(office.OWN_FORMAT, app=office.APP)

    return change


DESKTOP: dict[str, Change] = {
    "choose_icons": set_property("xsettings", "Net/IconThemeName", "string", "hicolor"),
    "resize_panel": set_property("xfce4-panel", "panels/panel-1/nrows", "uint", "1"),
    "set_font_size": set_property("xsettings", "Gtk/FontName", "string", "Noto Sans 7"),
    "set_wallpaper": set_property(
        "xfce4-desktop",
        "backdrop/screen0/monitorscreen/workspace0/last-image",
        "string",
        "/usr/share/backgrounds/desktop/lock.png",
    ),
    "set_workspaces": set_property("xfwm4", "general/workspace_count", "int", "2"),
    "size_desktop_icons": set_property("xfce4-desktop", "desktop-icons/icon-size", "uint", "50"),
}
BROWSER: dict[str, Change] = {
    "add_bookmark": bookmark_page,
    "block_for_site": do_another_variant,
    "choose_search_engine": do_another_variant,
    "delete_bookmarks": bookmark_page,
    "enlarge_text": do_another_variant,
    "forget_site": visit_again,
    "rename_bookmark": bookmark_page,
    "set_startup_pages": add_start_page,
}
OFFICE: dict[str, Change] = {
    "libreoffice_calc": write_and_save(("ctrl", "home"), text="late\n"),
    "libreoffice_writer": write_and_save(("ctrl", "home"), text="late "),
    "libreoffice_impress": write_and_save(("ctrl", "m")),
}
DOCUMENTS = {
    name: OFFICE[task.apps[0]]
    for name, task in ((name, tasks.get(name)) for name in tasks.names())
    if task.apps[0] in OFFICE
}
CASES = {**DESKTOP, **BROWSER, **DOCUMENTS}
ONE_A_KIT = (
    "set_workspaces",
    "add_bookmark",
    "block_for_site",
    "add_sheet",
    "move_slide",
    "turn_page",
)
NAMES = sorted(CASES) if os.environ.get("LATE_CHANGES") == "all" else ONE_A_KIT
NEEDED = {"chrome": "chromium", **dict.fromkeys(OFFICE, "soffice")}


@pytest.fixture(scope="module")
def desktop(embedded_machine: None) -> Iterator[Any]:
    from online_env.embedded.desktop import EmbeddedDesktop

    with EmbeddedDesktop.up() as desktop:
        yield desktop


def begin_done(desktop: Any, task: Task) -> Machine:
    """Bring the task's right state about on a fresh desktop, with its application open."""
    desktop.reset()
    machine = Machine(desktop, SiteState(desktop.record["sites"]))
    if task.name in BROWSER:  # the right state of a profile that Chromium has not made is none
        task.setup(machine)
        task.oracle(Hand(desktop))
    else:
        machine.begin()
        task.prepare(machine)
        machine.remember()
        task.right_result(machine)
        machine.open(*task.initial_app(machine))
    return machine


@pytest.mark.parametrize("name", NAMES)
def test_a_wrong_change_in_the_last_second_is_seen(desktop: Any, name: str) -> None:
    task = tasks.get(name)
    if task.apps[0] in NEEDED:
        needs.apps(NEEDED[task.apps[0]])
    verdict = task.validate(begin_done(desktop, task))
    assert verdict.score == 1.0, verdict.reason
    machine = begin_done(desktop, task)
    CASES[name](task, machine, Hand(desktop))
    verdict = task.validate(machine)
    assert verdict.score == 0.0
