"""Reference geometry of solid-shell elements, and its numbers as the kernels read them (NumPy).

Nodes and fibres give the material axes, the Jacobian and its change. How flat and aligned elements
are tells which of these numbers their kernel reads; they lie in blocks of elements.
"""

from __future__ import annotations

from typing import Literal, NamedTuple

import numpy as np

from lcmchain.elements.blocks import (
    LANES,
    SharedBlocks,
    in_blocks,
    in_shared_blocks,
    own_blocks,
)
from lcmchain.elements.solid_shell.kernel import GENERAL
from lcmchain.errors import InputError
from lcmchain.mesh.hexahedron import MODES

# Relative size of A4 ... A7 below which an element counts as a flat parallelogram: far above the
# round-off of a mesh generator (1e-13), far below a curvature or taper that anyone means.
FLATNESS_TOLERANCE = 1e-9
# Sine of the angle between edges and fibres below which a flat element counts as lying along them.
# What is left out is as small a part of the stress: far below what any result shows.
ALIGNMENT_TOLERANCE = 1e-11


class ReferenceGeometry(NamedTuple):
    """Reference geometry of E elements.

    modes : (E, 7, 3) mode vectors A1 ... A7 [m].
    axes : (E, 3, 3) rows e1 (fibre 1), e2, e3 (normal of A1 x A2).
    K : (E, 3, 3), ∂ξ_i/∂X_a at the centre [1/m].
    dK : (E, 3, 3, 3), derivative of K along ξ, η, ζ (first axis after E).
    height : (E,) A3·e3, half the thickness [m].
    volume : (E,) 8 J⁰ [m³].
    flat : (E,) whether K is constant and A3 is normal to the element.
    aligned : (E,) whether it is flat and its edges lie along the axes: K is diagonal.
    """

    modes: np.ndarray
    axes: np.ndarray
    K: np.ndarray
    dK: np.ndarray
    height: np.ndarray
    volume: np.ndarray
    flat: np.ndarray
    aligned: np.ndarray


def reference_geometry(nodes: np.ndarray, fibre_direction: np.ndarray) -> ReferenceGeometry:
    """Return the reference geometry of elements with corner positions ``nodes`` (E, 8, 3) [m].

    ``fibre_direction`` (E, 3) is projected on the mid-surface and gives the first material axis.

    Raises
    ------
    InputError : an element with no positive volume at its centre, or a fibre direction normal to
        the sheet.
    """
    A = np.einsum("kn,end->ekd", MODES, nodes)
    A1, A2, A3, A4, A5, A6 = (A[:, k] for k in range(6))
    normal = np.cross(A1, A2)
    area = np.linalg.norm(normal, axis=1)
    J0 = np.einsum("ed,ed->e", normal, A3)
    if np.any(~(J0 > 0.0)):
        bad = int(np.flatnonzero(~(J0 > 0.0))[0])
        raise InputError(
            f"element {bad} has no positive volume at its centre {nodes[bad].mean(axis=0)} m; "
            "check the node order (bottom face counter-clockwise seen from above, then top face)"
        )
    e3 = normal / area[:, None]
    e1 = fibre_direction - np.einsum("ed,ed->e", fibre_direction, e3)[:, None] * e3
    length = np.linalg.norm(e1, axis=1)
    if np.any(length < 1e-6):
        bad = int(np.flatnonzero(length < 1e-6)[0])
        raise InputError(f"element {bad}: the fibre direction is normal to the sheet")
    e1 = e1 / length[:, None]
    axes = np.stack([e1, np.cross(e3, e1), e3], axis=1)

    jacobian = np.einsum("ead,eid->eai", axes, A[:, :3])  # columns A1, A2, A3 in material axes
    K = np.linalg.inv(jacobian)
    zero = np.zeros_like(A1)
    changes = np.stack(  # derivatives of the columns along ξ, η, ζ
        [
            np.stack([zero, A4, A6], axis=1),
            np.stack([A4, zero, A5], axis=1),
            np.stack([A6, A5, zero], axis=1),
        ],
        axis=1,
    )
    d_jacobian = np.einsum("ead,ekid->ekai", axes, changes)
    dK = -np.einsum("eia,ekaj,ejb->ekib", K, d_jacobian, K)

    height = np.einsum("ed,ed->e", A3, e3)
    size = np.minimum(np.linalg.norm(A1, axis=1), np.linalg.norm(A2, axis=1))
    bent = np.linalg.norm(A[:, 3:], axis=2).max(axis=1)
    tilt = np.linalg.norm(A3 - height[:, None] * e3, axis=1)
    flat = (bent < FLATNESS_TOLERANCE * size) & (tilt < FLATNESS_TOLERANCE * height)
    across = np.abs([jacobian[:, 1, 0], jacobian[:, 0, 1]])
    along = np.abs([jacobian[:, 0, 0], jacobian[:, 1, 1]])
    aligned = flat & (across < ALIGNMENT_TOLERANCE * along).all(axis=0)
    return ReferenceGeometry(A, axes, K, dK, height, 8.0 * J0, flat, aligned)


def strain_transformation(K: np.ndarray, L: np.ndarray) -> np.ndarray:
    """Return the Voigt matrices (E, 6, 6) of Ē -> ½(K_ip L_jq + L_ip K_jq) Ē_ij, engineering shear.

    With L = K it is T⁰; with L = 2 dK it is the first-order change of T along that direction.
    """
    pairs = ((0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (0, 2))
    T = np.zeros((len(K), 6, 6))
    for row, (p, q) in enumerate(pairs):
        for column, (i, j) in enumerate(pairs):
            value = K[:, i, p] * L[:, j, q] + L[:, i, p] * K[:, j, q]
            value = value + K[:, j, p] * L[:, i, q] + L[:, j, p] * K[:, i, q]
            # both orders of (i, j) are one engineering shear; a diagonal entry was counted twice
            T[:, row, column] = 0.25 * value * (1.0 if p == q else 2.0)
    return T


# --- the numbers of each element, and the products of modes ---------------------------------------

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
