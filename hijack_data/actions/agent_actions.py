"""Check whether a live desktop may run an action of an agent.

An agent may wait, end the episode, ask for help, or run pyautogui code that uses pointer and
keyboard and nothing else.

The code is only parsed here; it runs in the guest. Allowed are imports of pyautogui and time, calls
of their functions, literals, arithmetic, simple assignments and `for` loops over them.
"""

import ast
import builtins
import re
import textwrap
from collections import Counter
from dataclasses import dataclass
from typing import Literal, TypeAlias

from ..errors import ActionError
from ..runs.run_log import REINIT
from .program.names import Names
from .pyautogui_functions import AGENTNET_TRIPLE, KEYBOARD, POINTER
from .python_source import ParsedSource, refuse_deep_nesting

ActionKind: TypeAlias = Literal["wait", "done", "fail", "reinit", "code"]
ACTION_WORDS: dict[str, ActionKind] = {
    "WAIT": "wait",
    "DONE": "done",
    "FAIL": "fail",
    REINIT: "reinit",
}
MAX_CODE_CHARS = 32_000  # characters; an argument of a command may have 128 KiB

# Begins the text that stands for an answer which its own parser refused; the reason follows.
UNREADABLE = "unreadable action: "
_REPLY = "; the reply: "

# Only fences at the start or the end of a line count: an agent may also type ``` as text.
_FENCE = re.compile(
    r"^[ \t]*```(?:[\w+-]*[ \t]*\r?\n)?(.*?)(?:^[ \t]*```|```[ \t]*\r?$)", re.DOTALL | re.MULTILINE
)
_MODULES = {
    "pyautogui": frozenset(
        {*POINTER, *KEYBOARD, "sleep", "size", "position", "hold", "onScreen"} - {AGENTNET_TRIPLE}
    ),
    "time": frozenset({"sleep", "time", "monotonic", "perf_counter"}),
}
_CONSTANTS = frozenset(
    {"PAUSE", "FAILSAFE", "MINIMUM_DURATION", "LEFT", "MIDDLE", "RIGHT", "PRIMARY", "SECONDARY"}
)
_SETTINGS = frozenset({"PAUSE", "FAILSAFE", "MINIMUM_DURATION", "MINIMUM_SLEEP"})
_TWEEN = re.compile(r"linear|ease(In|Out|InOut)\w+")
# Attributes of the results of `position` and `size`.
_FIELDS = frozenset({"x", "y", "width", "height"})
_PLAIN = frozenset(
    {
        "range",
        "enumerate",
        "zip",
        "len",
        "int",
        "float",
        "str",
        "round",
        "abs",
        "min",
        "max",
        "print",
    }
)
_NODES = (
    ast.Module,
    ast.Expr,
    ast.Assign,
    ast.AugAssign,
    ast.For,
    ast.With,
    ast.withitem,
    ast.Pass,
    ast.Import,
    ast.ImportFrom,
    ast.alias,
    ast.Call,
    ast.keyword,
    ast.Attribute,
    ast.Name,
    ast.Constant,
    ast.Tuple,
    ast.List,
    ast.BinOp,
    ast.UnaryOp,
    ast.Starred,
    ast.Subscript,
    ast.Slice,
    ast.JoinedStr,
    ast.FormattedValue,
    ast.expr_context,
    ast.Add,
    ast.Sub,
    ast.Mult,
    ast.Div,
    ast.FloorDiv,
    ast.Mod,
    ast.USub,
    ast.UAdd,
)
_FIX = (
    "an action uses pyautogui and time only: calls, literals, simple assignments, for loops over"
    " them"
)


@dataclass(frozen=True)
class Request:
    """The request of an agent: `code` is pyautogui code, or one of `ACTION_WORDS`."""

    kind: ActionKind
    code: str


def read_action(text: object, allow_code: bool = False) -> Request:
    """Read one action: `WAIT`, `DONE`, `FAIL`, `REQUEST_REINIT`, or code, also in a ``` fence.

    Raises:
        ActionError: the text is none of these, or the code does more than `allow_code` permits.
    """
    if not isinstance(text, str):
        kind = type(text).__name__
        raise ActionError(f"an action must be a string, got {kind}; give pyautogui code or a word")
    if text.startswith(UNREADABLE):
        raise ActionError(text.removeprefix(UNREADABLE).partition(_REPLY)[0])
    inner = _unfenced(text)
    if inner in ACTION_WORDS:
        return Request(ACTION_WORDS[inner], inner)
    if not inner:
        raise ActionError(f"the action is empty; give pyautogui code, or {', '.join(ACTION_WORDS)}")
    if len(inner) > MAX_CODE_CHARS or "\0" in inner or not _is_text(inner):
        raise ActionError(
            f"an action is text of at most {MAX_CODE_CHARS} characters without zero bytes, got"
            f" {len(inner)}"
        )
    if not allow_code:
        check_code(inner)
    return Request("code", inner)


def unreadable_action(error: Exception, reply: str = "") -> str:
    """Return a text that `read_action` refuses with the reason why an answer cannot be read.

    Args:
        error: the reason, in the words of the dialect.
        reply: the answer, or its beginning, which the text keeps for the log.
    """
    reason = " ".join(str(error).split())
    return f"{UNREADABLE}{reason}{_REPLY}{reply}" if reply else f"{UNREADABLE}{reason}"


def fenced_blocks(text: str) -> list[str]:
    """Return the contents of the ``` fences of a text, without empty blocks.

    Raises:
        ActionError: a fence has no partner, so code cannot be distinguished from prose.
    """
    return [text[start:end] for start, end in fenced_spans(text)]


def fenced_spans(text: str) -> list[tuple[int, int]]:
    """Return where the contents of the ``` fences begin and end, see `fenced_blocks`."""
    spans = [found.span(1) for found in _FENCE.finditer(text) if found[1].strip()]
    if spans and _FENCE.sub("", text).count("```"):
        raise ActionError(
            f"the action holds {len(spans)} blocks in ``` fences and a fence of no block, not one"
            " block; give one action at a time"
        )
    return spans


def _unfenced(text: str) -> str:
    """Return the one fenced block, or the whole text if there is none.

    Two blocks are refused, so that no request of an agent is dropped silently.
    """
    blocks = fenced_blocks(text)
    if not blocks:
        return textwrap.dedent(text).strip()
    if len(blocks) > 1:
        raise ActionError(
            f"the action holds {len(blocks)} blocks in ``` fences, not one block; give one action"
            " at a time"
        )
    return textwrap.dedent(blocks[0]).strip()


def _is_text(text: str) -> bool:
    try:
        text.encode()
    except UnicodeEncodeError:
        return False
    return True


def check_code(code: str) -> None:
    """Raise `ActionError`, with line and column, unless `code` only moves pointer and keys."""
    with refuse_deep_nesting():
        source = ParsedSource(code)
        names = Names(source.tree)
        checker = _Checker(source, names)
        for node in ast.walk(source.tree):
            problem = checker.problem(node)
            if problem:
                source.refuse(node, problem, _FIX)


class _Checker:
    """Finds the reason to refuse a node of the code.

    `ast.walk` visits parents first, so they decide what their children may be.
    """

    def __init__(self, source: ParsedSource, names: Names) -> None:
        self._source = source
        self._names = names
        nodes = [
            node for node in ast.walk(source.tree) if isinstance(node, ast.Import | ast.ImportFrom)
        ]
        self._imported = Counter(
            alias.asname or alias.name for node in nodes for alias in node.names
        )
        self._modules: dict[str, str] = {
            name: name for name in _MODULES if name not in names.bindings
        }
        self._functions: set[str] = set()
        self._allowed: set[int] = set()  # callees, and the modules before a dot

    def problem(self, node: ast.AST) -> str | None:
        """Return why `node` is refused, or `None`."""
        if not isinstance(node, _NODES):
            return f"{type(node).__name__} is not allowed"
        match node:
            case ast.Import(names=aliases):
                return self._import(aliases)
            case ast.ImportFrom():
                return self._import_from(node)
            case ast.Call():
                return self._call(node)
            case ast.Attribute():
                return self._attribute(node)
            case ast.Name(ctx=ast.Load()):
                return self._load(node)
            case ast.With(items=items):
                return self._with(items)
            case ast.Constant(value=value) if not isinstance(
                value, str | int | float | bool | None
            ):
                return f"a {type(value).__name__} is not allowed"
            case _:
                return None

    def _import(self, aliases: list[ast.alias]) -> str | None:
        for alias in aliases:
            if alias.name not in _MODULES:
                return f"module {alias.name!r} is not allowed"
            self._modules[alias.asname or alias.name] = alias.name
        return None

    def _import_from(self, node: ast.ImportFrom) -> str | None:
        known = _MODULES.get(node.module or "", frozenset()) if not node.level else frozenset[str]()
        for alias in node.names:
            if alias.name not in known:
                return f"{node.module}.{alias.name} is not allowed"
            self._functions.add(alias.asname or alias.name)
        return None

    def _call(self, node: ast.Call) -> str | None:
        match node.func:
            case ast.Attribute(value=ast.Name(id=owner) as name, attr=attr):
                module = self._module(owner)
                if module is None or attr not in _MODULES[module]:
                    return f"{self._source.text(node.func)}() is not allowed"
                self._allowed |= {id(node.func), id(name)}
            case ast.Name(id=name):
                plain = name in _PLAIN and name not in self._names.bindings
                if not plain and not self._function(name):
                    return f"{name}() is not allowed"
                self._allowed.add(id(node.func))
            case _:
                return f"{self._source.text(node.func)}() is not allowed"
        return None

    def _attribute(self, node: ast.Attribute) -> str | None:
        if id(node) in self._allowed:
            return None
        owner = node.value.id if isinstance(node.value, ast.Name) else ""
        if self._module(owner) == "pyautogui":
            self._allowed.add(id(node.value))
            known = _SETTINGS if isinstance(node.ctx, ast.Store) else _CONSTANTS
            tween = isinstance(node.ctx, ast.Load) and _TWEEN.fullmatch(node.attr)
            return None if node.attr in known or tween else f"pyautogui.{node.attr} is not allowed"
        reads = isinstance(node.ctx, ast.Load) and node.attr in _FIELDS
        return None if reads else f"attribute {node.attr!r} is not allowed"

    def _load(self, node: ast.Name) -> str | None:
        if id(node) in self._allowed:
            return None
        if node.id in self._modules or node.id in self._functions or hasattr(builtins, node.id):
            return f"{node.id!r} may be called, but not passed on"
        return None if node.id in self._names.bindings else f"{node.id!r} is not defined"

    def _with(self, items: list[ast.withitem]) -> str | None:
        for item in items:
            call = item.context_expr
            hold = (
                isinstance(call, ast.Call) and ast.unparse(call.func).rpartition(".")[2] == "hold"
            )
            if not hold or item.optional_vars is not None:
                return "`with` goes with pyautogui.hold(...) only"
        return None

    def _module(self, name: str) -> str | None:
        """Return the module that `name` refers to, if only imports ever bind it."""
        return (
            self._modules.get(name) if self._names.bindings[name] == self._imported[name] else None
        )

    def _function(self, name: str) -> bool:
        return name in self._functions and self._names.bindings[name] == self._imported[name]
