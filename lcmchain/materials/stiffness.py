"""Products with a stiffness, of which there are three structures.

Six moduli where it is diagonal (Eqs. 20 and 25), :class:`Orthotropic` where only the normal strains
are coupled, else six rows. Which of them is decided by its type, when a kernel is compiled.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

from numba import types
from numba.core.dispatcher import Dispatcher
from numba.extending import overload

from lcmchain.jit import equation


class Orthotropic(NamedTuple):
    """Moduli of a symmetric stiffness in the axes of orthotropy [Pa], shear strains engineering."""

    C11: Any
    C22: Any
    C33: Any
    C12: Any
    C13: Any
    C23: Any
    G12: Any
    G23: Any
    G13: Any


# Where the fields of ``Orthotropic`` stand in a matrix; its other entries are zero.
ROWS = (0, 1, 2, 0, 0, 1, 3, 4, 5)
COLUMNS = (0, 1, 2, 1, 2, 2, 3, 4, 5)


def by_structure(
    diagonal: Dispatcher, orthotropic: Dispatcher, full: Dispatcher
) -> Callable[..., Any]:
    """Return a function that is one of the three after the structure of its first argument.

    All are compiled functions with the same options.
    """

    def function(C, *rest):
        if isinstance(C, Orthotropic):
            return orthotropic(C, *rest)
        return (full if isinstance(C[0], tuple) else diagonal)(C, *rest)

    def choose(C, *rest):
        if getattr(C, "instance_class", None) is Orthotropic:
            return orthotropic.py_func
        return (full if isinstance(C.dtype, types.BaseTuple) else diagonal).py_func

    options: Any = {k: v for k, v in diagonal.targetoptions.items() if k != "nopython"}
    overload(function, jit_options=options, strict=False)(choose)
    return function


@equation
def diagonal_product(C, E):
    """Return C : E for a diagonal C, Eqs. (20) and (25)."""
    return (C[0] * E[0], C[1] * E[1], C[2] * E[2], C[3] * E[3], C[4] * E[4], C[5] * E[5])


@equation
def orthotropic_product(C, E):
    """Return C : E for a stiffness that couples the normal strains alone."""
    return (
        C.C11 * E[0] + C.C12 * E[1] + C.C13 * E[2],
        C.C12 * E[0] + C.C22 * E[1] + C.C23 * E[2],
        C.C13 * E[0] + C.C23 * E[1] + C.C33 * E[2],
        C.G12 * E[3],
        C.G23 * E[4],
        C.G13 * E[5],
    )


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


product = by_structure(diagonal_product, orthotropic_product, full_product)


@equation
def orthotropic_rows(C):
    """Return the six rows of a stiffness that couples the normal strains alone."""
    return (
        (C.C11, C.C12, C.C13, 0.0, 0.0, 0.0),
        (C.C12, C.C22, C.C23, 0.0, 0.0, 0.0),
        (C.C13, C.C23, C.C33, 0.0, 0.0, 0.0),
        (0.0, 0.0, 0.0, C.G12, 0.0, 0.0),
        (0.0, 0.0, 0.0, 0.0, C.G23, 0.0),
        (0.0, 0.0, 0.0, 0.0, 0.0, C.G13),
    )
