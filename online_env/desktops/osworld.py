"""Any environment with OSWorld's interface, as a `Desktop`.

Only methods and attributes are used; `desktop_env` is never imported.
"""

import base64
import io
import json
from collections.abc import Sequence
from typing import Any, Protocol, cast

import numpy as np
from PIL import Image, UnidentifiedImageError

from hijack_data.types import Size, UInt8Array

from ..errors import DesktopError, GuestError, MissingCapabilityError
from .capability_survey import survey
from .protocol import Capability, RunResult, TaskConfig

# An argument of a command has at most 128 KiB on Linux, and base64 turns three bytes into four.
CHUNK_BYTES = 64 * 1024
MAX_OUTPUT_BYTES = 2 * 2**20
CAP_NOTE = "\n[output cut: more than 2 MiB]"
_MARK = "agenthijack-result:"
# Output goes to files, not to pipes, so that background processes of the command do not block the
# answer.
_RUN = """
import json, os, signal, subprocess, tempfile
def read(f):
    f.seek(0)
    b = f.read({cap!r} + 1)
    end = {note!r}.encode() if len(b) > {cap!r} else b""
    return (b[:{cap!r}] + end).decode("utf-8", "replace")
with tempfile.TemporaryFile() as o, tempfile.TemporaryFile() as e:
    try:
        kept = dict(stdin=subprocess.DEVNULL, stdout=o, stderr=e, start_new_session=True)
        p = subprocess.Popen({command!r}, shell={shell!r}, **kept)
        a = [p.wait({timeout!r}), read(o), read(e)]
    except subprocess.TimeoutExpired:
        os.killpg(p.pid, signal.SIGKILL)
        a = [None, "", "Command timed out after {timeout:g} seconds"]
    except OSError as x:
        a = [None, "", str(x)]
print({mark!r} + json.dumps(a))
"""
# The guest's `python -c` imports from its home first, and a file named json.py there must not break
# our code.
_ISOLATED = "import os; os.execv('/usr/bin/python3', ['/usr/bin/python3', '-I', '-c', {code!r}])"
# A piece goes to its own place: OSWorld's client sends a command again if its answer was lost.
_WRITE = (
    "import base64; f = open({path!r}, {mode!r}); f.seek({start});"
    " f.write(base64.b64decode({data!r})); f.close()"
)
_READABLE = (
    "print({mark!r} + str(__import__('os').access({path!r}, 4) and"
    " __import__('os').path.isfile({path!r})))"
)


class OsworldLike(Protocol):
    """The methods and attributes that an environment must have.

    `reset` takes `task_config`, or the task as its only argument.
    """

    controller: Any
    action_history: list[Any]

    def reset(self, task_config: Any = None) -> Any:
        """Pristine, with the task set up."""
        ...

    def step(self, action: Any, pause: float = 2) -> Any:
        """One action of the agent."""
        ...

    def evaluate(self) -> float:
        """The task's score."""
        ...


class OsworldDesktop:
    """A `Desktop` over `env.controller`; its actions never appear in `env.action_history`.

    Args:
        env: the environment, such as `desktop_env.DesktopEnv`.
        password: of the guest's user, for sudo; with `None` only a sudo that does not ask is tried.
        capabilities: capabilities of the guest in addition to those that are detected.

    Attributes:
        machine_name: how the user calls the machine, for records; "" if it has no name.

    Raises:
        MissingCapabilityError: `env` lacks one of the methods.
    """

    def __init__(
        self, env: OsworldLike, password: str | None = None, capabilities: Sequence[Capability] = ()
    ) -> None:
        owners = {"reset": env, "step": env, "evaluate": env}
        controller = getattr(env, "controller", None)
        owners |= {
            "get_screenshot": controller,
            "execute_python_command": controller,
            "get_file": controller,
        }
        missing = [
            name for name, owner in owners.items() if not callable(getattr(owner, name, None))
        ]
        if missing or not hasattr(env, "action_history"):
            names = ", ".join(missing) or "action_history"
            raise MissingCapabilityError(
                f"{type(env).__name__} is not shaped like OSWorld's environment: no {names}"
            )
        self.env = env
        self.password = password
        self._told: set[Capability] = {"apps", "files", *capabilities}
        if callable(getattr(controller, "get_accessibility_tree", None)):
            self._told.add("accessibility")
        self._found: frozenset[Capability] | None = None
        self._size: Size | None = None
        self.machine_name = ""

    @property
    def capabilities(self) -> frozenset[Capability]:
        """The capabilities of this desktop; the guest is asked once."""
        if self._found is None:
            self._found = survey(self.execute, self.password)
        return self._found | self._told

    @property
    def size(self) -> Size:
        """`(height, width)` of the screen in pixels, from its last screenshot."""
        if self._size is None:
            self.screenshot()
        return cast(Size, self._size)

    @property
    def action_history(self) -> list[Any]:
        """The agent's actions, as the evaluator of an infeasible task sees them."""
        return self.env.action_history

    def screenshot(self) -> UInt8Array:
        """The screen: uint8 RGB `[H, W, 3]`.

        Raises:
            GuestError: The guest sends no picture.
        """
        data: object = self.env.controller.get_screenshot()
        if not isinstance(data, bytes) or not data:
            raise GuestError("the guest gave no screenshot")
        try:
            picture = np.asarray(Image.open(io.BytesIO(data)).convert("RGB"))
        except (
            UnidentifiedImageError,
            OSError,
            SyntaxError,
            ValueError,
            Image.DecompressionBombError,
        ) as error:
            raise GuestError(f"the guest's screenshot can't be read ({error})") from None
        self._size = picture.shape[0], picture.shape[1]
        return picture

    def accessibility(self) -> str:
        """The accessibility tree in OSWorld's dialect.

        Raises:
            MissingCapabilityError: The environment cannot read one.
            GuestError: The guest sends none.
        """
        if "accessibility" not in self._told:
            raise MissingCapabilityError(
                f"{type(self.env).__name__}.controller has no get_accessibility_tree"
            )
        tree: object = self.env.controller.get_accessibility_tree()
        if not isinstance(tree, str):
            raise GuestError(f"the guest gave no accessibility tree but {type(tree).__name__}")
        return tree

    def run(self, code: str) -> RunResult:
        """Run pyautogui `code`, outside the agent's actions.

        Raises:
            GuestError: The guest does not answer.
        """
        answer: Any = self.env.controller.execute_python_command(code)
        if not isinstance(answer, dict):
            raise GuestError("the guest gave no answer to the code; it may have run it")
        fields = cast("dict[str, Any]", answer)
        return RunResult(
            str(fields.get("status", "error")),
            str(fields.get("output") or ""),
            str(fields.get("error") or ""),
            fields.get("returncode"),
        )

    def execute(self, argv: Sequence[str] | str, timeout: float = 60) -> RunResult:
        """Run a command; a string goes to the shell. OSWorld's client itself waits at most 90 s.

        Only the first 2 MiB of output are returned, because OSWorld's server and client hold
        several copies of all of it.
        """
        shell = isinstance(argv, str)
        command = argv if shell else [str(part) for part in argv]
        program = _RUN.format(
            command=command,
            shell=shell,
            timeout=timeout,
            mark=_MARK,
            cap=MAX_OUTPUT_BYTES,
            note=CAP_NOTE,
        )
        code, output, error = json.loads(self._answer(_ISOLATED.format(code=program)))
        return RunResult("success" if code is not None else "error", output, error, code)

    def read_file(self, path: str) -> bytes:
        """The content of a file.

        Raises:
            GuestError: The file cannot be read.
        """
        # get_file itself would try for 15 s
        if self._answer(_READABLE.format(path=path, mark=_MARK)) != "True":
            raise GuestError(f"{path}: no file that the desktop's user can read", 404)
        data: object = self.env.controller.get_file(path)
        if not isinstance(data, bytes):
            raise GuestError(f"{path}: the guest did not send it")
        return data

    def write_file(self, path: str, data: bytes) -> None:
        """Write a file, in pieces that fit into a command.

        Raises:
            GuestError: The file cannot be written.
        """
        for start in range(0, max(len(data), 1), CHUNK_BYTES):
            piece = base64.b64encode(data[start : start + CHUNK_BYTES]).decode("ascii")
            result = self.run(
                _WRITE.format(path=path, mode="r+b" if start else "wb", start=start, data=piece)
            )
            if not result.ok:
                reason = result.error.strip().splitlines()[-1:] or ["no reason given"]
                raise GuestError(f"{path}: can't be written in the guest ({reason[0]})")

    def reset(self, task: TaskConfig | None = None) -> None:
        """The environment's own reset: pristine, with `task` set up."""
        self._size = None
        self.env.reset(task_config=None if task is None else dict(task))

    def evaluate(self) -> float:
        """Return the environment's own score of the current task."""
        return float(self.env.evaluate())

    def close(self) -> None:
        """Close the environment, if it can be closed; closing twice is allowed."""
        close = getattr(self.env, "close", None)
        if callable(close):
            close()

    def _answer(self, code: str) -> str:
        result = self.run(code)
        for line in reversed(result.output.splitlines()):
            if line.startswith(_MARK):
                return line.removeprefix(_MARK)
        if not result.ok:
            raise GuestError(
                "the guest could not run the command:"
                f" {(result.error or result.output).strip()[-500:]}"
            )
        raise DesktopError(f"the guest's answer is not ours: {result.output[-200:]!r}")
