"""Stiffness of fibres in resin: of one family by micromechanics, and of several as a laminate.

Components stand in the order 11, 22, 33, 12, 13, 23 of CalculiX, with engineering shear strains.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from lcmchain.scene.structure import Fibre, Resin

# --- one family: models of micromechanics ---------------------------------------------------------


class Ply(NamedTuple):
    """Elastic constants of plies that are transversely isotropic about the fibre, each (C,).

    ``E1`` along the fibre, ``E2`` across it, ``G12`` [Pa]; ``nu12``, ``nu23`` [1].
    """

    E1: np.ndarray
    E2: np.ndarray
    G12: np.ndarray
    nu12: np.ndarray
    nu23: np.ndarray


def rule_of_mixtures(fibre: Fibre, resin: Resin, v: np.ndarray) -> Ply:
    """Equal strain along the fibres, equal stress in every other respect.

    Source: Jones, Mechanics of Composite Materials, 2nd edition (1999), section 3.2; the modulus in
    the plane across the fibres by the same rule as G12.
    """

    def series(of_fibre: float, of_resin: float) -> np.ndarray:
        return 1.0 / (v / of_fibre + (1.0 - v) / of_resin)

    return _from_shear(
        _parallel(fibre.E1, resin.E, v),
        series(fibre.across, resin.E),
        series(fibre.shear, resin.shear),
        _parallel(fibre.nu12, resin.nu, v),
        series(fibre.across_shear, resin.shear),
    )


def chamis(fibre: Fibre, resin: Resin, v: np.ndarray) -> Ply:
    """Fibres in a square array, cut into strips: E2 = Em / (1 - sqrt(v) (1 - Em / Ef2)).

    G12 and G23 have the same form. Source: Chamis, NASA TM-83320 (1983); Poisson's ratio across
    the fibres follows from E2 and G23, as isotropy in that plane demands.
    """

    def strips(of_fibre: float, of_resin: float) -> np.ndarray:
        return of_resin / (1.0 - np.sqrt(v) * (1.0 - of_resin / of_fibre))

    return _from_shear(
        _parallel(fibre.E1, resin.E, v),
        strips(fibre.across, resin.E),
        strips(fibre.shear, resin.shear),
        _parallel(fibre.nu12, resin.nu, v),
        strips(fibre.across_shear, resin.shear),
    )


def halpin_tsai(fibre: Fibre, resin: Resin, v: np.ndarray) -> Ply:
    """M = Mm (1 + x e v) / (1 - e v), e = (Mf / Mm - 1) / (Mf / Mm + x).

    x = 2 for E2, 1 for G12, and 1 / (3 - 4 nu_m) for G23. Source: Halpin and Kardos, Polymer
    Engineering and Science 16 (1976) 344.
    """

    def between(of_fibre: float, of_resin: float, shape: float) -> np.ndarray:
        ratio = of_fibre / of_resin
        efficiency = (ratio - 1.0) / (ratio + shape)
        return of_resin * (1.0 + shape * efficiency * v) / (1.0 - efficiency * v)

    return _from_shear(
        _parallel(fibre.E1, resin.E, v),
        between(fibre.across, resin.E, 2.0),
        between(fibre.shear, resin.shear, 1.0),
        _parallel(fibre.nu12, resin.nu, v),
        between(fibre.across_shear, resin.shear, 1.0 / (3.0 - 4.0 * resin.nu)),
    )


def mori_tanaka(fibre: Fibre, resin: Resin, v: np.ndarray) -> Ply:
    """Mean field of long cylinders (Mori and Tanaka, Acta Metallurgica 21 (1973) 571).

    For stiff fibres it is the lower bound of Hill and Hashin, in whose closed form it is written:
    Hashin, Journal of Applied Mechanics 46 (1979) 543, eqs. for the plane strain bulk modulus k,
    the shear moduli along (G12) and across (G23) the fibres, E1 and nu12.
    """
    shear, across_shear = resin.shear, fibre.across_shear
    bulk_of_resin = shear / (1.0 - 2.0 * resin.nu)
    bulk_of_fibre = 0.5 / (
        (1.0 - fibre.across_poisson) / fibre.across - 2.0 * fibre.nu12**2 / fibre.E1
    )

    def bound(of_fibre: float, of_resin: float, softness: float) -> np.ndarray:
        if of_fibre == of_resin:
            return np.full_like(v, of_resin)
        return of_resin + v / (1.0 / (of_fibre - of_resin) + (1.0 - v) * softness)

    bulk = bound(bulk_of_fibre, bulk_of_resin, 1.0 / (bulk_of_resin + shear))
    along = bound(fibre.shear, shear, 0.5 / shear)
    softness = (bulk_of_resin + 2.0 * shear) / (2.0 * shear * (bulk_of_resin + shear))
    across = bound(across_shear, shear, softness)
    coupling = v * (1.0 - v) / ((1.0 - v) / bulk_of_fibre + v / bulk_of_resin + 1.0 / shear)
    difference = fibre.nu12 - resin.nu
    E1 = _parallel(fibre.E1, resin.E, v) + 4.0 * difference**2 * coupling
    nu12 = _parallel(fibre.nu12, resin.nu, v) + difference * coupling * (
        1.0 / bulk_of_resin - 1.0 / bulk_of_fibre
    )
    stretch = 1.0 + 4.0 * bulk * nu12**2 / E1
    E2 = 4.0 * bulk * across / (bulk + stretch * across)
    return _from_shear(E1, E2, along, nu12, across)


def _parallel(of_fibre: float, of_resin: float, v: np.ndarray) -> np.ndarray:
    return v * of_fibre + (1.0 - v) * of_resin


def _from_shear(
    E1: np.ndarray, E2: np.ndarray, G12: np.ndarray, nu12: np.ndarray, G23: np.ndarray
) -> Ply:
    """Ply whose Poisson's ratio across the fibres is that of an isotropic plane: E2/(2 G23) - 1."""
    return Ply(E1, E2, G12, nu12, 0.5 * E2 / G23 - 1.0)


#: The models by the names that scenes give them.
MODELS: dict[str, Callable[[Fibre, Resin, np.ndarray], Ply]] = {
    model.__name__: model for model in (rule_of_mixtures, chamis, halpin_tsai, mori_tanaka)
}


# --- several families, and layers through the thickness -------------------------------------------

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
