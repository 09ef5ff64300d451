"""The interface of all desktops (design section 6)."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal, Protocol, TypeAlias, runtime_checkable

if TYPE_CHECKING:
    from hijack_data.types import Size, UInt8Array

Capability: TypeAlias = Literal["firewall", "lock", "windows", "apps", "accessibility", "files"]
CAPABILITIES: frozenset[Capability] = frozenset(
    {"firewall", "lock", "windows", "apps", "accessibility", "files"}
)
TaskConfig: TypeAlias = Mapping[str, Any]


@dataclass(frozen=True)
class RunResult:
    """The outcome of a command.

    Attributes:
        status: `"success"` or `"error"`.
        output: the text that it printed.
        error: the text that it printed as errors.
        returncode: `None` if it never ran or ended.
    """

    status: str
    output: str = ""
    error: str = ""
    returncode: int | None = None

    @property
    def ok(self) -> bool:
        """Whether the command ran and returned 0."""
        return self.status == "success" and self.returncode in (0, None)


@runtime_checkable
class Desktop(Protocol):
    """A desktop with one screen, one pointer and one user.

    All methods raise `DesktopError` (or a subclass) if the desktop does not answer.
    """

    @property
    def capabilities(self) -> frozenset[Capability]:
        """Capabilities of this desktop; asking for another raises `MissingCapabilityError`."""
        ...

    @property
    def size(self) -> "Size":
        """`(height, width)` of the screen in pixels."""
        ...

    def screenshot(self) -> "UInt8Array":
        """The screen with the pointer drawn: uint8 RGB `[H, W, 3]`."""
        ...

    def accessibility(self) -> str:
        """The accessibility tree in OSWorld's XML dialect, not older than the last screenshot."""
        ...

    def run(self, code: str) -> RunResult:
        """Run pyautogui `code` as the desktop's user."""
        ...

    def execute(self, argv: Sequence[str] | str, timeout: float = 60) -> RunResult:
        """Run a command as the desktop's user; a string goes to the shell.

        Args:
            argv: the command.
            timeout: in seconds.
        """
        ...

    def read_file(self, path: str) -> bytes:
        """The content of a file that the desktop's user may read."""
        ...

    def write_file(self, path: str, data: bytes) -> None:
        """Write a file as the desktop's user; its folder must exist."""
        ...

    def reset(self, task: TaskConfig | None = None) -> None:
        """Return to the pristine state; then carry out the `config` of `task`, if it has one."""
        ...

    def close(self) -> None:
        """End the desktop; closing twice is allowed."""
        ...
