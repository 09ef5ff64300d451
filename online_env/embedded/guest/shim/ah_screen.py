"""`pyautogui.screenshot`: the screen through X's own requests.

The system's Python has no faster way.
"""

from Xlib import X


def grab(connection, filename, region):
    """The screen as a PIL image, saved as `filename` if one is given.

    Args:
        connection: to the display.
        filename: where to save it, or None.
        region: (left, top, width, height) of a part, or None.

    Raises:
        RuntimeError: Pillow is not installed.
    """
    try:
        from PIL import Image
    except ImportError:
        raise RuntimeError(
            "pyautogui.screenshot() needs Pillow in the desktop: apt-get install python3-pil"
        ) from None
    left, top, width, height = (int(v) for v in region) if region else (0, 0, *connection.size)
    raw = connection.root.get_image(left, top, width, height, X.ZPixmap, 0xFFFFFFFF)
    image = Image.frombuffer("RGB", (width, height), raw.data, "raw", "BGRX", 0, 1)
    if filename:
        image.save(filename)
    return image
