"""Products with a stiffness, of which there are four structures.

Six moduli where it is diagonal (Eqs. 20 and 25), :class:`Orthotropic` where only the normal strains
are coupled, :class:`AlongFibres` for moduli of directions in the plane, else six rows. Which of
them is decided by its type, when a kernel is compiled.
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


class AlongFibres(NamedTuple):
    """A stiffness Σ m r ⊗ r of three strains and three shears in the plane, and 33, 23, 13 [Pa].

    normal, shear : their moduli. largest : what those of ``normal`` may become.
    fibre : of each strain, 1 where a share of the fibres is meant.
    along, between : what reads the strains and shears from (E11, E22, 2 E12), three numbers each.
    """

    normal: Any
    largest: Any
    shear: Any
    C33: Any
    C23: Any
    C13: Any
    fibre: Any
    along: Any
    between: Any


# Where the fields of ``Orthotropic`` stand in a matrix; its other entries are zero.
ROWS = (0, 1, 2, 0, 0, 1, 3, 4, 5)
COLUMNS = (0, 1, 2, 1, 2, 2, 3, 4, 5)


def by_structure(
    diagonal: Dispatcher, orthotropic: Dispatcher, along_fibres: Dispatcher, full: Dispatcher
) -> Callable[..., Any]:
    """Return a function that is one of the four after the structure of its first argument.

    All are compiled functions with the same options.
    """

    def function(C, *rest):
        if isinstance(C, Orthotropic):
            return orthotropic(C, *rest)
        if isinstance(C, AlongFibres):
            return along_fibres(C, *rest)
        return (full if isinstance(C[0], tuple) else diagonal)(C, *rest)

    def choose(C, *rest):
        if getattr(C, "instance_class", None) is Orthotropic:
            return orthotropic.py_func
        if getattr(C, "instance_class", None) is AlongFibres:
            return along_fibres.py_func
        # a tuple of six of one type; one of several types is a diagonal with parts that are None
        inner = getattr(C, "dtype", None)
        return (full if isinstance(inner, types.BaseTuple) else diagonal).py_func

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


@equation
def read_by(reader, E):
    """Return the strain or shear that a reader of :class:`AlongFibres` takes from E."""
    return reader[0] * E[0] + reader[1] * E[1] + reader[2] * E[3]


@equation
def in_axes(along, normal, between, shear, i):
    """Return component i of (11, 22, 12) of Σ m r."""
    return (
        along[0][i] * normal[0] + along[1][i] * normal[1] + along[2][i] * normal[2]
        + (between[0][i] * shear[0] + between[1][i] * shear[1] + between[2][i] * shear[2])
    )  # fmt: skip


@equation
def along_fibres_product(C, E):
    """Return C : E for moduli of directions in the plane."""
    a, b, m, k = C.along, C.between, C.normal, C.shear
    n = (m[0] * read_by(a[0], E), m[1] * read_by(a[1], E), m[2] * read_by(a[2], E))
    s = (k[0] * read_by(b[0], E), k[1] * read_by(b[1], E), k[2] * read_by(b[2], E))
    return (
        in_axes(a, n, b, s, 0),
        in_axes(a, n, b, s, 1),
        C.C33 * E[2],
        in_axes(a, n, b, s, 2),
        C.C23 * E[4],
        C.C13 * E[5],
    )


product = by_structure(diagonal_product, orthotropic_product, along_fibres_product, full_product)


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
