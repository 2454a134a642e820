"""Functions that answer by the class of their first argument, in compiled code and in plain Python.

The first argument is a NamedTuple: the parameters of a law, the data of a body. numba's overload
looks up its class when a kernel is compiled, so that the choice costs nothing at run time.
"""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable
from typing import Any, Protocol, cast

from numba import types
from numba.extending import overload

from lcmchain.compilation.cache import key_cache_by_file
from lcmchain.compilation.references import ReferenceType
from lcmchain.jit import INLINED, move_cache


class Dispatched(Protocol):
    """A function that answers by class, with the compiled functions of those that answer."""

    __name__: str
    implementations: dict[type, Any]

    def __call__(self, *arguments: Any) -> Any: ...


# All functions that answer by class.
_dispatched: list[Dispatched] = []


def required(stub: Callable[..., Any]) -> Dispatched:
    """Make a function that every class must implement; ``stub`` gives its name and arguments."""
    return _by_class(stub, None)


def optional(stub: Callable[..., Any]) -> Dispatched:
    """Make a function as :func:`required` does; ``stub`` answers for classes that do not."""
    return _by_class(stub, stub)


def implements(function: Dispatched, chosen_class: type) -> Callable[[Any], Any]:
    """Register the decorated compiled function as the answer of a class.

    One that only hands on what it is given to a kernel needs no compiler where Python asks, and
    may be a plain function; where compiled code asks it is compiled as all others.
    Code outside this package gets compiled kernels of its own on disk, keyed by its file.
    """

    def register(dispatcher):
        python_function = getattr(dispatcher, "py_func", dispatcher)
        wanted = list(inspect.signature(function).parameters)
        found = list(inspect.signature(python_function).parameters)
        if len(found) != len(wanted):
            raise TypeError(
                f"{python_function.__qualname__} takes {found}, but {function.__name__} in "
                f"{function.__module__} takes {wanted}"
            )
        function.implementations[chosen_class] = dispatcher
        if not python_function.__module__.startswith("lcmchain."):
            key_cache_by_file(inspect.getfile(python_function), python_function.__module__)
            move_cache()
        return dispatcher

    return register


def inherit(new_class: type, old_class: type) -> None:
    """Let a class answer all that another one answers so far, with the same functions."""
    for function in _dispatched:
        if old_class in function.implementations:
            implements(function, new_class)(function.implementations[old_class])


def is_implemented(function: Dispatched, chosen_class: type) -> bool:
    """Tell whether a class answers a function itself."""
    return chosen_class in function.implementations


def _by_class(stub, default):
    implementations: dict[type, Any] = {}

    def find(chosen_class):
        found = implementations.get(chosen_class, default)
        if found is None:
            raise NotImplementedError(
                f"{chosen_class.__name__} does not implement {stub.__name__} of {stub.__module__}"
            )
        return found

    @functools.wraps(stub)
    def function(first, *rest):
        return find(type(first))(first, *rest)

    def choose(first, *rest):
        if isinstance(first, ReferenceType):
            first = first.to
        if not isinstance(first, (types.NamedTuple, types.NamedUniTuple)):
            return None
        found = find(first.instance_class)
        return getattr(found, "py_func", found)

    dispatched = cast(Dispatched, function)
    dispatched.implementations = implementations
    _dispatched.append(dispatched)
    # the arguments carry the names that the implementation gives them: no comparison of names
    overload(function, jit_options=INLINED, strict=False)(choose)
    return dispatched
