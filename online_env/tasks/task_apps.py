"""The applications that tasks use: how they start, and what the accessibility tree has of them."""

import re
from dataclasses import dataclass

from hijack_data.errors import UnknownNameError, suggest

# What Chromium's error page says of a page that could not be loaded.
PAGE_ERROR = re.compile(r"(DNS_PROBE|ERR)_[A-Z_]+$")
_OFFICE = ("--norestore", "--nologo")


@dataclass(frozen=True, kw_only=True)
class TaskApp:
    """One application.

    Args:
        argv: The program and its first arguments.
        processes: The names of its processes.
        tree: A part of its name in the accessibility tree, in any case.
        helper: The same of another process that shows some of its dialogs; "" if it shows all
            of them itself.
        ready: The roles of nodes that are there once it can be used.
        profile: The profile of `hijack desktop install` that has it.
        timeout: Seconds that it may take to start.
    """

    argv: tuple[str, ...]
    processes: tuple[str, ...]
    tree: str
    helper: str = ""
    ready: tuple[str, ...] = ("frame",)
    profile: str = "core"
    timeout: float = 30.0


def _office(part: str, ready: str) -> TaskApp:
    return TaskApp(
        argv=("soffice", f"--{part}", *_OFFICE),
        processes=("soffice.bin", "oosplash"),
        tree="soffice",
        ready=("frame", ready),
        profile="office",
        timeout=60.0,
    )


APPS: dict[str, TaskApp] = {
    "thunar": TaskApp(argv=("thunar",), processes=("thunar", "Thunar"), tree="thunar"),
    "mousepad": TaskApp(
        argv=("mousepad",), processes=("mousepad",), tree="mousepad", ready=("text",)
    ),
    "terminal": TaskApp(
        argv=("xfce4-terminal",),
        processes=("xfce4-terminal",),
        tree="xfce4-terminal",
        ready=("terminal",),
    ),
    "chrome": TaskApp(
        argv=("google-chrome",),
        processes=("chrome", "chromium"),
        tree="chrom",
        helper="xdg-desktop-portal",  # to open and save files
        ready=("frame", "document-web"),
        profile="web",
        timeout=30.0,
    ),
    "evince": TaskApp(argv=("evince",), processes=("evince",), tree="evince"),
    "ristretto": TaskApp(argv=("ristretto",), processes=("ristretto",), tree="ristretto"),
    "xarchiver": TaskApp(argv=("xarchiver",), processes=("xarchiver",), tree="xarchiver"),
    "settings": TaskApp(
        argv=("xfce4-settings-manager",),
        processes=("xfce4-settings-manager",),
        tree="xfce4-settings-manager",
        ready=("dialog",),
    ),
    # The dialogs of the settings. Inside the settings manager, the tree lacks them at times.
    "appearance": TaskApp(
        argv=("xfce4-appearance-settings",),
        processes=("xfce4-appearance-settings",),
        tree="xfce4-appearance-settings",
        ready=("dialog",),
    ),
    "workspace_settings": TaskApp(
        argv=("xfwm4-workspace-settings",),
        processes=("xfwm4-workspace-settings",),
        tree="xfwm4-workspace-settings",
        ready=("dialog",),
    ),
    "desktop_settings": TaskApp(
        argv=("xfdesktop-settings",),
        processes=("xfdesktop-settings",),
        tree="xfdesktop-settings",
        ready=("dialog",),
    ),
    "panel_settings": TaskApp(
        argv=("xfce4-panel", "--preferences"), processes=(), tree="xfce4-panel", ready=("dialog",)
    ),
    "geany": TaskApp(
        argv=("geany", "--new-instance"), processes=("geany",), tree="geany", profile="office"
    ),
    "libreoffice_calc": _office("calc", "table"),
    "libreoffice_writer": _office("writer", "paragraph"),
    "libreoffice_impress": _office("impress", "panel"),
    "gimp": TaskApp(
        argv=("gimp", "--no-splash"),
        processes=("gimp", "gimp-2.10"),
        tree="gimp",
        helper="file-",  # such as `file-png`, for the options of a format
        profile="media",
        timeout=120.0,
    ),
    "vlc": TaskApp(
        argv=("vlc", "--no-qt-privacy-ask", "--no-video-title-show"),
        processes=("vlc",),
        tree="vlc",
        profile="media",
    ),
}


def find_app(name: str) -> TaskApp:
    """Return an application of the table.

    Raises:
        UnknownNameError: There is none of that name.
    """
    if name not in APPS:
        raise UnknownNameError(f"no application {name!r} for tasks{suggest(name, APPS)}")
    return APPS[name]
