"""The grammar of pyautogui code: straight-line calls with literal arguments.

A program is a sequence of these statements, in the order in which they run:

* `import pyautogui`, `import time as t`, `from pyautogui import click`;
* `pyautogui.click(100, 200)`: a call of a known function by its name, or by the name of an import;
* `x, y = 100, 200`: numbers, texts and flat sequences of them get names, which later lines use (as
  OSWorld's `tag_1 = (100, 200)`);
* `pyautogui.PAUSE = 0.5`: a setting;
* a text on a line of its own (as UI-TARS keeps its thoughts), and comments.

Arguments are literals, names, arithmetic (`+ - * / // %`) on numbers, `pyautogui.RIGHT` and the
like, and pyautogui's tweens. So every value is known without running the code. Everything else
(loops, branches, functions, other calls, star arguments, ...) is refused by name, with line and
column. Both who maps the coordinates of code and who decides whether an agent may run it read code
by this grammar; the code itself runs in a desktop only.
"""

import ast
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple, NoReturn, TypeAlias

from ..errors import suggest
from .pyautogui_functions import BUTTONS, SETTINGS, FunctionNames
from .python_source import ParsedSource, refuse_deep_nesting


@dataclass(frozen=True)
class Tween:
    """One of pyautogui's functions of time, such as `pyautogui.easeInQuad`."""

    name: str


Scalar: TypeAlias = int | float | str | bool | Tween | None
Value: TypeAlias = Scalar | tuple[Scalar, ...]

_LARGEST_NUMBER = 10**15  # larger numbers are not coordinates, and arithmetic could fill the memory
_TWEEN = re.compile(r"linear|ease(In|Out|InOut)\w+")
_READS_SCREEN = re.compile("position|size|pixel|screenshot|locate|onScreen|get")
_BINARY: Mapping[type[ast.operator], Callable[[float, float], float]] = {
    ast.Add: lambda a, b: a + b,
    ast.Sub: lambda a, b: a - b,
    ast.Mult: lambda a, b: a * b,
    ast.Div: lambda a, b: a / b,
    ast.FloorDiv: lambda a, b: a // b,
    ast.Mod: lambda a, b: a % b,
}
_UNARY: Mapping[type[ast.unaryop], Callable[[float], float]] = {
    ast.UAdd: lambda a: +a,
    ast.USub: lambda a: -a,
}

_CALLS = "write one call a line, such as pyautogui.click(100, 200)"
_VALUE = "write the value itself, such as 100 or 'text'"
_PAIR = "write such as x, y = 100, 200"
_WORD_ALONE = f"{_CALLS}; an action is either code or one of the words WAIT, DONE and FAIL"
# What each refused construct is called, and what to write in its place.
_STATEMENTS: Mapping[type[ast.stmt], tuple[str, str]] = {
    ast.For: ("a for loop", "write out the calls of each turn, one a line"),
    ast.AsyncFor: ("an async for loop", "write out the calls of each turn, one a line"),
    ast.While: ("a while loop", "write out the calls of each turn, one a line"),
    ast.If: ("an if statement", "write the calls of one branch only"),
    ast.Match: ("a match statement", "write the calls of one case only"),
    ast.Try: ("a try statement", "write the calls without it"),
    ast.TryStar: ("a try statement", "write the calls without it"),
    ast.With: ("a with statement", "hold keys with keyDown('shift') and keyUp('shift')"),
    ast.FunctionDef: ("a function definition", "write the calls of its body, one a line"),
    ast.AsyncFunctionDef: ("a function definition", "write the calls of its body, one a line"),
    ast.ClassDef: ("a class", _CALLS),
    ast.AugAssign: ("an augmented assignment", "assign the result, such as x = 15"),
    ast.AnnAssign: ("an annotated assignment", "assign without the annotation, such as x = 15"),
    ast.Pass: ("a pass statement", "write WAIT for an action that does nothing"),
}
_EXPRESSIONS: Mapping[type[ast.expr], tuple[str, str]] = {
    ast.Call: ("the result of a call", _VALUE),
    ast.Starred: ("a star argument", "write each argument out, such as click(100, 200)"),
    ast.Subscript: ("an index", _VALUE),
    ast.Attribute: ("an attribute", _VALUE),
    ast.BinOp: ("an operator other than + - * / // %", _VALUE),
    ast.UnaryOp: ("an operator other than + - * / // %", _VALUE),
    ast.JoinedStr: ("an f-string", "write the text itself"),
    ast.Lambda: ("a lambda", _VALUE),
    ast.IfExp: ("a conditional expression", _VALUE),
    ast.NamedExpr: ("an assignment inside an expression", "assign on a line of its own"),
    ast.ListComp: ("a list comprehension", "write the items out"),
    ast.GeneratorExp: ("a generator expression", "write the items out"),
    ast.Dict: ("a dict", _VALUE),
    ast.Set: ("a set", "write numbers without braces"),
    ast.Compare: ("a comparison", _VALUE),
    ast.BoolOp: ("a logical expression", _VALUE),
}


class Argument(NamedTuple):
    """An argument of a call: its value, and the expression that states it."""

    value: Value
    node: ast.expr


@dataclass(frozen=True)
class PyautoguiCall:
    """One call of a program.

    Args:
        module: `pyautogui`, `time`, `computer` or `pyperclip`, whatever name the program imports.
        function: the name of the function in its module.
        positional: the positional arguments, in order.
        keywords: the keyword arguments by name.
        node: the call in the syntax tree.
    """

    module: str
    function: str
    positional: tuple[Argument, ...]
    keywords: Mapping[str, Argument]
    node: ast.Call

    def bind(self, parameters: Sequence[str]) -> dict[str, Argument]:
        """Return the arguments by parameter name, without those that are not passed."""
        return {**dict(zip(parameters, self.positional, strict=False)), **self.keywords}


class _Origin(NamedTuple):
    """What an import binds a name to: a module, or a function of a module."""

    module: str
    function: str | None = None


def read_calls(source: ParsedSource, functions: FunctionNames) -> list[PyautoguiCall]:
    """Return the calls of a program, in the order in which they run.

    Args:
        source: the parsed code.
        functions: the functions of each module that the program may call.

    Raises:
        ActionError: the program holds anything beyond the grammar; the message names the construct,
            its line and column, and what to write instead.
    """
    reader = _GrammarReader(source, functions)
    with refuse_deep_nesting():
        for statement in source.tree.body:
            reader.read(statement)
    return reader.calls


class _GrammarReader:
    """Reads the statements of a program one after the other."""

    def __init__(self, source: ParsedSource, functions: FunctionNames) -> None:
        self._source = source
        self._functions = functions
        # Programs run where the modules are imported already.
        self._origins = {module: _Origin(module) for module in functions}
        self._variables: dict[str, Value] = {}
        self.calls: list[PyautoguiCall] = []

    def read(self, statement: ast.stmt) -> None:
        """Read one statement.

        Raises:
            ActionError: the grammar does not have it.
        """
        match statement:
            case ast.Expr(value=ast.Call() as call):
                self.calls.append(self._call(call))
            case ast.Expr(value=ast.Constant(value=str())):
                pass
            case ast.Expr(value=ast.Name(id=name)):
                self._refuse(statement, f"the name {name!r} alone on a line", _WORD_ALONE)
            case ast.Expr():
                self._refuse(statement, "an expression that is not a call", _CALLS)
            case ast.Assign(targets=[target], value=value):
                self._assign(target, value)
            case ast.Assign():
                self._refuse(statement, "an assignment to several targets", "write one a line")
            case ast.Import(names=aliases):
                for alias in aliases:
                    self._check_module(alias.name, statement)
                    self._bind(alias.asname or alias.name, _Origin(alias.name), statement)
            case ast.ImportFrom(names=aliases, module=name, level=level):
                module = "." * level + (name or "")
                self._check_module(module, statement)
                for alias in aliases:
                    origin = self._function(module, alias.name, statement)
                    self._bind(alias.asname or alias.name, origin, statement)
            case _:
                kind = type(statement).__name__.lower()
                unnamed = (f"the statement {kind!r}", _CALLS)
                self._refuse(statement, *_STATEMENTS.get(type(statement), unnamed))

    def _check_module(self, module: str, node: ast.AST) -> None:
        if module not in self._functions:
            modules = ", ".join(self._functions)
            self._refuse(node, f"an import of {module!r}", f"import only {modules}")

    def _function(self, module: str, name: str, node: ast.AST) -> _Origin:
        functions = self._functions[module]
        if name not in functions:
            fix = f"call what moves the pointer or presses keys{suggest(name, functions)}"
            if _READS_SCREEN.match(name):
                fix = "code cannot read the screen; write the numbers"
            self._refuse(node, f"{module}.{name}", fix)
        return _Origin(module, name)

    def _bind(self, name: str, origin: _Origin, node: ast.AST) -> None:
        if name in self._variables or self._origins.get(name, origin) != origin:
            self._refuse(node, f"a second meaning of the name {name!r}", "use another name")
        self._origins[name] = origin

    def _assign(self, target: ast.expr, node: ast.expr) -> None:
        value = self._value(node)
        match target:
            case ast.Tuple(elts=targets) | ast.List(elts=targets):
                count = len(targets)
                if not isinstance(value, tuple) or len(value) != count:
                    self._refuse(target, f"anything but {count} values for {count} names", _PAIR)
                for part, item in zip(targets, value, strict=True):
                    self._set(part, item)
            case ast.Attribute(value=ast.Name(id=owner), attr=name) if name in SETTINGS:
                if self._origins.get(owner) != _Origin("pyautogui"):
                    self._set(target, value)
            case _:
                self._set(target, value)

    def _set(self, target: ast.expr, value: Value) -> None:
        if not isinstance(target, ast.Name):
            self._refuse(target, "an assignment to anything but a name", _PAIR)
        if target.id in self._origins:
            self._refuse(target, f"a second meaning of the name {target.id!r}", "use another name")
        self._variables[target.id] = value

    def _call(self, node: ast.Call) -> PyautoguiCall:
        module, function = self._callee(node.func)
        keywords: dict[str, Argument] = {}
        for keyword in node.keywords:
            if keyword.arg is None:
                self._refuse(keyword.value, *_EXPRESSIONS[ast.Starred])
            keywords[keyword.arg] = Argument(self._value(keyword.value), keyword.value)
        positional = tuple(Argument(self._value(value), value) for value in node.args)
        return PyautoguiCall(module, function, positional, keywords, node)

    def _callee(self, node: ast.expr) -> tuple[str, str]:
        match node:
            case ast.Attribute(value=ast.Name(id=owner), attr=name):
                origin = self._origins.get(owner)
                if origin is not None and origin.function is None:
                    self._function(origin.module, name, node)
                    return origin.module, name
            case ast.Name(id=name):
                origin = self._origins.get(name)
                if origin is not None and origin.function is not None:
                    return origin.module, origin.function
                if name in self._functions["pyautogui"]:
                    self._refuse(node, f"{name}() without its module", f"write pyautogui.{name}()")
            case _:
                pass
        self._refuse(node, f"a call of {self._source.text(node)}()", _CALLS)

    def _value(self, node: ast.expr) -> Value:
        match node:
            case ast.Tuple(elts=items) | ast.List(elts=items):
                return tuple(self._scalar(item) for item in items)
            case ast.Constant(value=str() | bool() | None as value):
                return value
            case ast.Constant(value=int() | float() as value):
                return self._bounded(value, node)
            case ast.Name(id=name):
                if name in self._variables:
                    return self._variables[name]
                self._refuse(node, f"the name {name!r} without a value", _VALUE)
            case ast.UnaryOp(op=op, operand=operand) if type(op) in _UNARY:
                return _UNARY[type(op)](self._number(operand))
            case ast.BinOp(left=left, op=op, right=right) if type(op) in _BINARY:
                operands = self._number(left), self._number(right)
                try:
                    result = _BINARY[type(op)](*operands)
                except ArithmeticError as error:
                    self._refuse(node, f"arithmetic that fails ({error})", _VALUE)
                return self._bounded(result, node)
            case ast.Attribute(value=ast.Name(id=owner), attr=name):
                constant = Tween(name) if _TWEEN.fullmatch(name) else BUTTONS.get(name)
                if constant and self._origins.get(owner) == _Origin("pyautogui"):
                    return constant
            case ast.Constant(value=value):
                self._refuse(node, f"a value of type {type(value).__name__}", _VALUE)
            case _:
                pass
        self._refuse(node, *_EXPRESSIONS.get(type(node), ("an expression of this kind", _VALUE)))

    def _scalar(self, node: ast.expr) -> Scalar:
        value = self._value(node)
        if isinstance(value, tuple):
            self._refuse(node, "a sequence in a sequence", "write numbers and texts only")
        return value

    def _number(self, node: ast.expr) -> float:
        value = self._value(node)
        if isinstance(value, bool) or not isinstance(value, int | float):
            self._refuse(node, f"arithmetic on {self._source.text(node)}", "calculate with numbers")
        return value

    def _bounded(self, value: float, node: ast.expr) -> float:
        if not abs(value) <= _LARGEST_NUMBER:  # also a NaN
            self._refuse(node, "a number beyond 10**15", "write a smaller number")
        return value

    def _refuse(self, node: ast.AST, construct: str, fix: str) -> NoReturn:
        self._source.refuse(node, f"{construct} is not allowed in pyautogui code", fix)
