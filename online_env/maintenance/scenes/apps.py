"""The applications that are recorded, and our own documents that they show."""

import io
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cache

from PIL import Image, ImageDraw

from hijack_data.drawing.text import load_font

from ...desktops.commands import home
from ...recording.stage import RecordingStage, TopWindow
from ..wallpapers import draw

NOTE = """Harbour walk, Saturday

09:30  ferry from Port Alder, quay 2
10:15  lighthouse, tickets at the door
12:00  lunch at the market hall
14:40  tram 6 back to the bridge

Bring: water, umbrella, the small camera
"""
PROGRAM = '''"""Tides of a week: when is the water high enough for the ferry?"""

from dataclasses import dataclass
from datetime import datetime, timedelta

PERIOD = timedelta(hours=12, minutes=25)


@dataclass(frozen=True)
class Tide:
    """One high tide and its height in metres."""

    at: datetime
    height: float


def tides(first: datetime, heights: list[float]) -> list[Tide]:
    """The tides that follow `first`, one for each height."""
    return [Tide(first + n * PERIOD, h) for n, h in enumerate(heights)]


def sails(tide: Tide, draught: float = 2.1) -> bool:
    """Whether a ferry of that draught can leave the quay."""
    return tide.height > draught + 0.3


if __name__ == "__main__":
    for tide in tides(datetime(2026, 3, 4, 6, 10), [2.9, 2.2, 3.1, 2.6]):
        print(f"{tide.at:%a %H:%M}  {tide.height:.1f} m  {'sails' if sails(tide) else 'stays'}")
'''
_OFFICE = (
    '<?xml version="1.0" encoding="UTF-8"?><office:document office:version="1.2"'
    ' office:mimetype="{mime}"'
    ' xmlns:office="urn:oasis:names:tc:opendocument:xmlns:office:1.0"'
    ' xmlns:text="urn:oasis:names:tc:opendocument:xmlns:text:1.0"'
    ' xmlns:table="urn:oasis:names:tc:opendocument:xmlns:table:1.0"'
    ' xmlns:draw="urn:oasis:names:tc:opendocument:xmlns:drawing:1.0"'
    ' xmlns:svg="urn:oasis:names:tc:opendocument:xmlns:svg-compatible:1.0"><office:body>'
    "{body}</office:body></office:document>"
)
_MIME = "application/vnd.oasis.opendocument."
_ROWS = (
    ("Month", "Passengers", "Bicycles", "Income"),
    ("January", 4120, 310, 18540),
    ("February", 3980, 295, 17910),
    ("March", 5240, 520, 23580),
    ("April", 6875, 840, 30940),
    ("May", 8210, 1190, 36945),
    ("June", 9450, 1460, 42525),
)


def _note_lines() -> list[str]:
    return [line for line in NOTE.splitlines() if line]


def _letter() -> str:
    head, *lines = _note_lines()
    body = "".join(f"<text:p>{line}</text:p>" for line in lines)
    heading = f'<text:h text:outline-level="1">{head}</text:h>'
    return _OFFICE.format(mime=f"{_MIME}text", body=f"<office:text>{heading}{body}</office:text>")


def _cell(value: object) -> str:
    kind = 'office:value-type="string"'
    if isinstance(value, int):
        kind = f'office:value-type="float" office:value="{value}"'
    return f"<table:table-cell {kind}><text:p>{value}</text:p></table:table-cell>"


def _table() -> str:
    rows = ""
    for row in _ROWS:
        cells = "".join(map(_cell, row))
        rows += f"<table:table-row>{cells}</table:table-row>"
    sheet = (
        "<office:spreadsheet><table:table"
        f' table:name="Ferry">{rows}</table:table></office:spreadsheet>'
    )
    return _OFFICE.format(mime=f"{_MIME}spreadsheet", body=sheet)


def _slide() -> str:
    frames = ""
    for number, line in enumerate(_note_lines()):
        frame_box = f'svg:x="3cm" svg:y="{3 + 2 * number}cm" svg:width="20cm" svg:height="2cm"'
        text = f"<draw:text-box><text:p>{line}</text:p></draw:text-box>"
        frames += f"<draw:frame {frame_box}>{text}</draw:frame>"
    page = (
        "<office:presentation><draw:page"
        f' draw:name="walk">{frames}</draw:page></office:presentation>'
    )
    return _OFFICE.format(mime=f"{_MIME}presentation", body=page)


FILES: Mapping[str, str] = {
    "Documents/harbour-walk.txt": NOTE,
    "Documents/tides.py": PROGRAM,
    "Documents/harbour-walk.fodt": _letter(),
    "Documents/ferry.fods": _table(),
    "Documents/shopping.txt": "milk\ntea\n3 x bread\n",
    "Documents/garden.txt": "Sow beans in April.\n",
    "Downloads/harbour.fodp": _slide(),
}


def _encoded(picture: Image.Image, kind: str) -> bytes:
    buffer = io.BytesIO()
    picture.save(buffer, kind)
    return buffer.getvalue()


def _photo() -> bytes:
    picture = Image.fromarray(draw("dunes")[740:1820, 960:2880])
    return _encoded(picture.resize((960, 540)), "PNG")


def _timetable() -> bytes:
    """Return a page with a heading and rows, as PDF."""
    page = Image.new("RGB", (595, 842), "white")
    pen = ImageDraw.Draw(page)
    pen.text((60, 60), "Ferry timetable", "#123a5a", load_font("DejaVuSans", 28))
    small = load_font("DejaVuSans", 15)
    for number, line in enumerate(NOTE.splitlines()[2:6]):
        y = 130 + 34 * number
        pen.text((60, y), line, "black", small)
        pen.line((60, y + 26, 535, y + 26), "#b0b8c0")
    return _encoded(page, "PDF")


_PICTURES: Mapping[str, Callable[[], bytes]] = {
    "Pictures/dunes.png": cache(_photo),
    "Downloads/timetable.pdf": cache(_timetable),
}


_PROCESSES = {"google-chrome": "chrome", "libreoffice": "soffice.bin", "gimp": "gimp-2.10"}


@dataclass(frozen=True)
class App:
    """An application with something of ours open.

    Args:
        name: The name in the pack's entries: the paper's, or its program's.
        argv: The command line; `~` is the user's home.
        class_part: A part of the class of its windows.
        shows: What it shows, for people.
        start_timeout: Seconds that its first start may take.
        before: Shell commands that are run first.
    """

    name: str
    argv: tuple[str, ...]
    class_part: str
    shows: str
    start_timeout: float = 60.0
    before: tuple[str, ...] = field(default=())

    @property
    def process(self) -> str:
        """The name of its process."""
        return _PROCESSES.get(self.program, self.program)

    @property
    def program(self) -> str:
        """The program that must be installed."""
        return self.argv[0]

    def open(self, stage: RecordingStage) -> TopWindow:
        """Start it; return its window once all of it is drawn."""
        folder = home(stage.desktop)
        for command in self.before:
            stage.desktop.execute(command)
        argv = [word.replace("~", folder) for word in self.argv]
        return stage.open(*argv, class_part=self.class_part, timeout=self.start_timeout)


_QUIET = ("--norestore", "--nologo")
_TERMINAL = "ls -l --color=never Documents; wc -l Documents/*.txt; exec bash"


def browser(address: str) -> App:
    """Return Chromium on one of our own sites, in a window of its own."""
    return App("chromium", ("google-chrome", "--new-window", address), "chrom", address)


APPS: tuple[App, ...] = (
    App("geany", ("geany", "--new-instance", "~/Documents/tides.py"), "geany", "a Python file"),
    App("mousepad", ("mousepad", "~/Documents/harbour-walk.txt"), "mousepad", "a note"),
    App("thunar", ("thunar", "~/Documents"), "thunar", "the folder Documents"),
    App(
        "xfce4-terminal",
        ("xfce4-terminal", "--disable-server", "-x", "bash", "-c", _TERMINAL),
        "terminal",
        "two commands",
    ),
    browser("http://news.test/"),
    App(
        "libreoffice_writer",
        ("libreoffice", "--writer", *_QUIET, "~/Documents/harbour-walk.fodt"),
        "libreoffice",
        "a letter",
        90.0,
    ),
    App(
        "libreoffice_calc",
        ("libreoffice", "--calc", *_QUIET, "~/Documents/ferry.fods"),
        "libreoffice",
        "a table",
        90.0,
    ),
    App("vlc", ("vlc", "--no-video-title-show", "--no-qt-privacy-ask"), "vlc", "an empty list"),
    App("gimp", ("gimp", "--no-splash"), "gimp", "no picture", 120.0),
)

# Recorded in other looks than the golden one, where they are installed.
MORE_APPS: tuple[App, ...] = (
    App("ristretto", ("ristretto", "~/Pictures/dunes.png"), "ristretto", "a picture"),
    App("evince", ("evince", "~/Downloads/timetable.pdf"), "evince", "a page"),
    App("xfce4-settings-manager", ("xfce4-settings-manager",), "settings", "all settings"),
    App("xfce4-appfinder", ("xfce4-appfinder",), "appfinder", "all applications"),
    App(
        "libreoffice_impress",
        ("libreoffice", "--impress", *_QUIET, "~/Downloads/harbour.fodp"),
        "libreoffice",
        "a slide",
        90.0,
    ),
)


def put_files(stage: RecordingStage) -> None:
    """Write our documents into the desktop's home."""
    folder = home(stage.desktop)
    for name, content in FILES.items():
        stage.desktop.write_file(f"{folder}/{name}", content.encode())
    for name, image in _PICTURES.items():
        stage.desktop.write_file(f"{folder}/{name}", image())


def installed(stage: RecordingStage, apps: tuple[App, ...]) -> list[App]:
    """Return those of `apps` that the desktop has."""
    programs = stage.guest.installed(*(app.program for app in apps))
    return [app for app in apps if app.program in programs]
