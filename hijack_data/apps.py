"""Names of applications: one spelling for each, and which names mean the same program or a kind.

Sources write `"Google Chrome"`, `"chromium"` and `"google-chrome"` for the program that the paper's
list calls `chrome`. All comparisons of applications use these normalised names.
"""

import re
from collections.abc import Iterable, Mapping

from .platforms import find_platform

ALIASES = {
    "vs_code": "vscode",
    "visual_studio_code": "vscode",
    "code": "vscode",
    "code_oss": "vscode",
    "vscodium": "vscode",
    "google_chrome": "chrome",
    "google_chrome_stable": "chrome",
    "chromium": "chrome",
    "chromium_browser": "chrome",
    "mozilla_firefox": "firefox",
    "firefox_esr": "firefox",
    "microsoft_edge": "edge",
    "msedge": "edge",
    "web_browser": "browser",
    "web": "browser",
    "calc": "libreoffice_calc",
    "impress": "libreoffice_impress",
    "writer": "libreoffice_writer",
    "libre_office": "libreoffice",
    "gnu_image_manipulation_program": "gimp",
    "xfce_terminal": "xfce4_terminal",
    "terminal_emulator": "terminal",
    "file_explorer": "explorer",
    "windows_explorer": "explorer",
    "files": "file_manager",
    "mozilla_thunderbird": "thunderbird",
}
# Kinds of applications, by the generic name; sources often name only the kind.
KINDS: Mapping[str, frozenset[str]] = {
    "browser": frozenset({"chrome", "firefox", "edge", "safari", "opera", "brave", "vivaldi"}),
    "libreoffice": frozenset({"libreoffice_calc", "libreoffice_impress", "libreoffice_writer"}),
    "terminal": frozenset({"xfce4_terminal", "gnome_terminal", "konsole", "xterm"}),
    "file_manager": frozenset({"thunar", "nautilus", "dolphin", "finder", "explorer"}),
    "text_editor": frozenset({"mousepad", "gedit", "notepad", "textedit", "kate"}),
}
# Words that sources write in a field for applications, or as a domain, and that name no
# application.
NONE = frozenset(
    {"", "os", "desktop", "system", "multi_apps", "multiapps", "multi_app", "base_setup"}
)
# Applications that no kind above names, and that a domain may stand for.
_OTHERS = frozenset(
    {
        "vscode",
        "gimp",
        "vlc",
        "thunderbird",
        "galculator",
        "geany",
        "word",
        "excel",
        "powerpoint",
        "outlook",
        "paint",
    }
)
KNOWN: frozenset[str] = _OTHERS.union(KINDS, *KINDS.values())


def normalize_app(name: str) -> str:
    """Return an application's name as the paper's list spells it: `"VS Code"` is `"vscode"`."""
    spelling = "_".join(name.strip().lower().replace("-", " ").replace("_", " ").split())
    return ALIASES.get(spelling, spelling)


def collect_apps(apps: Iterable[str], domain: str = "") -> frozenset[str]:
    """Return the applications that a recording names, normalised.

    The domain counts if it is an application (`"gimp"`), not if it is a subject (`"travel"`). The
    name of a platform (`"windows"`) is not an application.
    """
    names = {normalize_app(app) for app in apps if not _is_platform(app)} - NONE
    domain_app = normalize_app(domain)
    return frozenset(names | {domain_app} if domain_app in KNOWN else names)


def _is_platform(name: str) -> bool:
    """Return whether a name is that of a platform; `web` stands for a browser."""
    return normalize_app(name) != "browser" and find_platform(name) is not None


def is_mentioned(name: str, text: str, *, by_kind: bool = True) -> bool:
    """Return whether a text may mean an application.

    Letters of other scripts do not join words: a Chinese text around `GIMP` names it.

    Args:
        name: a normalised name.
        text: such as an instruction.
        by_kind: whether the name of a kind (`browser`) may mean each of its members.
    """
    meanings = {name, *(kind for kind, members in KINDS.items() if by_kind and name in members)}
    spellings = meanings.union(
        alias for alias, canonical in ALIASES.items() if canonical in meanings
    )
    words = "|".join(re.escape(word.replace("_", " ")) for word in sorted(spellings))
    haystack = text.lower().replace("_", " ").replace("-", " ")
    return re.search(rf"(?<![a-z0-9])(?:{words})(?![a-z0-9])", haystack) is not None


def mentioned_programs(text: str) -> frozenset[str]:
    """Return the known programs that a text may mean by their own names, normalised."""
    programs = KNOWN - KINDS.keys()
    return frozenset(name for name in programs if is_mentioned(name, text, by_kind=False))


def is_browser(name: str) -> bool:
    """Return whether a normalised name is that of a web browser, or the generic name."""
    return name == "browser" or name in KINDS["browser"]


def may_be_same(first: str, second: str) -> bool:
    """Return whether two normalised names may mean one program.

    They do if they are equal, or one is the kind of the other.

    Two browsers count as the same, because their windows look alike.
    """
    if first == second or (is_browser(first) and is_browser(second)):
        return True
    return second in KINDS.get(first, ()) or first in KINDS.get(second, ())
