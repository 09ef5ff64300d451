"""Walk a program in the order in which it runs, with the constants known at each call.

The walk is conservative: a name counts as unknown where its value cannot be followed (a loop
changes it, branches disagree, it is a parameter). Calls that may run at another time than their
place suggests, or never (in annotations and types), are not followed; `run` returns them. Nothing
is ever executed.
"""

import ast
from collections.abc import Callable, Iterable, Sequence

from .folding import Folder, arithmetic
from .names import all_bound, bound_names
from .values import Bindings, MaybeValue, Unknown, list_depths

OnCall = Callable[[ast.Call, Bindings], None]
_Function = ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda
_NOT_FOLLOWED = "it is unpacked in a way that is not followed"
_Comprehension = ast.ListComp | ast.SetComp | ast.DictComp | ast.GeneratorExp


class Flow:
    """Calls `on_call(call, env)` for each call of a program, with the bindings when it runs."""

    def __init__(self, folder: Folder, on_call: OnCall) -> None:
        self._folder = folder
        self._on_call = on_call
        self._followed: set[int] = set()
        self._class_names: set[str] = set()  # bound in the class body around

    def run(self, tree: ast.Module) -> list[ast.Call]:
        """Walk the whole program once. Return the calls that were not followed."""
        self._block(tree.body, Bindings())
        calls = [node for node in ast.walk(tree) if isinstance(node, ast.Call)]
        return [call for call in calls if id(call) not in self._followed]

    def _block(self, statements: Iterable[ast.stmt], env: Bindings) -> None:
        for statement in statements:
            self._statement(statement, env)

    def _statement(self, node: ast.stmt, env: Bindings) -> None:
        match node:
            case ast.Assign(targets=targets, value=value):
                self._expression(value, env)
                self._assign(targets, self._known(value, env), env)
            case ast.AnnAssign(target=target, value=ast.expr() as value):
                self._expression(value, env)
                self._assign([target], self._known(value, env), env)
            case ast.AnnAssign(target=target):
                self._assign([target], Unknown("it is declared without a value"), env)
            case ast.AugAssign():
                self._augment(node, env)
            case ast.If(test=test, body=body, orelse=orelse):
                self._expression(test, env)
                self._branches([body, orelse], env)
            case ast.Match(subject=subject, cases=cases):
                self._expression(subject, env)
                self._cases(cases, env)
            case ast.For() | ast.AsyncFor() | ast.While():
                self._loop(node, env)
            case ast.Try() | ast.TryStar():
                self._try(node, env)
            case ast.With() | ast.AsyncWith():
                self._with(node, env)
            case ast.FunctionDef() | ast.AsyncFunctionDef() | ast.ClassDef():
                self._definition(node, env)
            case _ if type(node).__name__ == "TypeAlias":  # its value is worked out on demand
                _forget(env, all_bound([node]), "is a type", node)
            case _:
                self._children(node, env)
                _forget(env, all_bound([node]), "is not set to a number that can be followed", node)

    def _known(self, node: ast.expr, env: Bindings) -> MaybeValue:
        try:
            return self._folder.fold(node, env)
        except Unknown as unknown:
            return unknown

    def _assign(self, targets: Sequence[ast.expr], value: MaybeValue, env: Bindings) -> None:
        if len(targets) > 1 and any(True for _ in list_depths(value)):
            value = Unknown("a list with several names may be changed through each of them")
        for target in targets:
            self._assign_one(target, value, env)

    def _assign_one(self, target: ast.expr, value: MaybeValue, env: Bindings) -> None:
        match target:
            case ast.Name(id=name):
                env[name] = value
            case ast.Tuple(elts=parts) | ast.List(elts=parts):
                items = _unpacked(parts, value)
                for part, item in zip(parts, items, strict=True):
                    self._assign_one(part, item, env)
            case ast.Starred(value=inner):
                self._assign_one(inner, Unknown(_NOT_FOLLOWED), env)
            case _:
                self._expression(target, env)

    def _augment(self, node: ast.AugAssign, env: Bindings) -> None:
        self._expression(node.value, env)
        if not isinstance(node.target, ast.Name):
            self._expression(node.target, env)
            return
        name = node.target.id
        try:
            before = self._folder.fold(ast.Name(name, ast.Load()), env)
            change = self._folder.fold(node.value, env)
            env[name] = arithmetic(node.op, before, change)
        except Unknown as unknown:
            env[name] = unknown

    def _branches(self, blocks: Sequence[Sequence[ast.stmt]], env: Bindings) -> None:
        ends: list[Bindings] = []
        for block in blocks:
            inside = env.inside()
            self._block(block, inside)
            ends.append(inside)
        env.merge(ends)

    def _cases(self, cases: Sequence[ast.match_case], env: Bindings) -> None:
        for case in cases:
            _forget(env, all_bound([case.pattern]), "is bound by a match", case.pattern)
            if case.guard is not None:
                self._expression(case.guard, env)
        self._branches([[], *(case.body for case in cases)], env)

    def _loop(self, node: ast.For | ast.AsyncFor | ast.While, env: Bindings) -> None:
        changed = all_bound([node])
        if not isinstance(node, ast.While):
            self._expression(node.iter, env)
        _forget(env, changed, "changes in a loop", node)
        inside = env.inside()
        if isinstance(node, ast.While):
            self._expression(node.test, env)
        else:
            self._assign_one(node.target, Unknown("it changes in a loop"), inside)
            _forget(inside, all_bound([node.target]), "changes in a loop", node)
        self._block(node.body, inside)
        self._block(node.orelse, env)
        _forget(env, changed, "changes in a loop", node)

    def _try(self, node: ast.Try | ast.TryStar, env: Bindings) -> None:
        changed = all_bound([node])
        self._block([*node.body, *node.orelse], env.inside())
        _forget(env, changed, "changes in a try block", node)
        for handler in node.handlers:
            if handler.type is not None:
                self._expression(handler.type, env)
            self._block(handler.body, env.inside())
        self._block(node.finalbody, env)
        _forget(env, changed - all_bound(node.finalbody), "changes in a try block", node)

    def _with(self, node: ast.With | ast.AsyncWith, env: Bindings) -> None:
        for item in node.items:
            self._expression(item.context_expr, env)
            target = item.optional_vars
            if target is not None:
                self._assign_one(target, Unknown("it is bound by a with statement"), env)
                _forget(env, all_bound([target]), "is bound by a with statement", node)
        self._block(node.body, env.inside())
        _forget(env, all_bound(node.body), "changes in a with block", node)

    def _definition(
        self, node: ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef, env: Bindings
    ) -> None:
        for decorator in node.decorator_list:
            self._expression(decorator, env)
        if isinstance(node, ast.ClassDef):
            for base in node.bases:
                self._expression(base, env)
            for keyword in node.keywords:
                self._expression(keyword.value, env)
            self._class_body(node, env)
        else:
            self._defaults(node.args, env)
            self._block_of_function(node, env)
        _forget(env, {node.name}, "is a function or class", node)

    def _class_body(self, node: ast.ClassDef, env: Bindings) -> None:
        """Walk a class body: neither it nor its inner scopes see the names of enclosing classes."""
        bases = node.bases or node.keywords  # the metaclass may define names in the body
        around = self._class_names
        inside = env.inside(sees=_sees_nothing if bases else None)
        _forget(inside, around, "belongs to the class around", node)
        self._class_names = all_bound(node.body)
        _forget(inside, self._class_names, "is bound in a class", node)
        self._block(node.body, inside)
        self._class_names = around

    def _block_of_function(
        self, node: ast.FunctionDef | ast.AsyncFunctionDef, env: Bindings
    ) -> None:
        inner = self._inner(node, env)
        around = self._class_names
        self._class_names = set()
        self._block(node.body, inner)
        self._class_names = around

    def _defaults(self, args: ast.arguments, env: Bindings) -> None:
        for default in args.defaults:
            self._expression(default, env)
        for default in args.kw_defaults:
            if default is not None:
                self._expression(default, env)

    def _later(self, node: ast.AST, env: Bindings) -> Bindings:
        """Return the bindings of code that runs later: names that the whole program binds once."""
        bindings = self._folder.names.bindings
        later = env.inside(sees=lambda name: bindings[name] == 1)
        _forget(later, self._class_names, "belongs to a class", node)
        return later

    def _inner(self, node: _Function, env: Bindings) -> Bindings:
        """Return the bindings of the body of a function: as `_later`, without its parameters."""
        inner = self._later(node, env)
        parameters: set[str] = set()
        for part in ast.walk(node.args):
            parameters.update(bound_names(part))
        _forget(inner, parameters, "is a parameter", node)
        return inner

    def _expression(self, node: ast.AST, env: Bindings) -> None:
        match node:
            case ast.Lambda():
                self._defaults(node.args, env)
                self._expression(node.body, self._inner(node, env))
            case ast.ListComp() | ast.SetComp() | ast.DictComp() | ast.GeneratorExp():
                self._comprehension(node, env)
            case _:
                self._children(node, env)
        if isinstance(node, ast.Call):
            self._followed.add(id(node))
            self._on_call(node, env)

    def _comprehension(self, node: _Comprehension, env: Bindings) -> None:
        if isinstance(node, ast.GeneratorExp):  # a generator runs only when its items are asked for
            inner = self._later(node, env)
        else:
            inner = env.inside()
            _forget(inner, self._class_names, "belongs to a class", node)
        for generator in node.generators:
            _forget(inner, all_bound([generator.target]), "is a loop variable", node)
        self._children(node, inner)

    def _children(self, node: ast.AST, env: Bindings) -> None:
        for child in ast.iter_child_nodes(node):
            self._expression(child, env)


def _unpacked(parts: Sequence[ast.expr], value: MaybeValue) -> Sequence[MaybeValue]:
    """Return the values of the targets that a value is unpacked to."""
    if not isinstance(value, tuple):
        return [value] * len(parts)
    has_star = any(isinstance(part, ast.Starred) for part in parts)
    if has_star or len(parts) != len(value):
        return [Unknown(_NOT_FOLLOWED)] * len(parts)
    return value


def _sees_nothing(_: str) -> bool:
    return False


def _forget(env: Bindings, names: Iterable[str], why: str, node: ast.AST) -> None:
    env.forget(names, why, getattr(node, "lineno", 1))
