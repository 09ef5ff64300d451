"""Scripted solutions of OSWorld's tasks that need no download, by the id of the task.

Each acts as an agent could: through the application's own windows, or through the shell of the
desktop's user.
"""

from collections.abc import Callable
from dataclasses import dataclass

from .player import Player


@dataclass(frozen=True)
class Solution:
    """A script; `how` is `"windows"` (the application's own) or `"shell"`."""

    how: str
    play: Callable[[Player], None]


_GIMP = "GNU Image Manipulation Program"


def do_not_track(player: Player) -> None:
    """Chrome 030eeff7."""
    player.visit("chrome://settings/cookies")
    player.click('Send a "Do Not Track" request', "toggle-button")
    player.click("Confirm", "push-button")


def password_page(player: Player) -> None:
    """Chrome 12086550."""
    player.visit("chrome://password-manager/passwords")
    player.find("Search passwords")


def bookmark_folder(player: Player) -> None:
    """Chrome 2ad9387a."""
    player.visit("chrome://bookmarks")
    player.click("Organize", "push-button")
    player.do("time.sleep(0.5)")
    # Add new folder
    player.do("pyautogui.press(['down', 'down', 'enter'], interval=0.1)", pause=1.0)
    player.type("Favorites")
    player.press("enter", pause=1.0)


def profile_name(player: Player) -> None:
    """Chrome 2ae9ba84."""
    player.visit("chrome://settings/manageProfile")
    player.click("Name", "entry")
    player.press("ctrl", "a")
    player.type("Thomas")
    player.press("tab", pause=1.0)


def clear_youtube(player: Player) -> None:
    """Chrome 44ee5668.

    The history has addresses more than once, and Chromium removes one of each at a time.
    """
    for _ in range(6):
        player.visit("chrome://history/?q=youtube")
        player.find("Search history")
        player.press("tab")
        player.press("ctrl", "a")
        if not player.sees("Delete", "push-button"):
            return
        player.click("Delete", "push-button")
        player.find("Are you sure")
        player.click("Delete", "push-button")


def font_size(player: Player) -> None:
    """Chrome af630914."""
    player.visit("chrome://settings/fonts")
    player.click("Font size", "slider")
    player.press("end", pause=1.0)


def bing(player: Player) -> None:
    """Chrome bb5e4c0d."""
    player.visit("chrome://settings/searchEngines")
    player.click_beside("Microsoft Bing", "More actions", "push-button")
    player.do("pyautogui.press(['down', 'enter'], interval=0.1)", pause=1.0)  # Make default


def light_mode(player: Player) -> None:
    """Chrome 93eabf48; the mode can be chosen once the browser does not follow the desktop."""
    player.visit("chrome://settings/appearance")
    player.find("Appearance")
    if player.sees("Use Classic", "push-button"):
        player.click("Use Classic", "push-button")
    player.click("Mode", "combo-box")
    player.type("Light")
    player.press("enter", pause=1.0)


def gimp_docks(player: Player) -> None:
    """GIMP d52d6308: Windows > Hide Docks, by its key."""
    player.find(_GIMP, timeout=60)
    player.press("tab", pause=1.0)


def slide_panel(player: Player) -> None:
    """Impress ef9d12bd: View > Slide Pane."""
    player.click("View", "menu")
    player.click("Slide Pane", "check-menu-item")


def _shell(*commands: str, after: str = "") -> Solution:
    """Return a script of shell commands; it first waits for an element named `after`."""

    def play(player: Player) -> None:
        if after:
            player.find(after, timeout=60)
        for command in commands:
            player.shell(command)

    return Solution("shell", play)


def _gimprc(line: str) -> Solution:
    return _shell(f"echo '{line}' >> ~/.config/GIMP/2.10/gimprc", after=_GIMP)


def _vlc(setting: str) -> Solution:
    key, _, _ = setting.partition("=")
    file = "~/.config/vlc/vlcrc"
    return _shell(f"sed -i '/^#\\?{key}=/d' {file}", f"echo '{setting}' >> {file}")


def _gsettings(*settings: str) -> Solution:
    return _shell(*(f"gsettings set org.gnome.{setting}" for setting in settings))


_AUTO_SAVE = (
    '<item oor:path="/org.openoffice.Office.Common/Save/Document"><prop oor:name="{}"'
    ' oor:op="fuse"><value>{}</value></prop></item>'
)
_LIBRE = "~/.config/libreoffice/4/user/registrymodifications.xcu"
_AUTO_SAVE_LINES = "".join(
    f"s|</oor:items>|{_AUTO_SAVE.format(name, value)}</oor:items>|;"
    for name, value in (("AutoSave", "true"), ("AutoSaveTimeIntervall", "3"))
)
_VIDEO = "$(grep -o '^video/[^=]*' ~/.config/mimeapps.list)"  # the browser opens them all at first

SOLUTIONS: dict[str, Solution] = {
    "030eeff7-b492-4218-b312-701ec99ee0cc": Solution("windows", do_not_track),
    "12086550-11c0-466b-b367-1d9e75b3910e": Solution("windows", password_page),
    "2ad9387a-65d8-4e33-ad5b-7580065a27ca": Solution("windows", bookmark_folder),
    "2ae9ba84-3a0d-4d4c-8338-3a1478dc5fe3": Solution("windows", profile_name),
    "44ee5668-ecd5-4366-a6ce-c1c9b8d4e938": Solution("windows", clear_youtube),
    "af630914-714e-4a24-a7bb-f9af687d3b91": Solution("windows", font_size),
    "bb5e4c0d-f964-439c-97b6-bdb9747de3f4": Solution("windows", bing),
    "93eabf48-6a27-4cb6-b963-7d5fe1e0d3a9": Solution("windows", light_mode),
    "7767eef2-56a3-4cea-8c9f-48c070c7d65b": _gimprc('(theme "Light")'),
    "7b7617bd-57cc-468e-9c91-40c4ec2bcb3d": _gimprc("(undo-levels 100)"),
    "d52d6308-ec58-42b7-a2c9-de80e4837b2b": Solution("windows", gimp_docks),
    "2cd43775-7085-45d8-89fa-9e35c0a915cf": _shell(
        "pkill soffice; sleep 3",  # a running LibreOffice writes the file again
        f"sed -i '{_AUTO_SAVE_LINES}' {_LIBRE}",
        after="Untitled 1",
    ),
    "ef9d12bd-bcee-4ba0-a40e-918400f43ddf": Solution("windows", slide_panel),
    "937087b6-f668-4ba6-9110-60682ee33441": _shell(
        f"for kind in {_VIDEO}; do xdg-mime default vlc.desktop $kind; done"
    ),
    "13584542-872b-42d8-b299-866967b5c3ef": _shell(
        "sed -i '/^MiscDefaultGeometry=/d' ~/.config/xfce4/terminal/terminalrc",
        "echo MiscDefaultGeometry=132x43 >> ~/.config/xfce4/terminal/terminalrc",
    ),
    "e0df059f-28a6-4169-924f-b9623e7184cc": _shell(
        "cd ~/Desktop && echo password | sudo -S mv todo_list_Jan_1 todo_list_Jan_2"
    ),
    "215dfd39-f493-4bc3-a027-8a97d72c61bf": _vlc("qt-bgcone=0"),
    "5ac2891a-eacd-4954-b339-98abba077adb": _vlc("play-and-exit=0"),
    "8ba5ae7a-5ae5-4eab-9fcc-5dd4fe3abf89": _vlc("input-record-path=/home/user/Desktop"),
    "9195653c-f4aa-453d-aa95-787f6ccfaae9": _vlc("qt-max-volume=200"),
    "a5bbbcd5-b398-4c91-83d4-55e1e31bbb81": _vlc("qt-minimal-view=1"),
    "d06f0d4d-2cd5-4ede-8de9-598629438c6e": _vlc(
        "qt-slider-colours=20;20;20;30;30;30;40;40;40;50;50;50"
    ),
    "f3977615-2b45-4ac5-8bba-80c17dbe2a37": _vlc("one-instance-when-started-from-file=0"),
    # GNOME's settings, which can be written here though nothing on an Xfce desktop shows them.
    "3ce045a0-877b-42aa-8d2c-b4a863336ab8": _gsettings("desktop.interface text-scaling-factor 1.5"),
    "a4d98375-215b-4a4d-aee9-3d4370fccc41": _gsettings("desktop.screensaver lock-enabled true"),
    "bedcedc4-4d72-425e-ad62-21960b11fe0d": _gsettings("desktop.session idle-delay 0"),
    "f9be0997-4b7c-45c5-b05c-4612b44a6118": _gsettings("desktop.notifications show-banners false"),
}
