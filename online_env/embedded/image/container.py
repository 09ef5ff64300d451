"""An image of the desktop as an image for containers: a file for `docker load` or `podman load`.

Two layers: the system, and what a desktop lays over it, with the guest server and the golden home.
Of our code it holds the modules that process 1 loads and nothing else: neither tasks nor how they
are judged. The same image and version give the same bytes.
"""

import contextlib
import hashlib
import io
import json
import os
import subprocess
import sys
import tarfile
import tempfile
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

from hijack_data.file_io import replace_atomic

from ...errors import DesktopImageError
from .. import home
from ..container.control import CONTROL_PORT
from ..container.entry import GUEST_PORT, SERVER
from ..runtime import image_python, root_file_system
from ..runtime.desktop_config import DesktopConfig
from ..runtime.identity import Identity
from . import cache, file_entries, manifest

REPOSITORY = "agenthijack-desktop"
# The engine's own, by mounts.
_ENGINES = ("etc/resolv.conf", "etc/hosts", "etc/hostname")
_PATHS = (f"{SERVER}/code", f"{SERVER}/guest", image_python.SEARCH_PATH[-1])
_START = (
    f"import sys; sys.path[:0] = {list(_PATHS)}; from online_env.embedded.container.entry import"
    " main; sys.exit(main())"
)
# In a container no program may make namespaces, so Chromium's sandbox cannot start.
_CHROMIUM = 'CHROMIUM_FLAGS="$CHROMIUM_FLAGS --no-sandbox --test-type --disable-dev-shm-usage"\n'
_MODULES = (
    "import sys; sys.path[:0] = sys.argv[1:]; from online_env.embedded.container import entry;"
    " entry._load(); print(*sorted(sys.modules), sep='\\n')"
)
_CODE = Path(__file__).resolve().parents[3]
_CHROME = f"{root_file_system.LOCAL_BIN}/chrome"


def write(image: Path, path: Path) -> str:
    """Write the image in the folder `image` to the file `path`, for a container engine.

    Returns:
        The name that the engine gives it.

    Raises:
        DesktopImageError: A file of the image is not as its manifest says.
        StorageError: The disk is full.
    """
    image_manifest = manifest.read(image / manifest.NAME)
    name = f"{REPOSITORY}:{cache.default_name(image_manifest.profiles)}"

    def pack(temporary: Path) -> None:
        with (
            tempfile.TemporaryDirectory(dir=path.parent, prefix=".layers-") as folder,
            tarfile.open(temporary, "w", format=tarfile.PAX_FORMAT) as tar,
        ):
            layers = [Path(folder, f"{number}.tar") for number in (0, 1)]
            _system(image, layers[0])
            _desktop(image, layers[1])
            digests = [file_entries.digest(layer) for layer in layers]
            config = json.dumps(_config(image_manifest.architecture, digests)).encode()
            config_name = f"{hashlib.sha256(config).hexdigest()}.json"
            names = [f"{digest}.tar" for digest in digests]
            about = [{"Config": config_name, "RepoTags": [name], "Layers": names}]
            _add_bytes(tar, "manifest.json", json.dumps(about).encode())
            _add_bytes(tar, config_name, config)
            for layer, layer_name in zip(layers, names, strict=True):
                _add_file(tar, layer_name, layer)

    replace_atomic(path, pack)
    return name


def _config(architecture: str, digests: list[str]) -> dict[str, Any]:
    """Return the configuration (OCI image specification)."""
    ports = {f"{port}/tcp": {} for port in (GUEST_PORT, CONTROL_PORT)}
    return {
        "architecture": architecture,
        "os": "linux",
        "created": "2023-11-14T22:13:20Z",  # file_entries.EPOCH
        "config": {
            "Entrypoint": [image_python.PYTHON, "-I", "-S", "-B", "-c", _START],
            "Env": ["PATH=/usr/sbin:/usr/bin:/sbin:/bin", "LANG=C.UTF-8", "OPENBLAS_NUM_THREADS=1"],
            "ExposedPorts": ports,
            "WorkingDir": "/",
        },
        "rootfs": {"type": "layers", "diff_ids": [f"sha256:{digest}" for digest in digests]},
    }


@contextlib.contextmanager
def _layer(path: Path) -> Iterator[tarfile.TarFile]:
    with tarfile.open(path, "w", format=tarfile.PAX_FORMAT) as tar:
        yield tar


def _system(image: Path, path: Path) -> None:
    """The system of an image, and Chromium once more under the name that tasks end it by."""
    listed = (image / manifest.FILES).read_text(encoding="utf-8")
    begin = f"{cache.ROOT}/"
    with _layer(path) as tar:
        for entry in file_entries.parse(listed, str(image)):
            name = entry.path.removeprefix(begin)
            if entry.path.startswith(begin):
                _add_entry(tar, name, image / entry.path, entry)
        browser = f"{root_file_system.CHROMIUM}/chromium"
        if not (image / begin / browser).is_file():
            return
        folder = Path()
        for part in Path(_CHROME).parts:
            folder /= part
            if not (image / begin / folder).exists():
                tar.addfile(_info(str(folder), tarfile.DIRTYPE))
        info = _info(f"{_CHROME}/chrome", tarfile.LNKTYPE)
        info.linkname = browser
        tar.addfile(info)


def _add_entry(tar: tarfile.TarFile, name: str, path: Path, entry: file_entries.Entry) -> None:
    kinds = {"folder": tarfile.DIRTYPE, "link": tarfile.SYMTYPE, "file": tarfile.REGTYPE}
    info = _info(name, kinds[entry.kind], entry.mode, entry.time)
    if entry.kind == "link":
        info.linkname = entry.content
    if entry.kind != "file":
        tar.addfile(info)
        return
    data = path.read_bytes()
    if hashlib.sha256(data).hexdigest() != entry.content:
        raise DesktopImageError(
            f"{path}: is not as the image's manifest says; build or import it again"
        )
    info.size = len(data)
    tar.addfile(info, io.BytesIO(data))


def _info(name: str, kind: bytes, mode: int = 0o755, time: int = 0) -> tarfile.TarInfo:
    info = tarfile.TarInfo(name)
    info.type = kind
    info.mode = mode
    info.mtime = time or file_entries.EPOCH
    return info


def _add_bytes(tar: tarfile.TarFile, name: str, data: bytes, mode: int = 0o644) -> None:
    info = _info(name, tarfile.REGTYPE, mode)
    info.size = len(data)
    tar.addfile(info, io.BytesIO(data))


def _add_file(tar: tarfile.TarFile, name: str, path: Path) -> None:
    info = _info(name, tarfile.REGTYPE, 0o644)
    info.size = path.stat().st_size
    with open(path, "rb") as file:
        tar.addfile(info, file)


def _desktop(image: Path, path: Path) -> None:
    """What a desktop lays over the system, the guest server, and the golden home."""
    layer = home.ensure_layer()
    order = DesktopConfig(
        name=None, screen=(0, 0), layer=str(layer), search_path=(), python="", image=str(image)
    )
    server = SERVER.lstrip("/")
    with tempfile.TemporaryDirectory(prefix="agenthijack-layer-") as folder, _layer(path) as tar:
        upper = Path(folder)
        root_file_system.fill_upper(upper, order, Identity(-1, 0, True))
        (upper / "etc/chromium.d").mkdir(parents=True, exist_ok=True)
        (upper / "etc/chromium.d/zz-container").write_text(_CHROMIUM, encoding="ascii")
        for name in (*_ENGINES, f"{_CHROME}/chrome"):
            (upper / name).unlink(missing_ok=True)
        _add_tree(tar, upper, "")
        # Nobody but root, who may read what is in any container.
        tar.addfile(_info(server, tarfile.DIRTYPE, 0o700))
        for name, source in (("layer/home", layer / "home"), ("guest", image / cache.GUEST)):
            _add_parents(tar, f"{server}/{name}", server)
            _add_tree(tar, source, f"{server}/{name}")
        _add_code(tar, f"{server}/code")


def _add_parents(tar: tarfile.TarFile, name: str, top: str) -> None:
    folder = Path(top)
    for part in Path(name).relative_to(top).parts:
        folder /= part
        tar.addfile(_info(str(folder), tarfile.DIRTYPE))


def _add_tree(tar: tarfile.TarFile, top: Path, name: str) -> None:
    for path in file_entries.walk(top):
        entry = replace(file_entries.read_entry(path, top), time=file_entries.EPOCH)
        member = f"{name}/{entry.path}".lstrip("/")
        _add_entry(tar, member, path, entry)


def _add_code(tar: tarfile.TarFile, name: str) -> None:
    """Our modules that a guest server loads, and no others."""
    tar.addfile(_info(name, tarfile.DIRTYPE))
    folders: set[Path] = set()
    for path in _modules():
        short = path.relative_to(_CODE)
        for folder in reversed(short.parents[:-1]):
            if folder not in folders:
                folders.add(folder)
                tar.addfile(_info(f"{name}/{folder}", tarfile.DIRTYPE))
        _add_bytes(tar, f"{name}/{short}", path.read_bytes())


def _modules() -> list[Path]:
    """Return the files of our modules that process 1 of a container loads.

    Raises:
        DesktopImageError: The guest server cannot be loaded.
    """
    command = [sys.executable, "-I", "-c", _MODULES, str(_CODE), *filter(os.path.isdir, sys.path)]
    process = subprocess.run(command, capture_output=True, text=True, check=False)
    if process.returncode != 0:
        raise DesktopImageError(
            f"the guest server cannot be loaded: {process.stderr.strip()[-500:]}"
        )
    paths: list[Path] = []
    for module in process.stdout.split():
        if module.partition(".")[0] in image_python.PACKAGES:
            path = _CODE.joinpath(*module.split("."))
            is_package = (path / "__init__.py").is_file()
            paths.append(path / "__init__.py" if is_package else path.with_suffix(".py"))
    return paths
