"""Which elements of panels and of the desktop launch an application.

A panel does not say what its buttons do. The guest knows its applications, though: each has a
desktop entry (freedesktop.org), whose name its launchers bear.
"""

import re
from collections.abc import Collection

from .base import EffectError
from .elements import Element
from .guest import Guest

# Their elements are icons, which open a file, a folder or a program in another application.
ICON_DESKTOPS = frozenset(
    {"xfdesktop", "nemo-desktop", "caja-desktop", "ding", "gjs", "desktop-icons"}
)
_MENU_ITEMS = frozenset({"menu-item", "check-menu-item", "radio-menu-item"})
# These open a menu of the panel's own, or switch something.
_SWITCHES = frozenset({"toggle-button", "check-box", "check-menu-item", "radio-menu-item"})
_NAME = re.compile(r"(?:Generic|X-GNOME-Full)?Name(?:\[[^]]*\])?\s*=(.*)")
# The folders in which the freedesktop.org standard looks for entries, and where panels keep theirs.
_LIST_NAMES = r"""
IFS=:
set --
for data in "${XDG_DATA_HOME:-$HOME/.local/share}" ${XDG_DATA_DIRS:-/usr/local/share:/usr/share} \
  "$HOME/.local/share/flatpak/exports/share" /var/lib/flatpak/exports/share /var/lib/snapd/desktop
do set -- "$@" "$data/applications"; done
exec grep -rhs --include='*.desktop' -E '^(Generic|X-GNOME-Full)?Name(\[[^]]*\])?[[:space:]]*=' \
  "$@" "${XDG_CONFIG_HOME:-$HOME/.config}/xfce4/panel"
"""
# Not the codes of a shell without grep. 2: a folder does not exist; None: the guest gives no codes.
_GREP_ENDED = (None, 0, 1, 2)


def application_names(guest: Guest) -> frozenset[str]:
    """Return the names of the applications of a guest, in all languages, case-folded.

    Raises:
        EffectError: The guest cannot list them.
    """
    result = guest.shell(_LIST_NAMES)
    if result.returncode not in _GREP_ENDED:
        raise EffectError(
            "the guest cannot list its applications, which without_app needs:"
            f" {result.error.strip()[-300:]}"
        )
    matches = (_NAME.fullmatch(line) for line in result.output.splitlines())
    names = {match[1].strip().casefold() for match in matches if match is not None}
    return frozenset(names - {""})


def launches_application(
    element: Element, applications: Collection[str], titles: Collection[str]
) -> bool:
    """Return whether a click on an element of a panel or of the desktop launches an application.

    Args:
        element: an element of a program in `elements.LAUNCHERS`.
        applications: what `application_names` returns.
        titles: the titles of the windows, case-folded: a button that bears one stands for it.
    """
    if element.role == "menu":
        return False
    if element.app.lower() in ICON_DESKTOPS and element.role not in _MENU_ITEMS:
        return True
    name = element.name.strip().casefold()
    if element.role in _SWITCHES:
        return name in applications and name not in titles
    return not name or name in applications
