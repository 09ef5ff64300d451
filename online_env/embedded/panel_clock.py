"""The clock of the panel shows a time that the seed decides, and stands still.

A clock that runs is the only part of a clean screen that differs between two runs, and one pixel is
enough to make a replay of a run fail. The formats of the panel's clock are therefore texts without
any field of the time.
"""

import time

from hijack_data.rng import Stream

from ..desktops import commands
from ..desktops.protocol import Desktop
from ..errors import DesktopError
from .sites.hosts_and_dates import TODAY

# The panel shows the text of the first property. The second one's label is hidden, but it is the
# button's name in the accessibility tree.
_PROPERTIES = ("digital-time-format", "digital-date-format")
_SET = "".join(
    f'xfconf-query -c xfce4-panel -p /plugins/plugin-7/{name} -s "$1" && ' for name in _PROPERTIES
)
# Minutes after midnight: later than each mail of that day, until the evening.
_EARLIEST, _LATEST = 10 * 60 + 30, 18 * 60 + 59
_TIMEOUT_S = 10.0
_POLL_S = 0.02


def panel_clock_text(seed: int) -> str:
    """Return what the clock shows in an episode, such as `Wed 04 Mar   14:20`.

    Args:
        seed: The seed of the task's variant. It decides the time of day (10:30 to 18:59); the date
            is the one on which the local sites are.
    """
    hour, minute = divmod(Stream(seed, "panel-clock").integer(_EARLIEST, _LATEST), 60)
    return f"{TODAY:%a %d %b}   {hour:02}:{minute:02}"


def set_panel_clock(desktop: Desktop, seed: int) -> None:
    """Let the panel of an embedded desktop show the time of a seed, and wait until it does.

    Args:
        desktop: An embedded desktop that has just been reset.
        seed: The seed of the task's variant.

    Raises:
        DesktopError: The panel's settings cannot be changed, or the panel does not follow them.
    """
    text = panel_clock_text(seed)
    commands.command(desktop, "sh", "-c", f"{_SET}true", "sh", text)
    deadline = time.monotonic() + _TIMEOUT_S
    while f'name="{text}"' not in desktop.accessibility():
        if time.monotonic() > deadline:
            raise DesktopError(
                f"the panel's clock does not show {text!r} within {_TIMEOUT_S:.0f} s"
            )
        time.sleep(_POLL_S)
