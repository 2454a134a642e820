"""Reference data of each element, as the kernels read it, and the products of modes (NumPy)."""

from __future__ import annotations

from typing import Literal

import numpy as np

from lcmchain.elements.blocks import (
    LANES,
    SharedBlocks,
    in_blocks,
    in_shared_blocks,
    own_blocks,
)
from lcmchain.elements.solid_shell.geometry import ReferenceGeometry
from lcmchain.elements.solid_shell.kernel import GENERAL

# Every product a_k·a_l (modes counted from 1) in the covariant strains, in the order in which
# ``covariant_products`` holds them: Taylor term, Voigt component, ((factor, k, l), ...).
COVARIANT_PRODUCTS = (
    ("centre", 0, ((0.5, 1, 1),)),
    ("centre", 1, ((0.5, 2, 2),)),
    ("centre", 2, ((0.5, 3, 3), (0.5, 5, 5), (0.5, 6, 6), (0.5, 7, 7))),
    ("centre", 3, ((1.0, 1, 2),)),
    ("centre", 4, ((1.0, 2, 3), (1.0, 4, 6))),
    ("centre", 5, ((1.0, 1, 3), (1.0, 4, 5))),
    ("zeta", 0, ((1.0, 1, 6),)),
    ("zeta", 1, ((1.0, 2, 5),)),
    ("zeta", 3, ((1.0, 1, 5), (1.0, 2, 6))),
    ("zeta", 4, ((1.0, 3, 5), (1.0, 6, 7))),
    ("zeta", 5, ((1.0, 3, 6), (1.0, 5, 7))),
    ("zeta2", 0, ((0.5, 6, 6),)),
    ("zeta2", 1, ((0.5, 5, 5),)),
    ("zeta2", 3, ((1.0, 5, 6),)),
    ("xi", 1, ((1.0, 2, 4),)),
    ("xi", 2, ((1.0, 3, 6), (1.0, 5, 7))),
    ("xi", 3, ((1.0, 1, 4),)),
    ("xi", 4, ((1.0, 2, 6), (1.0, 3, 4))),
    ("eta", 0, ((1.0, 1, 4),)),
    ("eta", 2, ((1.0, 3, 5), (1.0, 6, 7))),
    ("eta", 3, ((1.0, 2, 4),)),
    ("eta", 5, ((1.0, 1, 5), (1.0, 3, 4))),
    ("eta_zeta", 0, ((1.0, 1, 7), (1.0, 4, 6))),
    ("eta_zeta", 3, ((1.0, 2, 7), (1.0, 4, 5))),
    ("eta_zeta", 5, ((1.0, 3, 7), (1.0, 5, 6))),
    ("xi_zeta", 1, ((1.0, 2, 7), (1.0, 4, 5))),
    ("xi_zeta", 3, ((1.0, 1, 7), (1.0, 4, 6))),
    ("xi_zeta", 4, ((1.0, 3, 7), (1.0, 5, 6))),
)
TERMS = ("centre", "zeta", "zeta2", "xi", "eta", "eta_zeta", "xi_zeta")


#: Kinds of reference that kernels are compiled for, each a special case of the next one: flat
#: rectangles along the fibres, flat parallelograms, and any.
Kind = Literal["aligned", "flat", "curved"]
# Columns of their rows that have the same unit, one group behind the other.
GROUPS: dict[Kind, tuple[int, ...]] = {"aligned": (1,) * 25, "flat": (9, 4, 1, 1, 4)}


def kind_of(geometry: ReferenceGeometry) -> Kind:
    """Return the kind of the general kernel: the one whose constants all functions know."""
    return "flat" if geometry.flat.all() else "curved"


def quick_kind_of(geometry: ReferenceGeometry) -> Kind | None:
    """Return the kind of the quicker kernel that blocks of a sheet may have, or ``None``."""
    if geometry.flat.any() and geometry.aligned[geometry.flat].all():
        return "aligned"
    return "flat" if kind_of(geometry) == "curved" else None


def in_kind_blocks(rows: np.ndarray, kind: Kind) -> SharedBlocks:
    """Return the data of elements in blocks; those of a flat regular mesh share one."""
    if kind not in GROUPS:
        return own_blocks(rows)
    groups = GROUPS[kind]
    largest = np.abs(rows).max(axis=0)
    first = np.cumsum((0, *groups[:-1]))
    return in_shared_blocks(rows, np.repeat(np.maximum.reduceat(largest, first), groups))


def quick_blocks(geometry: ReferenceGeometry) -> SharedBlocks | None:
    """Return the data of blocks for the quicker kernel, ``None`` where it has none.

    The others begin at GENERAL.
    """
    kind = quick_kind_of(geometry)
    if kind is None:
        return None
    is_quick = in_blocks(geometry.flat[:, None]).reshape(-1, LANES)
    chosen = is_quick.all(axis=1)
    if not chosen.any():
        return None
    last = len(geometry.K) - 1
    elements = np.minimum(np.arange(is_quick.size), last).reshape(is_quick.shape)[chosen]
    rows = aligned_rows(geometry) if kind == "aligned" else flat_rows(geometry)
    data = in_kind_blocks(rows[elements.ravel()], kind)
    start = np.full(chosen.shape, GENERAL, dtype=np.int32)
    start[chosen] = data.start
    return data._replace(start=start)


def aligned_rows(geometry: ReferenceGeometry) -> np.ndarray:
    """Return the data (E, 25) of :class:`lcmchain.elements.solid_shell.equations.Lengths`.

    Rows of elements that are not aligned mean nothing.
    """
    k1, k2, h = geometry.K[:, 0, 0], geometry.K[:, 1, 1], 1.0 / geometry.height
    with np.errstate(divide="ignore"):
        xx, yy, zz = 1.0 / k1**2, 1.0 / k2**2, geometry.height**2
        curvature = (xx / h, yy / h, 1.0 / (k1 * k2 * h))
    modes = 0.125 * np.array([k1, k2, h, k1 * k2, k2 * h, k1 * h, k1 * k2 * h])
    moments = (zz, zz * zz, xx / 3.0, yy / 3.0, yy * zz / 9.0, xx * zz / 9.0)
    return np.column_stack([xx, yy, *modes, *(geometry.volume * modes), *curvature, *moments])


def flat_rows(geometry: ReferenceGeometry) -> np.ndarray:
    """Return the data (E, 19) of elements whose reference is a flat parallelogram."""
    K, h = geometry.K, 1.0 / geometry.height
    k11, k21, k12, k22 = K[:, 0, 0], K[:, 1, 0], K[:, 0, 1], K[:, 1, 1]
    P = (
        k11 * k11, k21 * k21, k11 * k21,
        k12 * k12, k22 * k22, k12 * k22,
        2 * k11 * k12, 2 * k21 * k22, k11 * k22 + k21 * k12,
    )  # fmt: skip
    Q = (h * k22, h * k12, h * k21, h * k11)
    reference = _reference_products(geometry.modes)[:, :4]
    return np.column_stack([*P, *Q, h, geometry.volume, reference])


def curved_rows(geometry: ReferenceGeometry) -> np.ndarray:
    """Return the data (E, 66) of elements with any reference."""
    count = len(geometry.K)
    return np.column_stack(
        [
            geometry.K.reshape(count, 9),
            geometry.dK.reshape(count, 27),
            1.0 / geometry.height,
            geometry.volume,
            _reference_products(geometry.modes),
        ]
    )


def _reference_products(A: np.ndarray) -> np.ndarray:
    columns = [
        sum(f * np.einsum("ed,ed->e", A[:, k - 1], A[:, m - 1]) for f, k, m in products)
        for _, _, products in COVARIANT_PRODUCTS
    ]
    return np.column_stack(columns)
