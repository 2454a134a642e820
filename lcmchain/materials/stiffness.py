"""Products with a stiffness: six moduli where it is diagonal (Eqs. 20 and 25), else six rows.

Which of the two is decided by its type, when a kernel is compiled.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from numba import types
from numba.core.dispatcher import Dispatcher
from numba.extending import overload

from lcmchain.jit import equation


def by_structure(diagonal: Dispatcher, full: Dispatcher) -> Callable[..., Any]:
    """Return a function that is ``diagonal`` or ``full`` after its first argument, a stiffness.

    Both are compiled functions with the same options.
    """

    def function(C, *rest):
        return (full if isinstance(C[0], tuple) else diagonal)(C, *rest)

    def choose(C, *rest):
        chosen = full if isinstance(C.dtype, types.BaseTuple) else diagonal
        return chosen.py_func

    options: Any = {k: v for k, v in diagonal.targetoptions.items() if k != "nopython"}
    overload(function, jit_options=options, strict=False)(choose)
    return function


@equation
def diagonal_product(C, E):
    """Return C : E for a diagonal C, Eqs. (20) and (25)."""
    return (C[0] * E[0], C[1] * E[1], C[2] * E[2], C[3] * E[3], C[4] * E[4], C[5] * E[5])


@equation
def row_product(c, E):
    return c[0] * E[0] + c[1] * E[1] + c[2] * E[2] + c[3] * E[3] + c[4] * E[4] + c[5] * E[5]


@equation
def full_product(C, E):
    """Return C : E for the rows of C."""
    return (
        row_product(C[0], E),
        row_product(C[1], E),
        row_product(C[2], E),
        row_product(C[3], E),
        row_product(C[4], E),
        row_product(C[5], E),
    )


product = by_structure(diagonal_product, full_product)
