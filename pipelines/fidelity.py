"""The column `fidelity`: how close a row is to what a live desktop would show."""

from collections.abc import Mapping

from hijack_data.types import Fidelity

FIDELITY_MEANINGS: Mapping[Fidelity, str] = {
    "exact": "a live desktop under the same plan shows the same pixels.",
    "recorded": (
        "the whole screen was really shown by a desktop of the asset pack, of the "
        "recording's platform, though not by the recording's machine; or, after a fault of the "
        "input, by the recording's own machine; nothing was drawn over it."
    ),
    "composited": (
        "recorded pixels of a desktop of the recording's platform, put together on the "
        "screenshot, cut, scaled down, or with something drawn over them; such a screen was never "
        "shown as a whole."
    ),
    "foreign": (
        "recorded pixels of a desktop (Xfce) that is not the recording's, or not known to "
        "be; such rows are made only on request."
    ),
}


def row_fidelity(
    event: Fidelity, *, is_foreign: bool = False, is_drawn_over: bool = False
) -> Fidelity:
    """Return the fidelity of a row; that of its event, without drawings over it, is `event`."""
    if is_foreign:
        return "foreign"
    return "composited" if is_drawn_over and event == "recorded" else event
