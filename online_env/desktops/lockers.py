"""Programs that lock a session, with the commands to lock, unlock and query each."""

from dataclasses import dataclass

_GNOME = (
    "gdbus call --session --dest org.gnome.ScreenSaver --object-path /org/gnome/ScreenSaver "
    "--method org.gnome.ScreenSaver"
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
    """

    name: str
    query: str
    on: str
    off: str
    lock: str
    force: str
    window: bool = True


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
    ),
    Locker(
        "loginctl",
        'loginctl show-session "$XDG_SESSION_ID" -p LockedHint',
        "=yes",
        "=no",
        'loginctl lock-session "$XDG_SESSION_ID"',
        'loginctl unlock-session "$XDG_SESSION_ID"',
        False,
    ),
)
BY_NAME = {locker.name: locker for locker in LOCKERS}
