"""Functions that are parts of others' compiled code, compiled as that and no more.

Numba compiles every function for callers of all kinds: it makes machine code of it at once, and two
wrappers, by which Python and C may call it. Most functions of a kernel are called by compiled code
alone, which holds a copy of each and optimises that anew (``self_contained.py``): their own machine
code and wrappers never run, and took a quarter of the time in which the solver was compiled. A part
keeps what callers take, its optimised intermediate code, in memory and on disk. Where Python calls
one even so, it is compiled once more, with all that this needs.

The body of a parallel loop is a function too, and numba wraps it twice before the kernel calls it:
three times it would optimise the whole loop and make machine code of it, of which only the kernel's
own copy runs. They are parts that are optimised in the kernel alone.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from types import FunctionType
from typing import TYPE_CHECKING, Any

import llvmlite.binding as llvm
from numba import config, jit, njit
from numba.core.codegen import CPUCodeLibrary, JITCodeLibrary, JITCPUCodegen
from numba.core.compiler import Compiler
from numba.core.cpu import CPUContext
from numba.core.registry import CPUDispatcher
from numba.core.typing.templates import _OverloadFunctionTemplate
from numba.np.ufunc import parallel

if TYPE_CHECKING:  # numba may move what it does not publish
    from numba.core.codegen import Codegen, CodeLibrary
    from numba.core.funcdesc import FunctionDescriptor
    from numba.core.typing.context import Context

PART = "part"  # kind of what is kept on disk, beside numba's own
LOOP_BODY = "__numba_parfor_gufunc"  # how numba names the bodies of parallel loops


class PartLibrary(JITCodeLibrary):
    """Optimised code of a part, for others to link; it never becomes machine code."""

    only_linked = True  # Python has no entry to it

    def _finalize_final_module(self) -> None:
        self._finalize_dynamic_globals()
        self._verify_declare_only_symbols()
        self._finalized = True

    def get_pointer_to_function(self, name: str) -> int:
        raise RuntimeError(f"{self.name} is a part of compiled code and has no address ({name})")

    def serialize_using_object_code(self) -> tuple[str, str, bytes]:
        self._ensure_finalized()
        return self.name, PART, self._final_module.as_bitcode()


class LoopLibrary(PartLibrary):
    """The body of a parallel loop, or a wrapper of it, as it comes."""

    def _optimize_final_module(self) -> None:
        """Leave it to the kernel, which calls each once."""


class PartCompiler(Compiler):
    """Numba's compiler, which makes a library of a part."""

    def __init__(
        self,
        typingctx: Context,
        targetctx: CPUContext,
        library: CodeLibrary | None,
        *others: object,
    ) -> None:
        super().__init__(typingctx, targetctx, self.own_library(targetctx), *others)

    def own_library(self, targetctx: CPUContext) -> CodeLibrary:
        """Return the library that takes the machine code, in place of the one that is given."""
        return PartLibrary(targetctx.codegen(), f"{PART}_{id(self)}")


class PartEntry:
    """Stands where a function has its address for Python."""


class PartDispatcher(CPUDispatcher):
    """A function for compiled code to call."""

    compiler: type[Compiler] = PartCompiler

    def __init__(
        self,
        py_func: Callable[..., Any],
        locals: dict | None = None,
        targetoptions: dict | None = None,
    ) -> None:
        super().__init__(py_func, locals or {}, targetoptions, pipeline_class=self.compiler)
        without = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}
        self._compiler.targetoptions = self.targetoptions | without  # type: ignore[attr-defined]

    def __call__(self, *arguments: Any, **named: Any) -> Any:
        return self.for_python(*arguments, **named)

    def add_overload(self, cres: Any) -> None:
        self.overloads[tuple(cres.signature.args)] = cres

    def enable_caching(self) -> None:
        super().enable_caching()
        if "for_python" in vars(self):
            self.for_python.enable_caching()

    @cached_property
    def for_python(self) -> Any:
        """The function compiled for Python to call; kept on disk under a name of its own."""
        of, name = self.py_func, f"{self.py_func.__name__}_for_python"
        twin = FunctionType(of.__code__, of.__globals__, name, of.__defaults__, of.__closure__)
        twin.__kwdefaults__, twin.__module__ = of.__kwdefaults__, of.__module__
        twin.__qualname__ = f"{of.__qualname__}_for_python"
        options = {k: v for k, v in self.targetoptions.items() if k not in NUMBAS_OWN}
        return njit(cache=True, **options)(twin)


#: Options that ``njit`` sets by itself.
NUMBAS_OWN = ("nopython", "boundscheck")
#: Options of ``jit`` that say more than how a function is compiled.
NOT_OF_PARTS = {"cache", "forceobj", "locals", "pipeline_class", "target", "_target"}


def part(function: Callable[..., Any], **options: Any) -> PartDispatcher:
    """Compile a function, when it is called, for compiled code to call; as ``njit`` otherwise."""
    dispatcher = PartDispatcher(
        function, targetoptions={**options, "nopython": True, "boundscheck": None}
    )
    dispatcher.enable_caching()
    return dispatcher


def know_parts() -> None:
    """Let numba read parts from disk, and ask none for an address; before anything is compiled.

    The environments of parts, Python objects that compiled code may use, are handed over with the
    machine code of those that hold a copy.
    """
    unserialize = JITCodeLibrary._unserialize.__func__  # type: ignore[attr-defined]
    executable, set_env = CPUContext.get_executable, JITCPUCodegen.set_env
    waiting: dict[str, object] = {}

    def unserialize_part(
        cls: type[JITCodeLibrary], codegen: JITCPUCodegen, state: Any
    ) -> JITCodeLibrary:
        name, kind, data = state
        if kind != PART:
            return unserialize(cls, codegen, state)
        library = PartLibrary(codegen, name)
        library._final_module = llvm.parse_bitcode(data)
        library._finalized = True
        return library

    def executable_of_part(
        self: CPUContext, library: CPUCodeLibrary, fndesc: FunctionDescriptor, env: object
    ) -> object:
        if getattr(library, "only_linked", False):
            library.codegen.set_env(self.get_env_name(fndesc), env)
            entry: object = PartEntry()
        else:
            entry = executable(self, library, fndesc, env)
        if isinstance(library, PartLibrary):  # no machine code that environments could go with
            return entry
        for variable in library._final_module.global_variables:
            if variable.name in waiting:
                library.codegen.set_env(variable.name, waiting[variable.name])
        return entry

    def set_env_where_it_is(self: JITCPUCodegen, name: str, env: object) -> None:
        if self._engine.get_global_value_address(name):
            set_env(self, name, env)
        else:
            waiting[name] = env

    JITCodeLibrary._unserialize = classmethod(unserialize_part)  # type: ignore[method-assign, assignment]
    CPUContext.get_executable = executable_of_part  # type: ignore[method-assign]
    JITCPUCodegen.set_env = set_env_where_it_is  # type: ignore[method-assign]
    _take_loops_for_parts()
    _take_overloads_for_parts()


def _take_loops_for_parts() -> None:
    """Make parts of the bodies of parallel loops and of their wrappers."""
    create, wrap = JITCPUCodegen.create_library, parallel.build_gufunc_wrapper
    wrapping: list[bool] = []

    def create_part(self: Codegen, name: str, **options: Any) -> Any:
        if wrapping or name.startswith(LOOP_BODY):
            return LoopLibrary(self, name, **options)
        return create(self, name, **options)

    def wrap_as_part(
        py_func: Callable,
        cres: object,
        sin: object,
        sout: object,
        cache: dict,
        is_parfors: bool,
    ) -> object:
        if not is_parfors:  # a function of its own that Python calls
            return wrap(py_func, cres, sin, sout, cache, is_parfors)
        wrapping.append(True)
        try:
            return wrap(py_func, cres, sin, sout, cache, is_parfors)
        finally:
            wrapping.pop()

    JITCPUCodegen.create_library = create_part  # type: ignore[method-assign]
    parallel.build_gufunc_wrapper = wrap_as_part


def _take_overloads_for_parts() -> None:
    """Make parts of the functions that stand in compiled code for those of Python and NumPy.

    ``min``, ``np.empty`` and what answers by class (:mod:`lcmchain.dispatch`) have no address that
    anyone asks for: numba gives them out to the code that calls them alone.
    """
    decorator_for = _OverloadFunctionTemplate._get_jit_decorator

    def part_for(self: _OverloadFunctionTemplate) -> Callable:
        decorator = decorator_for(self)
        return _overload_part if decorator is jit else decorator

    _OverloadFunctionTemplate._get_jit_decorator = part_for  # type: ignore[method-assign]


def _overload_part(**options: Any) -> Callable[..., Any]:
    """Stand for ``jit`` with these options."""
    if set(options) & NOT_OF_PARTS or config.DISABLE_JIT:  # type: ignore[attr-defined]
        return jit(**options)
    options = {"nopython": True, "boundscheck": None, **options}
    return lambda function: PartDispatcher(function, targetoptions=options)
