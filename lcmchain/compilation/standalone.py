"""Functions of compiled code with machine code of their own, which their callers call and no more.

A part (``compiled_parts.py``) is copied into every loop that calls it, and is optimised and made
machine code of there anew. The loop over the steps has many variants, by element, law, contact and
interfaces, and most of each is the same as in others. A standalone function is made machine code of
once for each kind of its arguments; a caller knows its name alone, and the linker finds it. It is
for what does enough in one call that the call costs nothing beside it, and whose arguments are few:
numbers, and references to tuples (``references.py``).

Before code of a caller is read from disk, all standalone functions that it calls are read or
compiled: with the code lies a list of them.
"""

from __future__ import annotations

import hashlib
import importlib
from collections.abc import Callable
from copy import copy
from typing import TYPE_CHECKING, Any

import llvmlite.binding as llvm
from numba.core import types
from numba.core.base import user_function
from numba.core.codegen import CPUCodeLibrary, JITCodeLibrary, JITCPUCodegen
from numba.core.cpu import CPUContext

from lcmchain.compilation.compiled_parts import (
    PartCompiler,
    PartDispatcher,
    PartEntry,
    PartLibrary,
)
from lcmchain.compilation.references import ReferenceType

if TYPE_CHECKING:  # numba may move what it does not publish
    from numba.core.codegen import CodeLibrary

PREFIX = "lcmchain.standalone."
CALLER = "caller"  # kinds of what is kept on disk, beside numba's own
STANDALONE = "standalone"

#: Returns what is kept of a library on disk.
Serialize = Callable[[CPUCodeLibrary], tuple]

#: Standalone functions of this process, by their names for the linker.
_known: dict[str, tuple[StandaloneDispatcher, tuple[Any, ...]]] = {}
#: All code that callers have been linked to.
_linked: list[JITCodeLibrary] = []


class StandaloneLibrary(JITCodeLibrary):
    """Machine code of a standalone function."""

    only_linked = True  # Python has no entry to it

    def serialize_using_object_code(self) -> tuple:
        data = self._get_compiled_object(), self._get_module_for_linking().as_bitcode()
        return with_what_it_calls(self, (self.name, STANDALONE, data))


class StandaloneCompiler(PartCompiler):
    """Numba's compiler, which makes the library of a standalone function."""

    def own_library(self, targetctx: CPUContext) -> CodeLibrary:
        library = StandaloneLibrary(targetctx.codegen(), f"{STANDALONE}_{id(self)}")
        library.enable_object_caching()
        return library


class StandaloneDispatcher(PartDispatcher):
    """A function with machine code of its own, for compiled code to call."""

    compiler = StandaloneCompiler

    def add_overload(self, cres: Any) -> None:
        """Tell the linker where the code is, and numba that callers need its name alone."""
        arguments = tuple(cres.signature.args)
        name = self.name_for(arguments)
        address = cres.library.get_pointer_to_function(cres.fndesc.llvm_func_name)
        llvm.add_symbol(name, address)
        _known[name] = self, arguments
        _linked.append(cres.library)
        as_callers_know_it = copy(cres.fndesc)
        as_callers_know_it.mangled_name = name
        entry = PartEntry()
        called = user_function(as_callers_know_it, ())
        self.targetctx._defns[entry].append(called, called.signature)
        self.overloads[arguments] = cres._replace(entry_point=entry)

    def name_for(self, arguments: tuple[Any, ...]) -> str:
        """Return its name for the linker, the same in every process."""
        function = self.py_func
        of = f"{function.__module__}.{function.__qualname__}({_described(arguments)})"
        digest = hashlib.blake2b(of.encode(), digest_size=12).hexdigest()
        return f"{PREFIX}{function.__name__}.{digest}"


def _described(arguments: types.Type | tuple) -> str:
    """Describe types of arguments so that no two of them read alike."""
    if isinstance(arguments, ReferenceType):
        return f"&{_described(arguments.to)}"
    if isinstance(arguments, types.BaseTuple | tuple):
        kind = getattr(arguments, "instance_class", tuple)
        parts = [_described(part) for part in arguments]  # type: ignore[union-attr]
        return f"{kind.__module__}.{kind.__qualname__}[{','.join(parts)}]"
    return f"{type(arguments).__name__}:{arguments}"


def know_standalone_code() -> None:
    """Let numba keep and read standalone functions and their callers; before any is compiled."""
    unserialize = JITCodeLibrary._unserialize.__func__  # type: ignore[attr-defined]

    def unserialize_library(
        cls: type[JITCodeLibrary], codegen: JITCPUCodegen, state: Any
    ) -> JITCodeLibrary:
        name, kind, data = state
        if kind == CALLER:
            called, state = data
            for module, function, arguments in called:
                getattr(importlib.import_module(module), function).compile(arguments)
            return unserialize_library(cls, codegen, state)
        if kind != STANDALONE:
            return unserialize(cls, codegen, state)
        library = StandaloneLibrary(codegen, name)
        object_code, bitcode = data
        library.enable_object_caching()
        library._set_compiled_object(object_code)
        library._shared_module = llvm.parse_bitcode(bitcode)
        library._finalize_final_module()
        codegen._engine._load_defined_symbols(library._shared_module)
        return library

    def with_calls(serialize: Serialize) -> Serialize:
        def serialize_with_calls(self: CPUCodeLibrary) -> tuple:
            return with_what_it_calls(self, serialize(self))

        return serialize_with_calls

    for library in (JITCodeLibrary, PartLibrary):
        kept = with_calls(library.serialize_using_object_code)
        library.serialize_using_object_code = kept  # type: ignore[method-assign]
    JITCodeLibrary._unserialize = classmethod(unserialize_library)  # type: ignore[method-assign, assignment]


def with_what_it_calls(library: CPUCodeLibrary, state: tuple) -> tuple:
    """Return what is kept of a library, with the standalone functions that it calls."""
    called = []
    for function in library._final_module.functions:
        if function.is_declaration and function.name.startswith(PREFIX):
            dispatcher, arguments = _known[function.name]
            of = dispatcher.py_func
            called.append((of.__module__, of.__qualname__, arguments))
    if not called:
        return state
    return library.name, CALLER, (called, state)


def standalone(function: Callable[..., Any], **options: Any) -> StandaloneDispatcher:
    """Compile a function by itself, when it is called, for compiled code to call."""
    dispatcher = StandaloneDispatcher(
        function, targetoptions={**options, "nopython": True, "boundscheck": None}
    )
    dispatcher.enable_caching()
    return dispatcher
