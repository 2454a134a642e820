"""Compaction of plies on each other, and of the textile of a formed part.

Plies are springs in series: all bear one pressure P, and their thicknesses add up, h(P) = Σ t_i(P).
Each ply has its own law, fibres per area and history. h falls with P, so that a thickness of the
stack belongs to one pressure, which Newton's iteration within bounds finds. The compliances add up,
dh/dP = Σ dt_i/dP.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from lcmchain.coupling.infiltration.formed_part import FormedPart
from lcmchain.coupling.solids.compaction_law import MOST_ITERATIONS, ROUND_OFF, CellCompaction
from lcmchain.errors import InputError, SimulationError
from lcmchain.mapping.sheet import SHARE
from lcmchain.materials.features.pressure_table import PressureTable
from lcmchain.materials.features.shear_compaction import coupling_of, free_stretch
from lcmchain.materials.law import Material, couples_shear
from lcmchain.materials.table import MaterialTable
from lcmchain.scene.reading.single_tables import formed_material, formed_plies

#: A ply that covers all of a cell but for rounding covers all of it.
WHOLE = 1.0 - 1e-9


@dataclass(frozen=True)
class PressedPly:
    """A ply in the cells that it covers.

    Parameters
    ----------
    name : for messages.
    law : of these cells alone.
    cells : their rows in the stack.
    """

    name: str
    law: CellCompaction
    cells: np.ndarray


class StackCompaction:
    """Compaction law of C cells of several plies; a :class:`.CompactionLaw`.

    Parameters
    ----------
    plies : of the stack. Not every ply covers every cell, but one at least does.
    count : number of cells C.
    """

    def __init__(self, plies: Sequence[PressedPly], count: int) -> None:
        self.plies, self._count = tuple(plies), count
        #: Of the undeformed plies of each cell (C,) [m].
        self.thickness = self._summed([ply.law.thickness for ply in self.plies])

    @property
    def history(self) -> np.ndarray:
        """Histories of the laws of all plies in one row, ply after ply."""
        return np.concatenate([ply.law.history.ravel() for ply in self.plies])

    @history.setter
    def history(self, values: np.ndarray) -> None:
        first = 0
        for ply in self.plies:
            shape, size = ply.law.history.shape, ply.law.history.size
            ply.law.history = np.array(values[first : first + size]).reshape(shape)
            first += size

    @property
    def thinnest(self) -> np.ndarray:
        """Thickness (C,) [m] at which the weakest ply bears its largest pressure."""
        return self._summed(self._thicknesses(self._largest_pressure()))

    def least_gap(self, offset: np.ndarray | float) -> float:
        """Return the gap [m] below which cells that are thicker by an offset have no pressure."""
        return float(np.max(self.thinnest - offset))

    def pressure(self, thickness: np.ndarray) -> np.ndarray:
        """Return the pressure that the fibres bear (C,) [Pa]; negative where they are pulled.

        Raises
        ------
        SimulationError : thinner than any pressure makes a cell.
        """
        return self._shared(thickness)[0]

    def stiffness(self, thickness: np.ndarray) -> np.ndarray:
        """Return minus the derivative of the pressure by the thickness (C,) [Pa/m], positive."""
        own = zip(self.plies, self._shared(thickness)[1], strict=True)
        return 1.0 / self._summed([1.0 / ply.law.stiffness(thickness) for ply, thickness in own])

    def thickness_under(self, pressure: np.ndarray) -> np.ndarray:
        """Return the thickness at which the fibres bear a pressure (C,) [m].

        Raises
        ------
        SimulationError : more than the law of a ply can bear at any thickness.
        """
        largest = self._largest_pressure()
        lacking = np.flatnonzero(largest < pressure)
        if len(lacking):
            cell = int(lacking[0])
            raise SimulationError(
                f"the fibres of cell {cell} would have to bear {pressure[cell]:.4g} Pa, more than "
                f"the law of {self._weakest(cell)} gives at any thickness"
            )
        return self._summed(self._thicknesses(pressure))

    def of_plies(self, thickness: np.ndarray) -> np.ndarray:
        """Return the thickness of each ply (P, C) [m] in cells of a thickness (C,) [m].

        It is 0 where a ply does not cover a cell.

        Raises
        ------
        SimulationError : as of :meth:`pressure`.
        """
        found = np.zeros((len(self.plies), self._count))
        for row, ply, own in zip(found, self.plies, self._shared(thickness)[1], strict=True):
            row[ply.cells] = own
        return found

    def remember(self, thickness: np.ndarray) -> None:
        """Move the histories on to the end of a step that leads to a thickness (C,) [m]."""
        if not self.history.size:
            return
        for ply, own in zip(self.plies, self._shared(thickness)[1], strict=True):
            ply.law.remember(own)

    def _thicknesses(self, pressure: np.ndarray) -> list[np.ndarray]:
        """Thickness of every ply in its cells, under the pressures of all cells (C,)."""
        return [ply.law.thickness_under(pressure[ply.cells]) for ply in self.plies]

    def _shared(self, thickness: np.ndarray) -> tuple[np.ndarray, list[np.ndarray]]:
        """Return the pressure at a thickness (C,) [m], and the thickness of each ply in its cells.

        Newton's iteration on the thicknesses of all plies at once begins where all are compressed
        by the same share. As the pressure of a textile grows about exponentially, a step is linear
        in ln P; where a fluid lifts the plies, in P. Where the plies together are too thick, one of
        them bears less than the final pressure, which bounds it from below; where they are too
        thin, the other way round.

        Raises
        ------
        SimulationError : thinner than any pressure makes a cell.
        """
        free = [ply.law.free_stretch * ply.law.thickness for ply in self.plies]
        part = thickness / self._summed(free)
        own = [part[ply.cells] * of_ply for ply, of_ply in zip(self.plies, free, strict=True)]
        least = [ply.law.thinnest for ply in self.plies]
        low, high = np.full(self._count, -np.inf), self._largest_pressure()
        largest = high.copy()
        for _ in range(MOST_ITERATIONS):
            own = [np.maximum(one, bound) for one, bound in zip(own, least, strict=True)]
            borne = [ply.law.pressure(one) for ply, one in zip(self.plies, own, strict=True)]
            gives = [1.0 / ply.law.stiffness(one) for ply, one in zip(self.plies, own, strict=True)]
            too_thick = self._summed(own) - thickness
            smallest, greatest = self._extremes(borne)
            low = np.where(too_thick >= 0.0, np.maximum(low, smallest), low)
            high = np.where(too_thick <= 0.0, np.minimum(high, greatest), high)
            pressed = (part < 1.0) & (smallest > 0.0)
            pressure, change = self._newton(pressed, too_thick, borne, gives, (low, high))
            own = [one + by for one, by in zip(own, change, strict=True)]
            moved = self._extremes([np.abs(by) / one for by, one in zip(change, own, strict=True)])
            found = (moved[1] <= ROUND_OFF) & (np.abs(too_thick) <= ROUND_OFF * thickness)
            if found.all():
                return pressure, own
        thinnest = self.thinnest
        lacking = np.flatnonzero(~found & (thickness < thinnest))
        if len(lacking):
            cell = int(lacking[0])
            raise SimulationError(
                f"the plies of cell {cell} would have to become {thickness[cell]:.4g} m thin, but "
                f"the law of {self._weakest(cell)} gives no more than about "
                f"{largest[cell]:.4g} Pa, where they are {thinnest[cell]:.4g} m thick"
            )
        return self._under_common(thickness, pressure, (low, high), ~found)

    def _under_common(
        self,
        thickness: np.ndarray,
        pressure: np.ndarray,
        bounds: tuple[np.ndarray, np.ndarray],
        wanted: np.ndarray,
    ) -> tuple[np.ndarray, list[np.ndarray]]:
        """Return what :meth:`_shared` returns, by iteration on the common pressure of a cell.

        Each ply has its thickness under this pressure. This takes longer, but works near the end of
        a law too, where its pressure hardly grows any more.

        Parameters
        ----------
        pressure : to begin with, and to keep where it is not ``wanted`` (C,).
        bounds : of the pressure (C,) each.
        wanted : cells that are iterated (C,).
        """
        low, high = np.where(np.isfinite(bounds[0]), bounds[0], 0.0), bounds[1]
        pressure = np.where(wanted, 0.5 * (low + high), pressure)
        for _ in range(MOST_ITERATIONS):
            own = self._thicknesses(pressure)
            too_thick = self._summed(own) - thickness
            low = np.where(too_thick >= 0.0, pressure, low)
            high = np.where(too_thick <= 0.0, pressure, high)
            gives = [1.0 / ply.law.stiffness(one) for ply, one in zip(self.plies, own, strict=True)]
            better = pressure + too_thick / self._summed(gives)
            better = np.where((better > low) & (better < high), better, 0.5 * (low + high))
            wanted = wanted & (np.abs(too_thick) > ROUND_OFF * thickness)
            wanted = wanted & (np.abs(better - pressure) > ROUND_OFF * np.abs(pressure))
            if not wanted.any():
                break
            pressure = np.where(wanted, better, pressure)
        return pressure, own

    def _newton(
        self,
        pressed: np.ndarray,
        too_thick: np.ndarray,
        borne: list[np.ndarray],
        gives: list[np.ndarray],
        bounds: tuple[np.ndarray, np.ndarray],
    ) -> tuple[np.ndarray, list[np.ndarray]]:
        """Return the pressures (C,) [Pa] of a step, and the change of each ply's thickness [m].

        Parameters
        ----------
        pressed : cells whose step is linear in the logarithm of the pressure (C,).
        too_thick : sum of the plies less the thickness that they are to have (C,) [m].
        borne, gives : pressure [Pa] and compliance [m/Pa] of every ply in its cells.
        bounds : of the pressure (C,) [Pa].
        """
        rows = [ply.cells for ply in self.plies]
        level = [np.where(pressed[c], np.log(np.where(pressed[c], p, 1.0)), p)
                 for c, p in zip(rows, borne, strict=True)]  # fmt: skip
        yields = [np.where(pressed[c], p * give, give)
                  for c, p, give in zip(rows, borne, gives, strict=True)]  # fmt: skip
        weighed = [value * give for value, give in zip(level, yields, strict=True)]
        aim = (too_thick + self._summed(weighed)) / self._summed(yields)
        pressure = np.where(pressed, np.exp(np.where(pressed, aim, 0.0)), aim)
        low, high = bounds
        inside = (pressure >= low) & (pressure <= high)
        middle = np.where(np.isfinite(low), 0.5 * (low + high), high)
        pressure = np.where(inside, pressure, middle)
        aim = np.where(pressed, np.log(np.where(pressed, pressure, 1.0)), pressure)
        return pressure, [
            (value - aim[c]) * give for c, value, give in zip(rows, level, yields, strict=True)
        ]

    def _extremes(self, of_plies: Sequence[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
        """Smallest and largest (C,) of values that every ply has in its cells."""
        low, high = np.full(self._count, np.inf), np.full(self._count, -np.inf)
        for ply, values in zip(self.plies, of_plies, strict=True):
            low[ply.cells] = np.minimum(low[ply.cells], values)
            high[ply.cells] = np.maximum(high[ply.cells], values)
        return low, high

    def _largest_pressure(self) -> np.ndarray:
        """Largest pressure (C,) [Pa] that the laws of all plies of a cell give."""
        return self._extremes([ply.law.pressure(ply.law.thinnest) for ply in self.plies])[0]

    def _weakest(self, cell: int) -> str:
        """Name of the ply whose law gives the least pressure in a cell."""
        there = [
            (float(ply.law.pressure(ply.law.thinnest)[ply.cells == cell][0]), ply.name)
            for ply in self.plies
            if cell in ply.cells
        ]
        return f'the ply "{min(there)[1]}"'

    def _summed(self, of_plies: Sequence[np.ndarray]) -> np.ndarray:
        """Sum (C,) of values that every ply has in its cells."""
        total = np.zeros(self._count)
        for ply, values in zip(self.plies, of_plies, strict=True):
            total[ply.cells] += values
        return total


# --- the law of a formed part ---------------------------------------------------------------------


def compaction_of(part: FormedPart) -> CellCompaction | StackCompaction:
    """Return the compaction law of a formed part's cells, by the scene that formed it.

    A sheared cell has more fibres per area, and bears a pressure as a sheet of smaller area does.
    Each ply of a stack has a law of its own. The history of the forming (a permanent set) is not
    in the file: the laws begin without.

    Raises
    ------
    InputError : the file does not hold its scene, or has a ply that its scene does not have.
    """
    text = _scene_of(part)
    fraction, thickness = part.cell("fibre_volume_fraction"), part.cell("thickness")
    if part.ply_names:
        return _of_stack(part, text, thickness)
    material = at_rest(formed_material(text))
    return of_cells(material, material.fibre_density * fraction * thickness)


def compaction_tables(part: FormedPart) -> tuple[Any, ...]:
    """Return the tables of the materials and the arrays on which :func:`compaction_of` depends.

    Raises
    ------
    InputError : as of :func:`compaction_of`.
    """
    text = _scene_of(part)
    arrays = [part.cell("fibre_volume_fraction"), part.cell("thickness")]
    if not part.ply_names:
        return (formed_material(text), *arrays)
    for name in part.ply_names:
        fields = (f"{SHARE}{name}", f"{name}_thickness", f"{name}_fibre_volume_fraction")
        arrays += [part.cell(field) for field in fields]
    return (*formed_plies(text).values(), *arrays)


def _scene_of(part: FormedPart) -> str:
    """Return the text of the scene that formed a part."""
    text = part.dataset.attrs.get("scene")
    if not text:
        raise InputError(
            "does not hold the scene that formed it, whose compaction law a closure needs; start "
            "from a forming result of lcmchain run, or a file mapped from one",
            file=part.file,
        )
    return str(text)


def at_rest(table: MaterialTable) -> Material:
    """Return the law of a material's table for pure pressing: without friction and rates."""
    for has_effect, without in (
        ("resists_rates", "without_rates"),
        ("shear_rubs", "without_shear_friction"),
        ("bending_rubs", "without_bending_friction"),
        ("bending_resists_rates", "without_viscous_bending"),
    ):
        if getattr(table, has_effect):
            table = getattr(table, without)()
    law: Material = table.build()
    return law


def _of_stack(part: FormedPart, text: str, thickness: np.ndarray) -> StackCompaction:
    """Return the law of plies on each other, from their shares of the thickness (C,) [m].

    The mapping treats a ply that covers a part of a cell as a thinner ply in the whole cell.
    """
    tables = formed_plies(text)
    names = part.ply_names
    shares = np.stack([np.nan_to_num(part.cell(f"{SHARE}{name}")) for name in names])
    thicknesses = np.stack([part.cell(f"{name}_thickness") for name in names])
    cover = np.where(shares > 0.0, shares / thicknesses, 0.0)
    cover = cover / cover.max(axis=0)
    cover = np.where(cover >= WHOLE, 1.0, cover)
    plies = []
    for name, share, covered in zip(names, shares, cover, strict=True):
        if name not in tables:
            raise InputError(
                f'has the ply "{name}", but the scene in it has only {", ".join(tables)}; the '
                "compaction law of a ply is that of the scene: form the stack again",
                file=part.file,
            )
        cells = np.flatnonzero(covered > 0.0)
        material = at_rest(tables[name])
        fraction = part.cell(f"{name}_fibre_volume_fraction")
        areal_mass = material.fibre_density * fraction * share * thickness
        law = of_cells(material, areal_mass[cells], covered[cells])
        plies.append(PressedPly(name, law, cells))
    return StackCompaction(plies, len(thickness))


def of_cells(
    material: Material, areal_mass: np.ndarray, covered: np.ndarray | float = 1.0
) -> CellCompaction:
    """Return the law of the cells of a sheared sheet.

    Fibres that keep their length leave a sheared cell cos γ of its area. Where the thickness
    depends on the shear, the law is that of a sheet that is thicker by 1/cos^β γ, on an area that
    is larger by the same factor. A table does not scale like that: it is evaluated at the shear of
    every cell.

    Parameters
    ----------
    areal_mass : mass of the fibres per present area (C,) [kg/m²].
    covered : part of each cell that the sheet covers, (C,) or one number.
    """
    area = material.areal_mass / areal_mass
    thicker, shear = np.ones(len(areal_mass)), None
    if couples_shear(material):
        shear = np.sqrt(np.maximum(1.0 - area**2, 0.0))
        thicker = free_stretch(material, shear)
    return CellCompaction(
        material,
        material.thickness * covered * thicker,
        area_stretch=covered * area * thicker,
        shear=shear if isinstance(coupling_of(material), PressureTable) else None,
    )
