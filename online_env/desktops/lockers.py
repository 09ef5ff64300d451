"""Programs that lock a session, with the commands to lock, unlock and query each."""

from dataclasses import dataclass

_GNOME = (
    "gdbus call --session --dest org.gnome.ScreenSaver --object-path /org/gnome/ScreenSaver "
    "--method org.gnome.ScreenSaver"
)


# GNOME Shell locks only where GDM can check the password, and where no policy forbids it; otherwise
# its answer to the request is the same, and nothing happens.
_GDM = (
    "timeout 3 gdbus call --system --dest org.gnome.DisplayManager --object-path"
    " /org/gnome/DisplayManager/Manager --method org.freedesktop.DBus.Properties.Get"
    " org.gnome.DisplayManager.Manager Version"
)
_GNOME_CAN_LOCK = (
    f"{_GDM} >/dev/null 2>&1 && "
    '[ "$(gsettings get org.gnome.desktop.lockdown disable-lock-screen 2>/dev/null)" != true ]'
)
# OSWorld's server is a service of the system, to which nobody gave the address of the session's
# bus; without it gdbus may start a bus of its own, where a locker answers that locks nothing.
SESSION_BUS = (
    'bus=${XDG_RUNTIME_DIR:-/run/user/$(id -u)}/bus; [ -n "$DBUS_SESSION_BUS_ADDRESS" ] || '
    '[ ! -S "$bus" ] || export DBUS_SESSION_BUS_ADDRESS="unix:path=$bus"'
)
REMEDY = (
    "one of these lockers must run there and answer: mate-screensaver, xfce4-screensaver,"
    " cinnamon-screensaver, GNOME Shell (gdm3 must run, and gsettings set"
    " org.gnome.desktop.lockdown disable-lock-screen false), or logind where it gives LockedHint"
)


@dataclass(frozen=True)
class Locker:
    """One locker, by shell commands.

    Args:
        name: its program, which must be installed.
        query: prints the state; `on` and `off` recognise it.
        on: the text in the answer while the session is locked.
        off: the text in the answer while it is not; if neither occurs, the locker does not run.
        lock: locks the session.
        force: unlocks it without the password.
        window: whether the locker's own X window covers the screen (false if the compositor itself
            locks).
        able: a command that succeeds where the locker can lock.
    """

    name: str
    query: str
    on: str
    off: str
    lock: str
    force: str
    window: bool = True
    able: str = "true"


def _family(command: str) -> Locker:
    """Return a locker descended from gnome-screensaver, which shares its options."""
    return Locker(
        command, f"{command} -q", " is active", " is inactive", f"{command} -l", f"{command} -d"
    )


# In this order: the first that is installed and answers is used.
LOCKERS: tuple[Locker, ...] = (
    _family("mate-screensaver-command"),
    _family("xfce4-screensaver-command"),
    _family("cinnamon-screensaver-command"),
    Locker(
        "gdbus",
        f"{_GNOME}.GetActive",
        "(true,)",
        "(false,)",
        f"{_GNOME}.Lock",
        f"{_GNOME}.SetActive false",
        False,
        _GNOME_CAN_LOCK,
    ),
    Locker(
        "loginctl",
        'loginctl show-session "$XDG_SESSION_ID" -p LockedHint',
        "=yes",
        "=no",
        'loginctl lock-session "$XDG_SESSION_ID"',
        'loginctl unlock-session "$XDG_SESSION_ID"',
        False,
        # It would pass the request on to the GNOME Shell that cannot lock.
        '! pgrep -x -u "$(id -u)" gnome-shell >/dev/null',
    ),
)
BY_NAME = {locker.name: locker for locker in LOCKERS}
