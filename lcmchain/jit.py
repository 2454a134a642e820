"""One place for the compiler options that every compiled function of lcmchain shares."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from numba import njit
from numba.core.dispatcher import Dispatcher

from lcmchain.compilation.cache import let_processes_share
from lcmchain.compilation.compiled_parts import know_parts, part
from lcmchain.compilation.front_end import compile_in_less_time
from lcmchain.compilation.processor import align_compiled_code, keep_lane_loops, use_widest_vectors
from lcmchain.compilation.self_contained import keep_code_self_contained
from lcmchain.compilation.standalone import know_standalone_code, standalone
from lcmchain.compilation.threads import (
    launch_before_compiled_code_is_loaded,
    load_threading_library,
)

load_threading_library()
launch_before_compiled_code_is_loaded()
keep_lane_loops()
keep_code_self_contained()
align_compiled_code()
know_parts()
know_standalone_code()
let_processes_share()
compile_in_less_time()
use_widest_vectors()

# 'nnan' and 'ninf' are left out on purpose: they let the compiler delete the guards' checks.
FLOATING_POINT = {"contract", "nsz"}

# Options of a function that is inlined into the lane loop of a kernel. NumPy's error model keeps
# divisions free of the branch that would stop vectorisation.
INLINED: Any = {"error_model": "numpy", "fastmath": FLOATING_POINT, "forceinline": True}

# Options of a parallel loop, whose body may make arrays for scratch.
KERNEL: Any = {
    "error_model": "numpy",
    "fastmath": FLOATING_POINT,
    "parallel": True,
    "nogil": True,
    "_nrt": True,
}

# Nobody calls compiled functions from C.
NOT_FOR_C: Any = {"no_cfunc_wrapper": True}

# Functions that keep compiled code on disk.
_cached: list[Dispatcher] = []


def equation(function: Callable[..., Any]) -> Dispatcher:
    """Compile a small scalar function that is inlined into the lane loop of a kernel."""
    return _part(function, **INLINED)


def strict_equation(function: Callable[..., Any]) -> Dispatcher:
    """Compile like :func:`equation`, but with every operation rounded exactly as written."""
    return _part(function, error_model="numpy", forceinline=True)


def routine(function: Callable[..., Any]) -> Dispatcher:
    """Compile a serial function that kernels or other routines call; it may make arrays."""
    return _part(function, error_model="numpy", fastmath=FLOATING_POINT, _nrt=True)


def uncounted_routine(function: Callable[..., Any]) -> Dispatcher:
    """Compile like :func:`routine` a function that makes no array and returns none.

    Nor may what it calls return one. Each use of an array counts a reference to it up and down
    again: most of the code of a routine that hands many on, which the compiler takes away at last.
    """
    return _part(function, error_model="numpy", fastmath=FLOATING_POINT, _nrt=False)


def inlined_routine(function: Callable[..., Any]) -> Dispatcher:
    """Compile like :func:`routine` into the one place that calls it, an ordered span routine.

    Tuples of many arrays are handed over array by array, and each array is counted as a reference:
    that costs more than a short work on one point.
    """
    return _part(function, **INLINED, _nrt=False)


def entry(function: Callable[..., Any]) -> Dispatcher:
    """Compile like :func:`routine` a function that Python calls."""
    return _compiled(function, error_model="numpy", fastmath=FLOATING_POINT)


def uncounted_entry(function: Callable[..., Any]) -> Dispatcher:
    """Compile like :func:`uncounted_routine` a function that Python calls."""
    return _compiled(function, error_model="numpy", fastmath=FLOATING_POINT, _nrt=False)


def span_routine(function: Callable[..., Any]) -> Dispatcher:
    """Compile a serial function of loops over neighbouring nodes, for vectors.

    Sums of a loop may be taken in lanes: in an order of their own, but always the same one. The
    function must not allocate and keeps no array: the rows that it takes from arrays are not
    counted as references, which would cost more than the loops.
    """
    return _part(
        function, error_model="numpy", fastmath={*FLOATING_POINT, "reassoc"}, nogil=True, _nrt=False
    )


def span_part(function: Callable[..., Any]) -> Dispatcher:
    """Compile a part of a span routine that is inlined there: a call costs more than its loops."""
    return _part(
        function,
        error_model="numpy",
        fastmath={*FLOATING_POINT, "reassoc"},
        forceinline=True,
        _nrt=False,
    )


def ordered_span_routine(function: Callable[..., Any]) -> Dispatcher:
    """Compile like :func:`span_routine`, but with every sum in the order in which it is written."""
    return _part(function, error_model="numpy", fastmath=FLOATING_POINT, nogil=True, _nrt=False)


def standalone_routine(function: Callable[..., Any]) -> Dispatcher:
    """Compile like :func:`ordered_span_routine`, with machine code of its own.

    For what takes numbers and references alone, and does enough in a call to be worth it.
    """
    options = {"fastmath": FLOATING_POINT, "nogil": True, "_nrt": False}
    return _standalone(function, error_model="numpy", **options)


def standalone_loop(function: Callable[..., Any]) -> Dispatcher:
    """Compile like :func:`standalone_routine` what calls functions that return arrays."""
    options = {"fastmath": FLOATING_POINT, "nogil": True, "_nrt": True}
    return _standalone(function, error_model="numpy", **options)


def standalone_span_routine(function: Callable[..., Any]) -> Dispatcher:
    """Compile like :func:`span_routine`, with machine code of its own."""
    fastmath = {*FLOATING_POINT, "reassoc"}
    options = {"fastmath": fastmath, "nogil": True, "_nrt": False}
    return _standalone(function, error_model="numpy", **options)


def kernel(function: Callable[..., Any]) -> Dispatcher:
    """Compile a loop over blocks of elements or chunks of nodes, parallel over the blocks."""
    return _compiled(function, **KERNEL)


def kernel_part(function: Callable[..., Any]) -> Dispatcher:
    """Compile like :func:`kernel` a loop that compiled code alone calls."""
    return _part(function, **KERNEL)


def move_cache() -> None:
    """Keep compiled code where ``numba.config.CACHE_DIR`` points to by now."""
    for dispatcher in _cached:
        dispatcher.enable_caching()


def _compiled(function, **options):
    dispatcher = njit(cache=True, **options, **NOT_FOR_C)(function)
    _cached.append(dispatcher)
    return dispatcher


def _standalone(function, **options):
    dispatcher = standalone(function, **options)
    _cached.append(dispatcher)
    return dispatcher


def _part(function, **options):
    dispatcher = part(function, **options)
    _cached.append(dispatcher)
    return dispatcher
