"""Stiffness of aligned fibres in resin from both and the fibre volume fraction."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from lcmchain.scene.structure import Fibre, Resin


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
