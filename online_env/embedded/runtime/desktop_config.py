"""The configuration of a desktop and the error of its setup, for the controller and the processes.

The module imports little: the first process of a desktop must not wait for NumPy.
"""

import json
from dataclasses import asdict, dataclass, field


class SetupError(Exception):
    """A desktop that cannot be built; the controller turns it into a `DesktopError`."""


@dataclass(frozen=True, kw_only=True)
class DesktopConfig:
    """The order for a desktop.

    Attributes:
        name: of the desktop; `None` for the next free one.
        screen: (width, height) in pixels.
        layer: the golden layer.
        search_path: the controller's `sys.path`.
        python: the controller's interpreter.
        hidden: paths of the machine's that the desktop must not show.
        apps: started before the desktop counts as ready.
        osworld: open OSWorld's routes without a token and let sudo work without a password.
        rootless: whether the controller is not root.
        controller: the process that the desktop ends with, as `(pid, start)`; `None` if it stays.
        time_out: seconds until the desktop counts as failed.
        storage: bytes of its files.
        processes: how many there may be.
        memory: bytes of one process, and of the desktop beside its files.
        environment: variables for the programs of its session.
        image: the folder of the image that it starts from; empty for the machine's own packages.
    """

    name: str | None
    screen: tuple[int, int]
    layer: str
    search_path: tuple[str, ...]
    python: str
    hidden: tuple[str, ...] = ()
    apps: tuple[str, ...] = ()
    osworld: bool = False
    rootless: bool = False
    controller: tuple[int, int] | None = None
    time_out: float = 60.0
    storage: int = 2 << 30
    processes: int = 2048
    memory: int = 4 << 30
    environment: dict[str, str] = field(default_factory=dict)
    image: str = ""

    @property
    def system(self) -> str:
        """The root of the system folders that the desktop is laid over."""
        return f"{self.image}/root" if self.image else "/"

    def to_json(self) -> str:
        """One line of JSON."""
        return json.dumps(asdict(self))

    @classmethod
    def from_json(cls, text: str) -> "DesktopConfig":
        """Return the order that `to_json` wrote."""
        raw = json.loads(text)
        for name in ("screen", "search_path", "hidden", "apps"):
            raw[name] = tuple(raw[name])
        raw["controller"] = tuple(raw["controller"]) if raw["controller"] else None
        return cls(**raw)
