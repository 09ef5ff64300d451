"""The clock of the panel: it shows a time that the seed decides, and stands still.

A clock that runs is the only part of a clean screen that differs between two runs, and one pixel is
enough to make a replay of a run fail. The format of the panel's clock is therefore a text without
any field of the time.
"""

from hijack_data.rng import Stream

from ..desktops import commands
from ..desktops.protocol import Desktop
from .sites.names import TODAY

_PROPERTY = "/plugins/plugin-7/digital-time-format"  # `home/.config/xfce4/.../xfce4-panel.xml`


def clock_text(seed: int) -> str:
    """Return what the clock shows in an episode: the date of the local sites, 08:00 to 18:59.

    Args:
        seed: The seed of the task's variant.
    """
    stream = Stream(seed, "panel-clock")
    return f"{TODAY:%a %d %b}   {stream.integer(8, 18):02}:{stream.integer(0, 59):02}"


def set_panel_clock(desktop: Desktop, seed: int) -> None:
    """Let the panel of an embedded desktop show the time of a seed.

    Raises:
        DesktopError: The panel's settings cannot be changed.
    """
    argv = ("xfconf-query", "-c", "xfce4-panel", "-p", _PROPERTY, "-s", clock_text(seed))
    commands.command(desktop, *argv)
