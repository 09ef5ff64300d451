"""The programs of a desktop session and the environment they share."""

from dataclasses import dataclass

from . import account

DISPLAY = ":0"
RUNTIME = f"/run/user/{account.UID}"
BUS = f"unix:path={RUNTIME}/bus"
AUTHORITY = f"{RUNTIME}/Xauthority"
HOME = account.HOME
SCREEN_FOLDER = "/run/screen"
# Names of ours are not for the agent to see, so this folder has a plain one.
TOOLS = "/usr/local/lib/desktop"
PATH = f"{TOOLS}/bin:/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin:/usr/games"


@dataclass(frozen=True)
class Program:
    """One program.

    Attributes:
        argv: its command.
        window: WM_CLASS of the window that shows that it is there; empty if there is none.
    """

    argv: tuple[str, ...]
    window: str = ""


# Started as soon as the display and the bus answer; started again when one of them ends.
SERVICES: dict[str, Program] = {
    "xfsettingsd": Program(("xfsettingsd", "--no-daemon", "--disable-wm-check")),
    "xfwm4": Program(("xfwm4", "--compositor=off", "--sm-client-disable")),
}
# Started when the settings of fonts and themes are published; started again like the services.
SHELL: dict[str, Program] = {
    "xfdesktop": Program(("xfdesktop", "--sm-client-disable"), "xfdesktop"),
    "xfce4-panel": Program(("xfce4-panel", "--sm-client-disable"), "xfce4-panel"),
}
# Started when the desktop is usable, so that nobody waits for it (0.2 s of a core).
LATE: dict[str, Program] = {"mate-screensaver": Program(("mate-screensaver", "--no-daemon"))}
# What `up --app` knows by name.
APPS: dict[str, Program] = {
    "browser": Program(("google-chrome",), "chromium"),
    "editor": Program(("mousepad",), "mousepad"),
    "files": Program(("thunar",), "thunar"),
    "terminal": Program(("xfce4-terminal",), "xfce4-terminal"),
    "writer": Program(("libreoffice", "--writer"), "libreoffice-writer"),
    "calc": Program(("libreoffice", "--calc"), "libreoffice-calc"),
    "impress": Program(("libreoffice", "--impress"), "libreoffice-impress"),
    "code": Program(("geany",), "geany"),
}


def environment() -> dict[str, str]:
    """Return what every program of the session gets."""
    return {
        "PATH": PATH,
        "HOME": account.HOME,
        "USER": account.NAME,
        "LOGNAME": account.NAME,
        "SHELL": "/bin/bash",
        "LANG": "C.UTF-8",
        "DISPLAY": DISPLAY,
        "XAUTHORITY": AUTHORITY,
        "XDG_RUNTIME_DIR": RUNTIME,
        "DBUS_SESSION_BUS_ADDRESS": BUS,
        "XDG_CURRENT_DESKTOP": "XFCE",
        "XDG_SESSION_TYPE": "x11",
        "XDG_SESSION_CLASS": "user",
        "XDG_MENU_PREFIX": "xfce-",
        "DESKTOP_SESSION": "xfce",
        "XDG_CONFIG_DIRS": "/etc/xdg",
        "XDG_DATA_DIRS": "/usr/local/share:/usr/share",
        # A text file in the home holds the settings: no service to wait for, and easy to look at.
        "GSETTINGS_BACKEND": "keyfile",
        "XCURSOR_THEME": "DMZ-White",
        # There is no udisks here, of which every application would complain on its standard error.
        "GIO_USE_VOLUME_MONITOR": "unix",
        # Without these an application keeps its accessibility tree to itself.
        "GTK_MODULES": "gail:atk-bridge",
        "QT_ACCESSIBILITY": "1",
        "NO_AT_BRIDGE": "0",
        "ACCESSIBILITY_ENABLED": "1",
        "SAL_USE_VCLPLUGIN": "gtk3",
    }


def display_server(screen: tuple[int, int], report: int) -> tuple[str, ...]:
    """Return the X server for a screen of (width, height).

    It writes its number to the descriptor `report` when it is ready.
    """
    width, height = screen
    return (
        "Xvfb",
        DISPLAY,
        "-displayfd",
        str(report),
        "-screen",
        "0",
        f"{width}x{height}x24",
        "-dpi",
        "96",
        "-nolisten",
        "tcp",
        "-noreset",
        "-auth",
        AUTHORITY,
        "-s",
        "0",
        "-dpms",
        "-fbdir",
        SCREEN_FOLDER,
    )


def session_bus(report: int) -> tuple[str, ...]:
    """Return the session bus; it writes its address to the descriptor `report` when ready."""
    return (
        "dbus-daemon",
        "--session",
        "--nofork",
        "--nopidfile",
        f"--address={BUS}",
        f"--print-address={report}",
    )


def module_command(
    python: str, search_path: tuple[str, ...], module: str, *arguments: str
) -> tuple[str, ...]:
    """Run a Python module with the controller's search path, whatever the environment says."""
    code = (
        f"import sys, runpy; sys.path[:0] = {list(search_path)!r}; "
        f"runpy.run_module({module!r}, run_name='__main__', alter_sys=True)"
    )
    return (python, "-I", "-c", code, *arguments)
