"""What `hijack desktop install` does with images: find, read or build one."""

import os
import shutil
import tempfile
import urllib.error
import urllib.request
from collections.abc import Iterable
from http.client import HTTPException
from pathlib import Path

from hijack_data.file_io import unwritable

from ...errors import DesktopImageError
from .. import packages
from . import build, cache, manifest, sources
from .cache import Report

DEBIAN_12 = ("ID=debian", "VERSION_ID=12")
ANSWER_TIMEOUT_S = 60.0  # s for an answer
_BLOCK = 1 << 20


def prefers_packages(release: Path = Path("/etc/os-release")) -> bool:
    """Return whether desktops are made of the machine's own packages by default.

    They are for root on Debian 12: that takes a minute and less room, and it is the system that an
    image holds. Everywhere else an image is the only way, or the one without root.

    Args:
        release: what describes the machine's system (os-release(5)).
    """
    if os.geteuid() != 0 or not shutil.which("apt-get") or not release.is_file():
        return False
    lines = {line.replace('"', "") for line in release.read_text(encoding="utf-8").splitlines()}
    return lines.issuperset(DEBIAN_12)


def ensure_image(
    profiles: Iterable[str],
    source: str | None,
    archives: Iterable[sources.AptSource] | None,
    report: Report,
) -> str:
    """Have an image here, and return its name; one that is here already is taken.

    Args:
        profiles: that it must have, if none is `source`, beside those of the present one.
        source: the file of an image, its URL, or the name of one that is here.
        archives: to build from; without them those of the machine's apt configuration.
        report: called with a line of text at each step.

    Raises:
        DesktopImageError: The file is no image, or none can be built.
        StorageError: The disk is full.
    """
    if source is not None:
        return _resolve_source(source, report)
    images = cache.images()
    present = cache.names().get(cache.requested_name(None), "")
    installed = images[present].profiles if present else ()
    required = build.normal_profiles([*profiles, *installed])
    for name, image in cache.names().items():
        if set(required) <= set(images[image].profiles):
            return name
    recipe = build.Recipe(required, tuple(archives or _own_archives()))
    image_name, _ = build.build(recipe, None, report)
    return image_name


def lacking(profile: str) -> list[str]:
    """Return the packages of a profile that a desktop would lack if no image is named for it.

    Raises:
        DesktopImageError: The image that it would start from is missing.
        MissingPackageError: It would start from the machine's packages, which are not Debian's.
    """
    image = cache.find_image_folder(None)
    if image is None:
        return packages.missing(packages.PROFILES[profile])
    present = {part.name for part in manifest.read(image / manifest.NAME).packages}
    return [name for name in packages.PROFILES[profile] if name not in present]


def _own_archives() -> list[sources.AptSource]:
    try:
        return sources.from_machine()
    except DesktopImageError as error:
        raise DesktopImageError(
            f"{error}, or an image that was built elsewhere with --image FILE (or its URL)"
        ) from None


def _resolve_source(text: str, report: Report) -> str:
    if text.startswith(("http://", "https://")):
        return _fetched(text, report)
    path = Path(text)
    if path.is_file():
        image_name, _ = cache.import_file(path, None, report)
        return image_name
    if os.sep in text or text.endswith(".zst"):
        raise DesktopImageError(f"{text}: there is no such file")
    cache.resolve(text)
    return text


def _fetched(url: str, report: Report) -> str:
    """Fetch an image into a file without a name, which is gone however this process ends.

    Raises:
        DesktopImageError: The image cannot be fetched.
        HijackError: The folder of the images cannot be written.
    """
    folder = cache.ensure_images_folder()
    report(f"fetching {url}")
    with tempfile.TemporaryFile(dir=folder) as file:
        try:
            with urllib.request.urlopen(url, timeout=ANSWER_TIMEOUT_S) as answer:
                shutil.copyfileobj(answer, file, _BLOCK)
            file.flush()
        except ValueError as error:
            raise DesktopImageError(f"{url}: is no address ({error})") from None
        except urllib.error.URLError as error:
            raise DesktopImageError(
                f"{url}: cannot be fetched ({error.reason}); fetch it elsewhere, and give its file"
                " with --image FILE"
            ) from None
        except HTTPException as error:
            raise DesktopImageError(
                f"{url}: cannot be fetched ({error or type(error).__name__}); try again"
            ) from None
        except OSError as error:
            problem = unwritable(folder, error)
            raise problem from None
        path = Path(f"/proc/self/fd/{file.fileno()}")
        try:
            image_name, _ = cache.import_file(path, None, report)
        except DesktopImageError as error:
            raise DesktopImageError(str(error).replace(str(path), url)) from None
    return image_name
