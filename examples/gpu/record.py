"""Write equations of the program as C: what compiled code does, for another machine.

The equations are plain Python functions of numbers and of tuples of numbers. Called with numbers
that write down what is done with them, they give a list of operations without branches, loops and
calls. Options that are None leave nothing behind, as in the program's own compiled code.

A choice between two values (``one if condition else other``) becomes one of C, which makes both.
Equations with statements that ask about values (``if``, ``while``) cannot be recorded.
"""

from __future__ import annotations

import ast
import inspect
import math
import textwrap
from collections.abc import Callable, Mapping
from types import FunctionType, SimpleNamespace
from typing import Any

from numba.core.dispatcher import Dispatcher


class Recorder:
    """Operations in the order in which they were made, equal ones once.

    Parameters
    ----------
    kind : type of the numbers in C.
    """

    def __init__(self, kind: str = "real") -> None:
        self.kind = kind
        self.lines: list[str] = []
        self.known: dict[str, Number] = {}

    def number(self, expression: str) -> Number:
        """Return a number that is worked out by an expression of C."""
        if expression not in self.known:
            name = f"v{len(self.known)}"
            self.lines.append(f"const {self.kind} {name} = {expression};")
            self.known[expression] = Number(self, name)
        return self.known[expression]


class Number:
    """A number whose operations are written down."""

    __array_ufunc__ = None  # numbers of NumPy leave operations with this one to it

    def __init__(self, recorder: Recorder, name: str) -> None:
        self.recorder, self.name = recorder, name

    def __bool__(self) -> bool:
        raise TypeError("an equation asks about a value: it has branches and cannot be recorded")

    def of(self, form: str, *others: Any) -> Number:
        """Return what a form of C makes of this number and of others."""
        kind = self.recorder.kind
        values = (spelled(other, kind) for other in others)
        return self.recorder.number(form.format(self.name, *values))

    def __add__(self, other: Any) -> Any:
        return self if is_zero(other) else self.of("{} + {}", other)

    __radd__ = __add__

    def __sub__(self, other: Any) -> Any:
        return self if is_zero(other) else self.of("{} - {}", other)

    def __rsub__(self, other: Any) -> Any:
        return -self if is_zero(other) else self.of("{1} - {0}", other)

    def __mul__(self, other: Any) -> Any:
        return 0.0 if is_zero(other) else self.of("{} * {}", other)

    __rmul__ = __mul__

    def __truediv__(self, other: Any) -> Any:
        return self.of("{} / {}", other)

    def __rtruediv__(self, other: Any) -> Any:
        return self.of("{1} / {0}", other)

    def __neg__(self) -> Number:
        return self.of("-{}")

    def __ne__(self, other: Any) -> Any:
        return self.of("{} != {}", other)

    __hash__ = object.__hash__

    def __and__(self, other: Any) -> Any:
        return self.of("{} && {}", other)

    def __or__(self, other: Any) -> Any:
        return self.of("{} || {}", other)

    def __ge__(self, other: Any) -> Any:
        return self.of("{} >= {}", other)

    def __gt__(self, other: Any) -> Any:
        return self.of("{} > {}", other)

    def __le__(self, other: Any) -> Any:
        return self.of("{} <= {}", other)

    def __lt__(self, other: Any) -> Any:
        return self.of("{} < {}", other)

    def __abs__(self) -> Number:
        return self.of("fabs({})")

    def __pow__(self, other: Any) -> Any:
        return self.of("pow({}, {})", other)


def is_zero(value: Any) -> bool:
    """Tell whether a value is a number of Python that is 0."""
    return not isinstance(value, Number) and value == 0.0


def spelled(value: Any, kind: str) -> str:
    """Return a number as C reads it; one of Python gets a type."""
    if isinstance(value, Number):
        return value.name
    if math.isinf(value):  # no length is as large, and CUDA knows no name for it
        return "1e308" if value > 0.0 else "-1e308"
    return f"({kind}){float(value)!r}"


def either(name: str) -> Callable[..., Any]:
    """Return the larger or smaller of two, for numbers of both kinds."""
    plain_one = {"max": max, "min": min}[name]

    def function(one: Any, other: Any) -> Any:
        if isinstance(one, Number):
            return one.of(f"f{name}({{}}, {{}})", other)
        return function(other, one) if isinstance(other, Number) else plain_one(one, other)

    return function


def root(value: Any) -> Any:
    """Return the root of a number of either kind."""
    return value.of("sqrt({})") if isinstance(value, Number) else math.sqrt(value)


def choose(condition: Any, one: Any, other: Any) -> Any:
    """Return what :func:`lcmchain.packs.choose` does, for numbers of both kinds."""
    return chosen_of(condition, lambda: one, lambda: other)


def chosen_of(condition: Any, one: Callable[[], Any], other: Callable[[], Any]) -> Any:
    """Return one value or the other, or the number of C that is one of both."""
    if isinstance(condition, Number):
        return condition.of("{} ? {} : {}", one(), other())
    return one() if condition else other()


#: What equations find under these names in place of Python's own.
BY_NAME: dict[str, Any] = {
    "max": either("max"),
    "min": either("min"),
    "math": SimpleNamespace(sqrt=root, inf=math.inf),
    "chosen_of": chosen_of,
}


class Names(dict):
    """Names that a recorded function finds: those of its module, with functions as Python."""

    def __init__(self, names: Mapping[str, Any], replaced: Mapping[Any, Any]) -> None:
        super().__init__()
        self.names, self.replaced = names, replaced

    def __getitem__(self, name: str) -> Any:
        if name in BY_NAME:
            return BY_NAME[name]
        if name in self:
            return super().__getitem__(name)
        return as_python(self.names[name], self.replaced)


class Choices(ast.NodeTransformer):
    """Make ``one if condition else other`` a call, which numbers of both kinds can answer."""

    def visit_IfExp(self, node: ast.IfExp) -> ast.AST:
        self.generic_visit(node)
        no_arguments = ast.arguments([], [], None, [], [], None, [])
        both = [ast.Lambda(no_arguments, value) for value in (node.body, node.orelse)]
        return ast.Call(ast.Name("chosen_of", ast.Load()), [node.test, *both], [])


def as_python(value: Any, replaced: Mapping[Any, Any] | None = None) -> Any:
    """Return a compiled function, and all that it calls, as functions of Python.

    Functions that answer by the class of their first argument do so here too.

    Parameters
    ----------
    replaced : functions that stand for others.
    """
    replaced = replaced or {}
    for known, stand_in in replaced.items():
        if known is value:
            return stand_in
    if isinstance(value, Dispatcher):
        value = value.py_func
    if not isinstance(value, FunctionType) or not value.__module__.startswith("lcmchain"):
        return value
    if hasattr(value, "implementations"):
        by_class, without = value.implementations, value.__wrapped__

        def answer(first: Any, *rest: Any) -> Any:
            return as_python(by_class.get(type(first), without), replaced)(first, *rest)

        return answer
    return _with_choices(value, replaced)


def _with_choices(value: FunctionType, replaced: Mapping[Any, Any]) -> Any:
    """Return a function whose choices are calls of :func:`chosen_of`."""
    tree = ast.parse(textwrap.dedent(inspect.getsource(value)))
    definition = tree.body[0]
    assert isinstance(definition, ast.FunctionDef)
    definition.decorator_list, definition.returns = [], None
    for argument in definition.args.args:
        argument.annotation = None
    code = compile(ast.fix_missing_locations(Choices().visit(tree)), value.__module__, "exec")
    enclosed = inspect.getclosurevars(value).nonlocals
    names = Names(value.__globals__ | enclosed, replaced)
    exec(code, names)
    return names[definition.name]


class Rows:
    """An array of C as an equation sees it: rows of a block of lanes, read and written.

    Parameters
    ----------
    read : form of C for the number in a row. lanes : of a row.
    """

    def __init__(self, recorder: Recorder, read: str, lanes: int) -> None:
        self.recorder, self.read, self.lanes = recorder, read, lanes
        self.written: dict[int, Any] = {}

    def __getitem__(self, place: int) -> Number:
        return self.recorder.number(self.read.format(int(place) // self.lanes))

    def __setitem__(self, place: int, value: Any) -> None:
        self.written[int(place) // self.lanes] = value

    def stores(self, form: str) -> list[str]:
        """Return statements of C that write what was written, row and value put into a form."""
        return [
            form.format(row, spelled(value, self.recorder.kind))
            for row, value in self.written.items()
        ]
