"""The golden layer: what every pristine desktop adds to the machine's own files.

Two folders that go over the machine's files inside a desktop, so the machine itself is not changed:
`system` over `/` (pictures drawn here, defaults of applications) and `home`, the golden home of the
desktop's user. The layer's name carries a digest of its sources, so that an old one is never used.
"""

import hashlib
import os
import shutil
import tempfile
from collections.abc import Iterator
from pathlib import Path

from . import default_pictures
from .runtime.account import UID
from .runtime.hidden_folders import LAYERS

SOURCES = Path(__file__).resolve().parent
FOLDERS = (
    "Desktop",
    "Documents",
    "Downloads",
    "Music",
    "Pictures",
    "Public",
    "Templates",
    "Videos",
)
BACKGROUNDS = Path("usr/share/backgrounds/desktop")
# Chromium as OSWorld's tasks call it, in the menu and as what opens links.
BROWSER_ENTRY = """[Desktop Entry]
Version=1.0
Type=Application
Name=Chromium
GenericName=Web Browser
Icon=chromium
Exec=google-chrome %U
StartupWMClass=chromium
Categories=Network;WebBrowser;
MimeType=text/html;x-scheme-handler/http;x-scheme-handler/https;
"""


def layer_path(parent: Path = LAYERS) -> Path:
    """Return the path of the layer made from the present sources, whether it is there or not."""
    return parent / f"layer-{_digest()}"


def ensure_layer(parent: Path = LAYERS) -> Path:
    """Return the golden layer, built now if it is not there (about 1 s).

    Several processes may ask at once.

    Raises:
        OSError: It cannot be written.
    """
    final = layer_path(parent)
    if final.is_dir():
        return final
    parent.mkdir(parents=True, exist_ok=True)
    fresh = Path(tempfile.mkdtemp(prefix="building-", dir=parent))
    try:
        _fill(fresh)
        fresh.rename(final)
    except OSError:
        if not final.is_dir():  # else another process was quicker
            raise
    finally:
        shutil.rmtree(fresh, ignore_errors=True)
    return final


def remove_old_layers(parent: Path = LAYERS) -> None:
    """Remove layers of other versions; call it only while no desktop runs."""
    for path in (*parent.glob("layer-*"), *parent.glob("building-*")):
        if path != layer_path(parent):
            shutil.rmtree(path, ignore_errors=True)


def _fill(layer: Path) -> None:
    layer.chmod(0o755)
    system = layer / "system"
    home = layer / "home"
    shutil.copytree(SOURCES / "system", system)
    shutil.copytree(SOURCES / "home", home)
    for name in FOLDERS:
        (home / name).mkdir()
    backgrounds = system / BACKGROUNDS
    backgrounds.mkdir(parents=True)
    picture = default_pictures.wallpaper()
    picture.save(backgrounds / "wallpaper.png")
    default_pictures.lock_picture(picture).save(backgrounds / "lock.png")
    default_pictures.face().save(home / ".face", "png")
    entry = system / "usr/share/applications/google-chrome.desktop"
    entry.parent.mkdir(parents=True, exist_ok=True)
    entry.write_text(BROWSER_ENTRY, encoding="utf-8")
    _set_owners(layer, home)


def _set_owners(layer: Path, home: Path) -> None:
    # A clone made under a strict umask must not give a desktop whose files its user cannot read.
    for path in layer.rglob("*"):
        path.chmod(0o755 if path.is_dir() else 0o644)
    # else the caller is the desktop's user
    for path in (home, *home.rglob("*")) if os.geteuid() == 0 else ():
        os.chown(path, UID, UID)


def _digest() -> str:
    hasher = hashlib.blake2b(digest_size=6)
    for path in _sources():
        hasher.update(f"{path.relative_to(SOURCES)}\0".encode())
        hasher.update(path.read_bytes())
    return hasher.hexdigest()


def _sources() -> Iterator[Path]:
    yield from (SOURCES / name for name in ("runtime/account.py", "home.py", "default_pictures.py"))
    for folder in ("home", "system"):
        yield from sorted(path for path in (SOURCES / folder).rglob("*") if path.is_file())
