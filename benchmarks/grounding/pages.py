"""Render pages with Chromium as PNG and JSON: the seeded ones and the local web sites."""

import hashlib
import json
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from . import browser, markup
from .browser import Browser

SIZE, DENSITY = (600, 960), 1.5  # height and width of the pictures; pixels a CSS pixel
HOSTS = {
    "docs.test": "train",
    "mail.test": "train",
    "search.test": "train",
    "wiki.test": "train",
    "news.test": "train",
    "shop.test": "site",
    "forms.test": "site",
}
MOST = 16  # pages of one of the local sites
SITES = Path(__file__).resolve().parents[2] / "online_env" / "embedded" / "sites"
# Visible controls that lie wholly in the window, answer at their middle and have a name that no
# other control has.
CONTROLS = """(density => {
  const clean = text => (text || '').replace(/\\s+/g, ' ').trim();
  const found = [...document.querySelectorAll('a, button, input, select, textarea')].map(e => {
    const r = e.getBoundingClientRect(), box = [r.left, r.top, r.right, r.bottom].map(v => Math.round(v * density));
    const at = document.elementFromPoint((r.left + r.right) / 2, (r.top + r.bottom) / 2);
    const seen = r.width > 0 && r.right > 0 && r.bottom > 0 && r.left < innerWidth && r.top < innerHeight;
    const inside = r.left >= 0 && r.top >= 0 && r.right <= innerWidth && r.bottom <= innerHeight;
    const label = e.labels && e.labels[0] ? e.labels[0].innerText : e.getAttribute('aria-label') || e.innerText;
    const shown = inside && r.width >= 12 && r.height >= 12 && at && (e === at || e.contains(at));
    return {label: clean(label), box, shown: !!shown, seen, kind: e.tagName.toLowerCase()};
  });
  const times = {};
  for (const f of found) if (f.seen) times[f.label] = (times[f.label] || 0) + 1;
  return found.filter(f => f.shown && f.label && f.label.length <= 40)
    .map(f => ({label: f.label, box: f.box, kind: f.kind, unique: times[f.label] === 1}));
})"""
LINKS = """[...document.querySelectorAll('a[href]')].map(a => a.href.split('#')[0])
  .filter(u => new URL(u).host === location.host)"""


@dataclass(frozen=True)
class Page:
    """A rendered page.

    Args:
        name: names it; no two pages share one.
        split: `train`, `new` (other seeds) or `site` (sites that are not trained on).
        image: uint8 `[H, W, 3]`.
        boxes: int32 `[N, 4]`, `xyxy`: all controls that show.
        labels: the label of each control.
        asked: which of them have a label of their own, so that one may be asked for it.
    """

    name: str
    split: str
    image: np.ndarray
    boxes: np.ndarray
    labels: tuple[str, ...]
    asked: tuple[int, ...]


def fingerprint(train: int, new: int, sites: bool = True) -> str:
    """What a folder of pages was made by: another one means rendering anew."""
    if shutil.which("chromium") is None:
        raise browser.BrowserError(
            "there is no chromium on the PATH, which renders the pages: apt-get install chromium"
        )
    requests = subprocess.run(["chromium", "--version"], capture_output=True, text=True, check=True)
    parts = [requests.stdout.split("built")[0].encode(), str((train, new, sites)).encode()]
    files = [Path(m.__file__ or "") for m in (browser, markup, sys.modules[__name__])]
    files += sorted(
        path for path in SITES.rglob("*") if path.is_file() and "__pycache__" not in path.parts
    )
    return hashlib.sha256(b"\0".join([*parts, *(path.read_bytes() for path in files)])).hexdigest()


def render(folder: Path, train: int, new: int, sites: bool = True) -> None:
    """Render `train` + `new` seeded pages and the local sites, unless `folder` has just these.

    Raises `FileExistsError` where the folder holds something else.
    """
    made_by = fingerprint(train, new, sites)
    index = folder / "pages.json"
    if index.exists() and json.loads(index.read_text())["made_by"] == made_by:
        return
    _clear(folder, index)
    rows: list[dict[str, Any]] = []
    with tempfile.TemporaryDirectory() as scratch, _sites(Path(scratch) / "state") as port:
        rules = f"MAP *.test 127.0.0.1:{port}"
        window = (round(SIZE[0] / DENSITY), round(SIZE[1] / DENSITY))
        with Browser(Path(scratch) / "profile", window, DENSITY, rules) as chromium:
            for seed in range(train + new):
                chromium.show(markup.write(seed))
                rows += _keep(
                    chromium, folder, f"seed-{seed:04d}", "train" if seed < train else "new"
                )
            for host, split in HOSTS.items() if sites else ():
                rows += _site(chromium, folder, host, split)
    index.write_text(json.dumps({"made_by": made_by, "pages": rows}, indent=1))


def _clear(folder: Path, index: Path) -> None:
    """Make the folder, or remove the pages of another time; what is not ours is never touched."""
    if folder.exists() and any(folder.iterdir()) and not index.exists():
        raise FileExistsError(
            f"{folder} holds something else than pages; name an empty folder, or one that is not"
            " there"
        )
    folder.mkdir(parents=True, exist_ok=True)
    index.write_text(json.dumps({"made_by": "not finished", "pages": []}))
    for picture in folder.glob("*.png"):
        picture.unlink()


def _keep(chromium: Browser, folder: Path, name: str, split: str) -> list[dict[str, Any]]:
    """Store what the window shows; nothing where there is nothing to ask for."""
    controls = chromium.value(f"{CONTROLS}({DENSITY})")
    if not any(c["unique"] for c in controls):
        return []
    picture = chromium.picture()
    if picture.shape != (*SIZE, 3):
        raise browser.BrowserError(f"{name}: the picture is {picture.shape}, not {(*SIZE, 3)}")
    Image.fromarray(picture).save(folder / f"{name}.png", compress_level=1)
    return [{"name": name, "split": split, "controls": controls}]


def _site(chromium: Browser, folder: Path, host: str, split: str) -> list[dict[str, Any]]:
    """Follow a site's links from its front page and store the upper screen of its first pages."""
    waiting = [f"http://{host}/"]
    calls = set[str]()
    rows = []
    while waiting and len(rows) < MOST:
        if (url := waiting.pop(0)) not in calls:
            calls.add(url)
            chromium.open(url)
            waiting += chromium.value(LINKS)
            rows += _keep(chromium, folder, f"{host}-{len(rows):02d}", split)
    return rows


@contextmanager
def _sites(state: Path) -> Iterator[int]:
    """Serve the local web sites on loopback; gives the port."""
    ports = ("--dns-port", "0", "--http-port", "0", "--state", str(state))
    command = [sys.executable, "-m", "online_env.embedded.sites", "--address", "127.0.0.1", *ports]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, cwd=SITES.parents[2])
    assert process.stdout is not None
    try:
        line = process.stdout.readline()
        if not line:
            raise RuntimeError(
                "the local web sites do not start; try: python -m online_env.embedded.sites --help"
            )
        yield json.loads(line)["http"]
    finally:
        process.terminate()
        process.wait()
        process.stdout.close()


def load(folder: Path) -> list[Page]:
    """Read the pages of a folder."""
    return [_page(folder, row) for row in json.loads((folder / "pages.json").read_text())["pages"]]


def _page(folder: Path, row: dict[str, Any]) -> Page:
    image = np.asarray(Image.open(folder / f"{row['name']}.png").convert("RGB"))
    boxes = np.array([c["box"] for c in row["controls"]], np.int32).reshape(-1, 4)
    requests = tuple(i for i, c in enumerate(row["controls"]) if c["unique"])
    return Page(
        row["name"],
        row["split"],
        image,
        boxes,
        tuple(c["label"] for c in row["controls"]),
        requests,
    )
