"""The applications of the paper's list: their commands in a guest, and their windows' WM_CLASS."""

from dataclasses import dataclass

_QUIET_OFFICE = ("--norestore", "--nologo")


@dataclass(frozen=True)
class Command:
    """One way to start an application.

    Args:
        argv: the program and its arguments.
        classes: lower-case parts of the WM_CLASS of its windows.
        stand_in: a description of the program, if it is only a replacement for the application.
    """

    argv: tuple[str, ...]
    classes: tuple[str, ...]
    stand_in: str = ""


def _office(part: str) -> tuple[Command, ...]:
    classes = (f"libreoffice-{part}",)
    return tuple(
        Command((program, f"--{part}", *_QUIET_OFFICE), classes)
        for program in ("libreoffice", "soffice")
    )


_CHROME = ("google-chrome", "google-chrome-stable", "chromium", "chromium-browser")
COMMANDS: dict[str, tuple[Command, ...]] = {
    "vscode": (
        Command(("code",), ("code",)),
        Command(("codium",), ("codium",)),
        Command(
            ("geany", "--new-instance"),
            ("geany",),
            "Geany, another code editor, in the place of VS Code",
        ),
    ),
    "chrome": tuple(Command((program, "--new-window"), ("chrom",)) for program in _CHROME),
    "gimp": (Command(("gimp", "--no-splash"), ("gimp",)),),
    "libreoffice_calc": _office("calc"),
    "libreoffice_impress": _office("impress"),
    "libreoffice_writer": _office("writer"),
    "vlc": (Command(("vlc", "--no-video-title-show"), ("vlc",)),),
    "thunderbird": (Command(("thunderbird",), ("thunderbird", "mail.")),),
}
# Not in the paper's list: for guests without any application of the list, and only if none of these
# has an open window.
FALLBACKS: dict[str, tuple[Command, ...]] = {
    name: (Command((name,), (name,), f"{name}, since nothing of the paper's list is installed"),)
    for name in ("mousepad", "thunar", "xfce4-terminal", "gedit", "nautilus", "gnome-terminal")
}
