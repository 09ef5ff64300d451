"""The Debian packages of the embedded desktop, by profile, and how to install them."""

import os
import shutil
import subprocess
from collections.abc import Iterable, Sequence

from hijack_data.errors import UnknownNameError, suggest

from ..errors import DesktopError, MissingPackageError, RootRequiredError
from ..privilege import through_sudo

PROFILES: dict[str, tuple[str, ...]] = {
    "core": (
        # the screen, the session and its namespaces
        "xvfb",
        "xauth",
        "x11-utils",
        "x11-xserver-utils",
        "dbus",
        "iproute2",
        "nftables",
        "iptables",
        "procps",
        "sudo",
        "util-linux",
        # Xfce and what a person uses on it
        "xfwm4",
        "xfce4-panel",
        "xfdesktop4",
        "xfce4-settings",
        "xfconf",
        "thunar",
        "mousepad",
        "xfce4-terminal",
        "mate-screensaver",
        "gvfs",
        "libglib2.0-bin",
        "dconf-gsettings-backend",
        "xdg-utils",
        "xfce4-appfinder",
        "xfce4-screenshooter",
        "xfce4-notifyd",
        "libnotify-bin",
        "ristretto",
        "evince",
        "xarchiver",
        "thunar-archive-plugin",  # "Extract Here" and "Create Archive" in the menus of Thunar
        "zip",
        "unzip",
        # the accessibility tree
        "at-spi2-core",
        "libatk-adaptor",
        # the look
        "greybird-gtk-theme",
        "elementary-xfce-icon-theme",
        "adwaita-icon-theme",
        "dmz-cursor-theme",
        "librsvg2-common",
        "fonts-noto-core",
        "fonts-dejavu-core",
        "fonts-liberation",
        "fonts-wqy-microhei",
        "fonts-noto-color-emoji",
        # what tasks and agents call
        "python3",
        "python3-xlib",
        "python3-pil",
        "xdotool",
        "wmctrl",
        "xclip",
        "socat",
        "curl",
        "ffmpeg",
    ),
    "web": (
        "chromium",
        # With them Chromium's dialogs for files are in the accessibility tree; its own are not.
        "xdg-desktop-portal",
        "xdg-desktop-portal-gtk",
    ),
    # Noto CJK is 55 MB to fetch and 89 MB on disk, so it comes with the documents that may need it;
    # core has WenQuanYi, which is 1.6 MB to fetch and has the letters of all three languages.
    "office": (
        "libreoffice-writer",
        "libreoffice-calc",
        "libreoffice-impress",
        "libreoffice-gtk3",
        "geany",
        "fonts-noto-cjk",
    ),
    "media": (
        "gimp",
        "gtk2-engines-pixbuf",
        "libgail-common",  # without it GIMP, which is of GTK 2, has no accessibility tree
        "vlc",
        "thunderbird",
    ),
}
ALL = "all"
PROFILE_NAMES = (*PROFILES, ALL)
APT_OPTIONS = ("-y", "--no-install-recommends", "-o", "DPkg::Lock::Timeout=300")


def packages(profiles: Iterable[str]) -> list[str]:
    """Return the packages of `profiles`; `core` is always among them.

    Raises:
        UnknownNameError: There is no such profile.
    """
    profile_names = ["core", *profiles]
    for name in profile_names:
        if name not in PROFILE_NAMES:
            raise UnknownNameError(f"no profile {name!r}{suggest(name, PROFILE_NAMES)}")
    names = PROFILES if ALL in profile_names else dict.fromkeys(profile_names)
    return [package for name in names for package in PROFILES[name]]


def missing(names: Sequence[str]) -> list[str]:
    """Those of `names` that dpkg does not list as installed.

    Raises:
        MissingPackageError: There is no dpkg (not Debian or a relative).
    """
    if not shutil.which("dpkg-query"):
        raise MissingPackageError(
            "dpkg-query is not on this machine, so desktops cannot be made of its packages; take an"
            " image of the desktop: hijack desktop install"
        )
    command = ["dpkg-query", "-W", "-f=${Package} ${db:Status-Status}\n", *names]
    listed = subprocess.run(
        command, capture_output=True, text=True, check=False
    ).stdout.splitlines()
    installed = {line.split()[0] for line in listed if line.endswith(" installed")}
    return [name for name in names if name not in installed]


def install_line(names: Sequence[str]) -> str:
    """Return the command that a person types to install `names`."""
    return f"apt-get update && apt-get install -y --no-install-recommends {' '.join(names)}"


def install(names: Sequence[str]) -> None:
    """Install `names` with apt-get, whose progress goes to the terminal; through sudo without root.

    Without either it is a `RootRequiredError`, with the command to run.

    Raises:
        DesktopError: apt-get fails; with the command to run.
    """
    if not names:
        return
    for command in (["apt-get", "update"], ["apt-get", "install", *APT_OPTIONS, *names]):
        process = subprocess.run(_as_root(command, names), check=False)
        if process.returncode != 0:
            raise DesktopError(
                f"`{' '.join(command)}` failed with exit code {process.returncode}; see its output"
                f" above. As root: {install_line(names)}"
            )


def _as_root(command: list[str], names: Sequence[str]) -> list[str]:
    quiet = {"DEBIAN_FRONTEND": "noninteractive"}
    if os.geteuid() == 0:
        return ["env", *(f"{name}={value}" for name, value in quiet.items()), *command]
    sudo_command = through_sudo(command, **quiet)
    if sudo_command is None:
        raise RootRequiredError(
            "installing packages needs root, and there is no sudo here; run as root: sh -c"
            f" '{install_line(names)}'"
        )
    return sudo_command
