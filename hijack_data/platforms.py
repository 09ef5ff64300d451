"""Platforms: the kinds of machines that recordings show."""

from .choices import PLATFORMS, Platform
from .errors import ParameterError, ParameterTypeError, suggest

# The platform of the shipped pictures; in recordings of any other platform they look foreign.
OURS: Platform = "linux-xfce"
_ALIASES: dict[str, Platform] = {
    "xfce": "linux-xfce",
    "xfce4": "linux-xfce",
    # the domain that our own recorder writes, because the embedded desktop is Xfce
    "embedded": "linux-xfce",
    "ubuntu": "linux",
    "debian": "linux",
    "fedora": "linux",
    "gnome": "linux",
    "kde": "linux",
    "win": "windows",
    "win10": "windows",
    "win11": "windows",
    "mac": "macos",
    "osx": "macos",
    "os-x": "macos",
    "mac-os": "macos",
    "darwin": "macos",
    "iphone": "ios",
    "ipad": "ios",
    "ipados": "ios",
    "web-page": "web",
}


def find_platform(name: object) -> Platform | None:
    """Return the platform that a name means, such as `"macos"` for `"Darwin"`, or `None`.

    A version after the name is ignored: `"Windows 11"` is `"windows"`.
    """
    if not isinstance(name, str):
        return None
    words = name.strip().lower().replace("_", " ").replace("-", " ").split()
    while len(words) > 1 and words[-1][0].isdigit():
        words.pop()  # a version, as in `Windows 11` and `Ubuntu 22.04`
    spelling = "-".join(words)
    return _ALIASES.get(spelling) or next(
        (platform for platform in PLATFORMS if platform == spelling), None
    )


def as_platform(name: object, key: str = "platform") -> Platform:
    """Check that a name is that of a platform, and return the platform.

    Raises:
        ParameterError: the name is unknown.
        ParameterTypeError: the name is not a text.
    """
    if not isinstance(name, str):
        raise ParameterTypeError(
            f"{key} must be the name of a platform ({', '.join(PLATFORMS)}), got {name!r:.80}"
        )
    platform = find_platform(name)
    if platform is None:
        raise ParameterError(f"{key}: unknown platform {name!r:.80}{suggest(name, PLATFORMS)}")
    return platform
