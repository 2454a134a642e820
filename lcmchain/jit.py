"""One place for the compiler options that every compiled function of lcmchain shares."""

from __future__ import annotations

from numba import njit

from lcmchain.threads import load_threading_library

load_threading_library()

# 'nnan' and 'ninf' are left out on purpose: they let the compiler delete the guards' checks.
FLOATING_POINT = {"contract", "nsz"}


def equation(function):
    """Compile a small scalar function that is inlined into the lane loop of a kernel.

    NumPy's error model keeps divisions free of the branch that would stop vectorisation.
    """
    return njit(
        error_model="numpy", fastmath=FLOATING_POINT, cache=True, forceinline=True
    )(function)


def strict_equation(function):
    """Compile like :func:`equation`, but with every operation rounded exactly as written."""
    return njit(error_model="numpy", cache=True, forceinline=True)(function)


def kernel(function):
    """Compile a loop over blocks of elements or chunks of nodes, parallel over the blocks."""
    return njit(
        error_model="numpy", fastmath=FLOATING_POINT, cache=True, parallel=True, nogil=True
    )(function)
