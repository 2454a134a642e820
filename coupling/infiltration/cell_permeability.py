"""Permeability of the cells of a part: its check, and how it follows compaction."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from lcmchain.coupling.infiltration.flow.preform import PermeabilityFactor, kozeny_factor
from lcmchain.coupling.infiltration.formed_part import NEEDED, FormedPart, fibre_directions
from lcmchain.coupling.measured_permeability import MeasuredPermeability
from lcmchain.coupling.permeability import (
    PermeabilityLaw,
    law_of,
    principal_permeabilities,
)
from lcmchain.coupling.solids.stack_compaction import StackCompaction, compaction_of
from lcmchain.errors import InputError, SimulationError, first_few
from lcmchain.mapping.sheet import SHARE
from lcmchain.scene.infiltration.laws import Permeability
from lcmchain.scene.reading.single_tables import formed_permeability


def require_permeable(part: FormedPart) -> None:
    """Refuse cells through which nothing can flow.

    Raises
    ------
    InputError : a cell without thickness (unmapped), with no pores, or whose permeability is
        unknown, zero or negative; names the first cells and where the worst one lies.
    """
    thickness, fraction = (part.cell(name) for name in NEEDED)
    remedy = (
        "trim the mesh to the sheet, or map with a larger maximum distance",
        "the compaction law lets the textile become denser than its fibres: check it, the areal "
        "mass and the fibre density, or give a [[regions]] entry there",
        "the fibre volume fraction is out of the range of the permeability law: use another law "
        "or packing (hexagonal reaches 0.907), or a [[regions]] entry with a "
        "fibre_volume_fraction there",
        "nothing can flow there; check the law, or the file that it comes from",
        "check the file; of an open channel beside the textile make a [[race_tracks]] entry",
    )
    smaller = part.cell("permeability_2")
    larger = part.cell("permeability_1")
    _refuse(part, ~(np.isfinite(thickness) & np.isfinite(fraction)), "have no thickness: no sheet "
            "lies near them", fraction, "", remedy[0])  # fmt: skip
    _refuse(part, thickness <= 0.0, "have a thickness that is not positive", thickness, "m",
            remedy[0])  # fmt: skip
    _refuse(part, fraction >= 1.0, "have a fibre volume fraction of one or more, so no pores",
            -fraction, "", remedy[1])  # fmt: skip
    _refuse(part, fraction <= 0.0, "have a fibre volume fraction of zero or less, so no textile",
            fraction, "", remedy[4])  # fmt: skip
    _refuse(part, ~(np.isfinite(smaller) & np.isfinite(larger)), "have no permeability",
            -fraction, "fibre volume fraction", remedy[2])  # fmt: skip
    _refuse(part, np.minimum(smaller, larger) <= 0.0, "have a permeability of zero or less",
            np.minimum(smaller, larger), "m2", remedy[3])  # fmt: skip


def _refuse(
    part: FormedPart, bad: np.ndarray, what: str, order: np.ndarray, unit: str, remedy: str
) -> None:
    """Raise an error about bad cells, of which the worst has the lowest value of ``order``."""
    cells = np.flatnonzero(bad)
    if len(cells) == 0:
        return
    known = np.where(np.isfinite(order[cells]), order[cells], np.inf)
    worst = int(cells[np.argmin(known)])
    value = ""
    if np.isfinite(order[worst]):
        number = abs(order[worst]) if unit in ("", "fibre volume fraction") else order[worst]
        value = f" with {f'{unit} ' if unit.startswith('fibre') else ''}{number:.4g}"
        value += f" {unit}" if unit in ("m", "m2") else ""
    raise InputError(
        f"{len(cells)} of {part.target.cell_count} cells {what} "
        f"({first_few(part.target.cell_ids[cells])}; the worst is {part.place(worst)}{value}); "
        f"{remedy}",
        file=part.file,
    )


# --- the permeability over the fibre volume fraction ----------------------------------------------


class LawFactor:
    """Factor on the permeabilities of cells by a law: that of the sum of both values in the plane.

    Parameters
    ----------
    law : of the scene.
    part : with the fibre directions of its cells.
    directory : folder to which a file of the law is relative.
    """

    def __init__(self, law: Permeability, part: FormedPart, directory: Path | None) -> None:
        self.law, self.part = law_of(law, directory), part
        self._families = fibre_directions(part)

    def __call__(self, now: np.ndarray, before: np.ndarray) -> np.ndarray:
        """Return the factors (C,) for fibre volume fractions (C,) now and in the beginning.

        Raises
        ------
        SimulationError : a fibre volume fraction is out of the range of the law.
        """
        return self._in_plane(now) / self._in_plane(before)

    def _in_plane(self, fraction: np.ndarray) -> np.ndarray:
        normals = self.part.target.surface.normals
        return _by_law(self.law, fraction, self._families, normals, self.part.place)


class StackFactor:
    """Factor on the permeabilities of a stack: that of the mean over its plies by thickness.

    Plies that are pressed together have one pressure, each by its own law of compaction; laws with
    memory are on first loading. Each ply conducts by its own fibre volume fraction: by the law of
    permeability, or else by Kozeny and Carman from its values after forming. Where the file has no
    values of single plies, all have the same ones. Like :class:`LawFactor` it is one factor for
    both values in the plane.

    Parameters
    ----------
    law : of the scene, None where none is known.
    part : with the plies of its cells.
    directory : folder to which a file of the law is relative.
    """

    def __init__(self, law: Permeability | None, part: FormedPart, directory: Path | None) -> None:
        self.law = None if law is None else law_of(law, directory)
        self.part = part
        self.compaction = compaction_of(part)
        assert isinstance(self.compaction, StackCompaction)  # a part with plies
        shares = [np.nan_to_num(part.cell(f"{SHARE}{ply}")) for ply in part.ply_names]
        fractions = [part.cell(f"{ply}_fibre_volume_fraction") for ply in part.ply_names]
        #: Fibre volume per area of the cells, and that of every ply (P, C) [m].
        self._fibres = part.cell("fibre_volume_fraction") * part.cell("thickness")
        of_plies = np.stack(fractions) * np.stack(shares) * part.cell("thickness")
        self._of_plies = np.nan_to_num(of_plies)
        self._families: dict[str, list[np.ndarray]] = {}
        if law is not None:
            self._families = {ply: fibre_directions(part, f"{ply}_") for ply in part.ply_names}
        self._begun: tuple[np.ndarray, np.ndarray] | None = None

    def __call__(self, now: np.ndarray, before: np.ndarray) -> np.ndarray:
        """Return the factors (C,) for fibre volume fractions (C,) now and in the beginning.

        Raises
        ------
        SimulationError : a fibre volume fraction is out of the range of the law.
        """
        # every time step asks for the factor from the same begin
        if self._begun is None or not np.array_equal(self._begun[0], before):
            self._begun = before.copy(), self._in_plane(before)
        return self._in_plane(now) / self._begun[1]

    def _in_plane(self, fraction: np.ndarray) -> np.ndarray:
        assert isinstance(self.compaction, StackCompaction)
        thickness = self._fibres / fraction
        each = self.compaction.of_plies(thickness)
        total = np.zeros_like(fraction)
        for ply, own, fibres in zip(self.part.ply_names, each, self._of_plies, strict=True):
            cells = np.flatnonzero(own > 0.0)
            total[cells] += own[cells] * self._of_ply(ply, cells, fibres[cells] / own[cells])
        return total / thickness

    def _of_ply(self, ply: str, cells: np.ndarray, fraction: np.ndarray) -> np.ndarray:
        """Return the sum of both values in the plane of a ply in some cells [m2]."""
        if self.law is None:
            names = [f"{ply}_permeability_{k}" for k in (1, 2)]
            known = all(name in self.part.dataset for name in names)
            start = sum(self.part.cell(name)[cells] for name in names) if known else 1.0
            formed = self.part.cell(f"{ply}_fibre_volume_fraction")[cells]
            return start * kozeny_factor(fraction, formed)
        families = [family[cells] for family in self._families[ply]]
        normals = self.part.target.surface.normals[cells]

        def place(cell: int) -> str:
            return f'the ply "{ply}" of {self.part.place(int(cells[cell]))}'

        return _by_law(self.law, fraction, families, normals, place)


def _by_law(
    law: PermeabilityLaw | MeasuredPermeability,
    fraction: np.ndarray,
    families: list[np.ndarray],
    normals: np.ndarray,
    place: Callable[[int], str],
) -> np.ndarray:
    """Return the sum of both values in the plane (C,) [m2]; ``place`` names a cell.

    Raises
    ------
    SimulationError : a fibre volume fraction is out of the range of the law.
    """
    found = principal_permeabilities(law, fraction, *families, normal=normals, out_of_range="nan")
    total = found.k1 + found.k2
    unknown = np.flatnonzero(~(total > 0.0))
    if len(unknown):
        cell = int(unknown[0])
        raise SimulationError(
            f"{place(cell)} is compacted to a fibre volume fraction of {fraction[cell]:.4g}, where "
            f"the permeability law gives no value ({len(unknown)} cells); use a law that holds "
            "there, or close the tool less far"
        )
    return total


def factor_of(
    part: FormedPart, law: Permeability | None, directory: Path | None, *, pressed: bool = False
) -> PermeabilityFactor:
    """Return the factor by which the permeability of a part follows its compaction.

    It follows the law of the case, or else that of the scene that formed the part. Without a law,
    or where its file may be elsewhere by now, it follows Kozeny and Carman.

    pressed : whether a closure presses the part, whose plies then have one pressure.
    """
    if law is None:
        law = formed_permeability(str(part.dataset.attrs.get("scene") or ""))
        if getattr(law, "file", None) is not None:
            law = None
    if pressed and part.ply_names:
        return StackFactor(law, part, directory)
    return kozeny_factor if law is None else LawFactor(law, part, directory)
