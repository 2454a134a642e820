"""Pores and conductances of a preform that may move: thickness and area of its cells over time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from lcmchain.coupling.infiltration.boundaries import RaceTrack
from lcmchain.coupling.infiltration.flow_medium import Links
from lcmchain.coupling.infiltration.mesh import FlowMesh
from lcmchain.coupling.infiltration.network import Conductances, Network
from lcmchain.coupling.infiltration.preform import Preform
from lcmchain.coupling.infiltration.pressure import Lift
from lcmchain.coupling.infiltration.state import FillingState
from lcmchain.errors import InputError, SimulationError


class Medium:
    """Pore volumes and conductances; fibres keep their volume per cell while the sheet moves.

    The thickness is linear in time from the last :meth:`set_thickness` on. Conductances are kept
    as long as neither the preform moves nor the viscosity changes.
    """

    def __init__(
        self,
        mesh: FlowMesh,
        preform: Preform,
        tracks: Sequence[RaceTrack],
        gates: np.ndarray | None = None,
        links: Links | None = None,
    ) -> None:
        preform = preform.of_cells(mesh.cell_count)
        self._gates, self._links = gates, links
        self.mesh, self.preform, self.tracks = mesh, preform, tuple(tracks)
        self.fibre_volume = mesh.areas * preform.thickness * (1.0 - preform.porosity)
        self._fraction = 1.0 - preform.porosity
        self._kept: tuple[np.ndarray, np.ndarray, Conductances] | None = None
        self._lies_still = True
        self._renew(mesh)

    def set_points(self, points: np.ndarray) -> None:
        """Take other node positions [m], shape (N, 3)."""
        self._lies_still = False
        self._renew(self.mesh.moved(points))

    def set_permeability(
        self, tensor: np.ndarray, through: np.ndarray | None, fraction: np.ndarray
    ) -> None:
        """Take the permeability at present, of fibres that have moved.

        Parameters
        ----------
        tensor : [m2] in space, (C, 3, 3). through : [m2] through the thickness, (C,).
        fraction : fibre volume fraction that they belong to, (C,).

        Raises
        ------
        InputError : it is not positive in the plane.
        """
        self.preform = replace(self.preform, permeability=tensor, through_permeability=through)
        self._fraction, self._lies_still = fraction, False
        self._renew(self.mesh)

    def _renew(self, mesh: FlowMesh) -> None:
        self.mesh = mesh
        self.network = Network(
            self.mesh, self.preform.permeability, self.tracks, self._gates, self._links
        )
        self.node_area = self.network.node_areas()
        self._kept = None

    def fibre_fraction(self, thickness: np.ndarray) -> np.ndarray:
        """Fibre volume fraction of cells of a thickness [m], (C,).

        Raises
        ------
        SimulationError : fibres would fill a cell; the message names it.
        """
        fraction = self.fibre_volume / (self.mesh.areas * thickness)
        bad = np.flatnonzero(~((fraction < 1.0) & (thickness > 0.0)))
        if len(bad):
            place = ", ".join(f"{x:.6g}" for x in self.mesh.centroids[bad[0]])
            raise SimulationError(
                f"cell {bad[0]} at ({place}) m is compacted to {thickness[bad[0]]:.4g} m, where "
                f"fibres alone would fill {fraction[bad[0]]:.3g} of it; close the tool less far"
            )
        return fraction

    def pores(self, thickness: np.ndarray) -> np.ndarray:
        """Pore volume of the control volumes [m3], (N,), for a thickness of the cells (C,) [m]."""
        open_height = thickness * (1.0 - self.fibre_fraction(thickness))
        inside = self.network.corner_sum(self.network.corner_areas * open_height[:, None])
        return inside + self.network.track_volume

    def pore_rate(self, thickness_rate: np.ndarray) -> np.ndarray:
        """Rate of the pore volume of the control volumes [m3/s], (N,)."""
        return self.network.corner_sum(self.network.corner_areas * thickness_rate[:, None])

    @property
    def sheet_area(self) -> np.ndarray:
        """Area of the preform that belongs to each node [m2], (N,); none at those of a layer."""
        if self._links is None:
            return self.node_area
        area = self.node_area.copy()
        area[self._links.above] = 0.0
        return area

    def lift(self, state: FillingState) -> Lift | None:
        """Cells that the pressure of their resin thickens, if there are any."""
        cells = np.flatnonzero(state.lift)
        if not len(cells):
            return None
        areas = self.network.corner_areas[cells]
        total = areas.sum(axis=1)
        return Lift(
            cells, self.mesh.cells[cells], areas / total[:, None], total * state.lift[cells],
            state.lift_reference[cells],
        )  # fmt: skip

    def conductances(self, thickness: np.ndarray, fluidity: np.ndarray) -> Conductances:
        """Conductances for a thickness [m] and 1/viscosity [1/(Pa s)] of the cells, each (C,)."""
        kept = self._kept
        if kept is None or not (
            np.array_equal(kept[0], thickness) and np.array_equal(kept[1], fluidity)
        ):
            factor = self.factor(thickness)
            scale = thickness * fluidity * factor
            through = self.preform.through_permeability
            if self._links is not None and through is not None:
                through = through * fluidity * factor / thickness
            along = self.network.edge_mean(fluidity) if self.tracks else 1.0
            kept = (thickness.copy(), fluidity, self.network.conductances(scale, along, through))
            self._kept = kept
        return kept[2]

    def factor(self, thickness: np.ndarray) -> np.ndarray:
        """Factor on the permeability at the start, (C,)."""
        if self._lies_still and np.array_equal(thickness, self.preform.thickness):
            return np.ones(len(thickness))
        return self.preform.factor(self.fibre_fraction(thickness), self._fraction)


def check_thickness(thickness: np.ndarray, count: int, name: str) -> np.ndarray:
    """Return values of cells as an array (C,).

    Raises
    ------
    InputError : another number of values, or one that is not finite.
    """
    given = np.asarray(thickness, dtype=float)
    if given.shape not in ((), (1,), (count,)):
        raise InputError(
            f"the {name} has the shape {given.shape}; give one number or ({count},), one per cell"
        )
    values = np.array(np.broadcast_to(given, (count,)))
    if not np.isfinite(values).all():
        cell = np.flatnonzero(~np.isfinite(values))[0]
        raise InputError(f"the {name} of cell {cell} is not a number")
    return values
