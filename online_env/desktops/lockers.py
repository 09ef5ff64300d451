"""Programs that lock a session: how each is asked, and how it says that it is locked."""

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
        query: prints `active` while locked and `inactive` while not, each as a word that `on` and
            `off` tell apart.
        on: what the answer holds while the session is locked.
        off: what it holds while it is not; neither means that the locker does not run.
        lock: locks the session.
        force: unlocks it without the password.
        window: whether an X window of its own covers the screen (not so where the compositor itself
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
    """Descendants of gnome-screensaver share its options."""
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
