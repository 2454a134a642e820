"""Reference geometry of solid-shell elements: material axes, Jacobian, and its change (NumPy)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

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
