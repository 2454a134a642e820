"""Permeability of fibre beds and of textiles with one to three fibre families.

Laws for aligned fibres give the permeability along and across the fibres as a function of the
fibre volume fraction; a textile's principal permeabilities follow from its fibre families.
The laws describe the flow between the fibres. In textiles with gaps between their tows, such as
non-crimp fabrics, the gaps carry most of the flow: the bulk permeability can be ten times larger,
and a measured law (:mod:`lcmchain.coupling.measured_permeability`) should be used instead.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from lcmchain.coupling.measured_permeability import (
    MEASURED_LAWS,
    MeasuredPermeability,
    measured_law,
)
from lcmchain.coupling.principal_permeability import PrincipalPermeabilities, unit, within
from lcmchain.errors import InputError
from lcmchain.scene.infiltration.laws import Permeability

LAWS = ("gebart", "kozeny_carman")

# Fibre volume fraction at which neighbouring fibres touch.
TOUCHING = {"quadratic": np.pi / 4.0, "hexagonal": np.pi / (2.0 * np.sqrt(3.0))}
GEBART_SHAPE_FACTOR = {"quadratic": 57.0, "hexagonal": 53.0}
GEBART_GAP_FACTOR = {
    "quadratic": 16.0 / (9.0 * np.pi * np.sqrt(2.0)),
    "hexagonal": 16.0 / (9.0 * np.pi * np.sqrt(6.0)),
}


@dataclass(frozen=True)
class PermeabilityLaw:
    """Permeability of a bed of aligned fibres.

    Parameters
    ----------
    law : ``"gebart"`` or ``"kozeny_carman"``.
    fibre_radius : [m].
    packing : ``"quadratic"`` or ``"hexagonal"`` arrangement of the fibres (Gebart).
    k_along, k_across : Kozeny constants along and across the fibres (Kozeny-Carman); the usual
        ranges are 0.5 to 0.7 and 11 to 18.

    Raises
    ------
    InputError : unknown law or packing, or a number that is not positive.
    """

    law: str = "gebart"
    fibre_radius: float = 3.5e-6
    packing: str = "quadratic"
    k_along: float = 0.6
    k_across: float = 15.0

    def __post_init__(self) -> None:
        _choice("law", self.law, LAWS)
        _choice("packing", self.packing, TOUCHING)
        for name in ("fibre_radius", "k_along", "k_across"):
            value = getattr(self, name)
            if not (np.isfinite(value) and value > 0.0):
                raise InputError(f"has to be positive, not {value}", key=f"permeability.{name}")

    @property
    def largest_fibre_volume_fraction(self) -> float:
        """Fibre volume fraction that the law cannot reach: the fibres touch, or no pore is left."""
        return TOUCHING[self.packing] if self.law == "gebart" else 1.0

    @property
    def in_words(self) -> str:
        """Name of the law, with the packing where its range depends on it, for messages."""
        return self.law + (f" with {self.packing} packing" if self.law == "gebart" else "")

    @property
    def advice(self) -> str:
        """Remedy for fibres that are packed too densely, for messages."""
        if self.law == "gebart" and self.packing == "quadratic":
            return "; choose hexagonal packing, which reaches 0.907, or a softer compaction law"
        return ""

    def factor(self, now: np.ndarray, before: np.ndarray) -> np.ndarray:
        """Return the mean permeability in the plane at fibre volume fractions over that before."""
        later, earlier = (np.sum(aligned_permeabilities(self, v), axis=0) for v in (now, before))
        return later / earlier

    def principal(
        self,
        fibre_volume_fraction: np.ndarray,
        fibre_direction_1: np.ndarray,
        fibre_direction_2: np.ndarray,
        *,
        out_of_range: str = "raise",
    ) -> PrincipalPermeabilities:
        """Principal permeabilities of two equal families, see :func:`principal_permeabilities`."""
        along, across = aligned_permeabilities(
            self, fibre_volume_fraction, out_of_range=out_of_range
        )
        a1 = np.asarray(fibre_direction_1, dtype=float)
        a2 = np.asarray(fibre_direction_2, dtype=float)
        normal = np.cross(a1, a2)
        # signs for which the angle is at most a right one, so that the sum bisects it
        cosine = np.einsum("ci,ci->c", a1, a2)
        a2 = np.where(cosine[:, None] < 0.0, -a2, a2)
        cosine = np.abs(cosine)
        acute = unit(a1 + a2)
        normal = unit(normal)
        # Mean of (along - across) a⊗a over the families: the values (1 ± cosine) / 2 on the axes.
        k1 = across + (along - across) * 0.5 * (1.0 + cosine)
        k2 = across + (along - across) * 0.5 * (1.0 - cosine)
        return PrincipalPermeabilities(k1, k2, across, acute, np.cross(normal, acute), normal)

    def of_one(
        self,
        fibre_volume_fraction: np.ndarray,
        fibre_direction: np.ndarray,
        normal: np.ndarray,
        *,
        out_of_range: str = "raise",
    ) -> PrincipalPermeabilities:
        """Principal permeabilities of one family in a sheet with unit normals (C, 3)."""
        along, across = aligned_permeabilities(
            self, fibre_volume_fraction, out_of_range=out_of_range
        )
        side = unit(np.cross(normal, fibre_direction))
        return PrincipalPermeabilities(
            along, across, across, unit(fibre_direction), side, unit(normal)
        )

    def of_three(
        self,
        fibre_volume_fraction: np.ndarray,
        families: Sequence[np.ndarray],
        normal: np.ndarray,
        *,
        out_of_range: str = "raise",
    ) -> PrincipalPermeabilities:
        """Principal permeabilities of three equal families (C, 3) each."""
        along, across = aligned_permeabilities(
            self, fibre_volume_fraction, out_of_range=out_of_range
        )
        first = unit(families[0])
        side = unit(np.cross(normal, first))
        # mean of a⊗a in the plane, over axes along and across the first family
        parts = np.array(
            [[np.einsum("ci,ci->c", unit(a), b) for b in (first, side)] for a in families]
        )
        xx, yy = (parts**2).mean(axis=0)
        xy = (parts[:, 0] * parts[:, 1]).mean(axis=0)
        half = np.hypot(0.5 * (xx - yy), xy)
        turn = 0.5 * np.arctan2(xy, 0.5 * (xx - yy))[:, None]
        axis = np.cos(turn) * first + np.sin(turn) * side
        middle = 0.5 * (xx + yy)
        k1 = across + (along - across) * (middle + half)
        k2 = across + (along - across) * (middle - half)
        return PrincipalPermeabilities(k1, k2, across, axis, np.cross(normal, axis), unit(normal))


def gebart(
    fibre_volume_fraction: ArrayLike, fibre_radius: float, packing: str = "quadratic"
) -> tuple[np.ndarray, np.ndarray]:
    """Permeability along and across aligned fibres [m2] after Gebart.

    Along: exact duct flow in form; across: lubrication in the gaps between neighbouring fibres,
    good from about 0.35 up to the touching fraction (pi/4 quadratic, pi/(2 sqrt 3) hexagonal),
    where it vanishes; beyond it is not a number.

    Source: B. R. Gebart, Journal of Composite Materials 26 (1992) 1100.
    """
    _choice("packing", packing, TOUCHING)
    v = np.asarray(fibre_volume_fraction, dtype=float)
    touching = TOUCHING[packing]
    with np.errstate(invalid="ignore", divide="ignore"):
        v = np.where((v > 0.0) & (v <= touching), v, np.nan)
        along = 8.0 * fibre_radius**2 / GEBART_SHAPE_FACTOR[packing] * (1.0 - v) ** 3 / v**2
        gap = np.sqrt(touching / v) - 1.0
        across = GEBART_GAP_FACTOR[packing] * gap**2.5 * fibre_radius**2
    return along, across


def kozeny_carman(
    fibre_volume_fraction: ArrayLike, fibre_radius: float, kozeny_constant: float
) -> np.ndarray:
    """Permeability of a fibre bed [m2] after Kozeny and Carman: r² (1 - v)³ / (4 k v²).

    Holds for 0 < v < 1 as a fit; across the fibres it misses that the flow stops where fibres
    touch. Not a number outside.

    Source: P. C. Carman, Transactions of the Institution of Chemical Engineers 15 (1937) 150;
    form for fibres: T. G. Gutowski et al., Journal of Composite Materials 21 (1987) 172.
    """
    v = np.asarray(fibre_volume_fraction, dtype=float)
    with np.errstate(invalid="ignore", divide="ignore"):
        v = np.where((v > 0.0) & (v < 1.0), v, np.nan)
        return fibre_radius**2 / (4.0 * kozeny_constant) * (1.0 - v) ** 3 / v**2


def aligned_permeabilities(
    law: PermeabilityLaw | Permeability,
    fibre_volume_fraction: ArrayLike,
    *,
    out_of_range: str = "raise",
) -> tuple[np.ndarray, np.ndarray]:
    """Permeability along and across aligned fibres [m2].

    Parameters
    ----------
    law : a :class:`PermeabilityLaw`, or the scene's ``permeability`` entry, which has its names.
    fibre_volume_fraction : of any shape.
    out_of_range : ``"raise"`` stops where the law does not hold; ``"nan"`` marks these places as
        not-a-number and leaves them to the caller. A value is never clamped: a cell beyond the
        packing limit has no permeability that a fill simulation should trust.

    Raises
    ------
    InputError : a fibre volume fraction outside 0 to the law's largest (not included), unless
        ``out_of_range="nan"``; the message names the first cells and the worst value. A value
        that is not a number (an unmapped cell) stays one.
    """
    _choice("out_of_range", out_of_range, ("raise", "nan"))
    law = _aligned_law(law)
    v = np.asarray(fibre_volume_fraction, dtype=float)
    limit = law.largest_fibre_volume_fraction
    outside = (v <= 0.0) | (v >= limit)
    v = within(
        v, outside, (0.0, limit), name=law.in_words, out_of_range=out_of_range, advice=law.advice
    )
    if law.law == "gebart":
        return gebart(v, law.fibre_radius, law.packing)
    return (
        kozeny_carman(v, law.fibre_radius, law.k_along),
        kozeny_carman(v, law.fibre_radius, law.k_across),
    )


def principal_permeabilities(
    law: PermeabilityLaw | MeasuredPermeability | Permeability,
    fibre_volume_fraction: np.ndarray,
    *families: np.ndarray,
    normal: np.ndarray | None = None,
    out_of_range: str = "raise",
    directory: Path | None = None,
) -> PrincipalPermeabilities:
    """Principal permeabilities of a textile with one, two or three fibre families.

    With a law of aligned fibres each family is a ply with its share of the thickness. Along the
    sheet the plies conduct side by side: the permeability tensor is their mean, so that shear of
    two families turns its axes to their bisectors and stretches it along the acute one. Through the
    thickness they conduct one after the other, all across their fibres. A measured law is carried
    along by the fibres (:meth:`MeasuredPermeability.principal`), of a single family by the fibres
    and the line across them in the present sheet.

    Parameters
    ----------
    law : as in :func:`aligned_permeabilities`, or a measured one.
    out_of_range : as in :func:`aligned_permeabilities`.
    fibre_volume_fraction : shape (C,).
    families : unit vectors, shape (C, 3) each; their sign has no meaning but for a measured law
        whose axes lie between the fibres. A second or third one that is not a number in a cell is
        not there.
    normal : of the sheet, unit vectors (C, 3), where cells have other than two families.
    directory : folder to which a file that the scene's entry names is relative.

    Raises
    ------
    InputError : outside the range of the law (see :func:`aligned_permeabilities`), or a table that
        cannot be read, or a measured law for three families.
    """
    found = law_of(law, directory)
    directions = [np.asarray(family, dtype=float) for family in families]
    there = np.array([np.isfinite(family).all(axis=1) for family in directions])
    # cells without any direction are unmapped: nothing is known of them, whatever is asked
    count = np.where(there.any(axis=0), there.sum(axis=0), 2)
    if len(directions) == 2 and (count == 2).all():
        return found.principal(fibre_volume_fraction, *directions, out_of_range=out_of_range)
    result = PrincipalPermeabilities(
        *(np.full(len(count), np.nan) for _ in range(3)),
        *(np.full((len(count), 3), np.nan) for _ in range(3)),
    )
    for number in np.unique(count):
        cells = np.flatnonzero((count == number) & there[0])
        if not len(cells):
            continue
        own = [family[cells] for family in directions[:number]]
        of_cells = _of_families(
            found, np.asarray(fibre_volume_fraction)[cells], own, normal, cells, out_of_range
        )
        for whole, part in zip(result, of_cells, strict=True):
            whole[cells] = part
    return result


def _of_families(law, fraction, families, normal, cells, out_of_range) -> PrincipalPermeabilities:
    """Return what a law makes of cells that all have so many families."""
    if len(families) == 2:
        return law.principal(fraction, *families, out_of_range=out_of_range)
    if normal is None:
        raise ValueError("cells with other than two families need the normals of the sheet")
    own = np.asarray(normal)[cells]
    if isinstance(law, PermeabilityLaw):
        if len(families) == 1:
            return law.of_one(fraction, families[0], own, out_of_range=out_of_range)
        return law.of_three(fraction, families, own, out_of_range=out_of_range)
    if len(families) == 3:
        raise InputError(
            f'is "{law.law}", a measured law, which one or two families carry along; the fabric '
            'has three: use "gebart" or "kozeny_carman"',
            key="permeability.law",
        )
    side = unit(np.cross(own, families[0]))
    return law.principal(fraction, families[0], side, out_of_range=out_of_range)


def law_of(
    law: PermeabilityLaw | MeasuredPermeability | Permeability, directory: Path | None = None
) -> PermeabilityLaw | MeasuredPermeability:
    """Return the law of a scene's ``permeability`` entry; a law is returned as it is.

    Parameters
    ----------
    directory : folder to which a file that the entry names is relative.

    Raises
    ------
    InputError : a table that cannot be read.
    """
    if isinstance(law, PermeabilityLaw | MeasuredPermeability):
        return law
    return measured_law(law, directory) if law.law in MEASURED_LAWS else _aligned_law(law)


def _aligned_law(law: PermeabilityLaw | Permeability) -> PermeabilityLaw:
    if isinstance(law, PermeabilityLaw):
        return law
    names = ("law", "fibre_radius", "packing", "k_along", "k_across")
    given = {name: getattr(law, name, None) for name in names}
    return PermeabilityLaw(**{name: value for name, value in given.items() if value is not None})


def _choice(name: str, value: str, known) -> None:
    if value not in known:
        raise InputError(
            f'"{value}" is unknown; write one of {", ".join(known)}', key=f"permeability.{name}"
        )
