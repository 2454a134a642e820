"""Stiffness of plies, turned about the normal, and of the laminate that they make.

Components stand in the order 11, 22, 33, 12, 13, 23 of CalculiX, with engineering shear strains.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from lcmchain.mapping.structure.micromechanics import Ply

#: Rows of the stresses in the plane, and of those on it.
IN_PLANE = np.array([0, 1, 3])
THROUGH = np.array([2, 4, 5])


class LaminateStiffness(NamedTuple):
    """Stiffness of laminates by classical theory, each (C, 3, 3) with rows 11, 22, 12.

    ``A`` [N/m] of extension, ``B`` [N] of coupling, ``D`` [N m] of bending.
    """

    A: np.ndarray
    B: np.ndarray
    D: np.ndarray


def ply_stiffness(ply: Ply) -> np.ndarray:
    """Stiffness of plies in their own axes [Pa], shape (C, 6, 6); the fibre runs along 1."""
    compliance = np.zeros((len(ply.E1), 6, 6))
    compliance[:, 0, 0] = 1.0 / ply.E1
    compliance[:, 1, 1] = compliance[:, 2, 2] = 1.0 / ply.E2
    for row, column, value in (
        (0, 1, ply.nu12 / ply.E1),
        (0, 2, ply.nu12 / ply.E1),
        (1, 2, ply.nu23 / ply.E2),
    ):
        compliance[:, row, column] = compliance[:, column, row] = -value
    compliance[:, 3, 3] = compliance[:, 4, 4] = 1.0 / ply.G12
    compliance[:, 5, 5] = 2.0 * (1.0 + ply.nu23) / ply.E2
    return np.linalg.inv(compliance)


def turned(stiffness: np.ndarray, angle: np.ndarray) -> np.ndarray:
    """Stiffness (C, 6, 6) of plies whose fibres lie at angles (C,) [rad] from axis 1 to axis 2.

    Stresses turn by T, and strains, whose shear is doubled, by its inverse transposed: T C T^T.
    """
    c, s = np.cos(angle), np.sin(angle)
    turn = np.zeros((len(angle), 6, 6))
    turn[:, 0, 0] = turn[:, 1, 1] = c * c
    turn[:, 0, 1] = turn[:, 1, 0] = s * s
    turn[:, 0, 3], turn[:, 1, 3] = -2.0 * c * s, 2.0 * c * s
    turn[:, 2, 2] = 1.0
    turn[:, 3, 0], turn[:, 3, 1], turn[:, 3, 3] = c * s, -c * s, c * c - s * s
    turn[:, 4, 4] = turn[:, 5, 5] = c
    turn[:, 4, 5], turn[:, 5, 4] = -s, s
    return turn @ stiffness @ turn.transpose(0, 2, 1)


def homogenised(plies: Sequence[np.ndarray], shares: Sequence[ArrayLike]) -> np.ndarray:
    """Stiffness of many thin plies as one material [Pa], shape (C, 6, 6).

    The plies have the same strains in the plane and the same stresses on it (iso-strain and
    iso-stress): exact for a laminate of many repeats. Source: Chou, Carleone, Hsu, Journal of
    Composite Materials 6 (1972) 80; Sun and Li, ibid. 22 (1988) 629.

    Parameters
    ----------
    plies : stiffness of each ply in the axes of the cell, (C, 6, 6).
    shares : of each ply in the thickness, one number or (C,).
    """
    soft, mixed, plane = (np.zeros((len(plies[0]), 3, 3)) for _ in range(3))
    for ply, part in zip(plies, shares):
        share = np.asarray(part, dtype=float).reshape(-1, 1, 1)
        inverse = np.linalg.inv(_block(ply, THROUGH, THROUGH))
        soft += share * inverse
        mixed += share * _block(ply, IN_PLANE, THROUGH) @ inverse
        plane += share * reduced(ply)
    through = np.linalg.inv(soft)
    mixed_through = mixed @ through
    result = np.empty_like(plies[0])
    _put(result, IN_PLANE, IN_PLANE, plane + mixed_through @ _transposed(mixed))
    _put(result, IN_PLANE, THROUGH, mixed_through)
    _put(result, THROUGH, IN_PLANE, _transposed(mixed_through))
    _put(result, THROUGH, THROUGH, through)
    return 0.5 * (result + _transposed(result))  # symmetric but for round-off


def reduced(stiffness: np.ndarray) -> np.ndarray:
    """Stiffness in the plane where no stresses act on it [Pa], shape (C, 3, 3), rows 11, 22, 12."""
    mixed = _block(stiffness, IN_PLANE, THROUGH)
    through = _block(stiffness, THROUGH, THROUGH)
    return _block(stiffness, IN_PLANE, IN_PLANE) - mixed @ np.linalg.solve(
        through, _transposed(mixed)
    )


def laminate(
    layers: Sequence[tuple[np.ndarray, ArrayLike]], thickness: np.ndarray
) -> LaminateStiffness:
    """Stiffness of laminates about their mid-surface by classical laminate theory.

    Parameters
    ----------
    layers : from the lowest to the highest, the stiffness (C, 6, 6) of each in the axes of the
        cell, and its share of the thickness, one number or (C,).
    thickness : of the cells [m], (C,).

    Source: Jones, Mechanics of Composite Materials, 2nd edition (1999), eqs. (4.22) to (4.24).
    """
    lower = np.full((1, 1, 1), -0.5)
    moments = [np.zeros((len(thickness), 3, 3)) for _ in range(3)]
    for stiffness, share in layers:
        part = np.asarray(share, dtype=float).reshape(-1, 1, 1)
        plane, upper = reduced(stiffness), lower + part
        for order, total in enumerate(moments, start=1):
            total += plane * (upper**order - lower**order) / order
        lower = upper
    A, B, D = (
        total * thickness[:, None, None] ** order for order, total in enumerate(moments, start=1)
    )
    return LaminateStiffness(A, B, D)


def interleaved(plane: np.ndarray, thickness: np.ndarray) -> LaminateStiffness:
    """Stiffness of laminates that are the same over the thickness: D = A t^2 / 12, B = 0."""
    A = plane * thickness[:, None, None]
    return LaminateStiffness(A, np.zeros_like(A), A * thickness[:, None, None] ** 2 / 12.0)


def _block(stiffness: np.ndarray, rows: np.ndarray, columns: np.ndarray) -> np.ndarray:
    return stiffness[:, rows[:, None], columns[None, :]]


def _put(stiffness: np.ndarray, rows: np.ndarray, columns: np.ndarray, values: np.ndarray) -> None:
    stiffness[:, rows[:, None], columns[None, :]] = values


def _transposed(matrices: np.ndarray) -> np.ndarray:
    return matrices.transpose(0, 2, 1)
