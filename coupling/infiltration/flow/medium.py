"""Content of the control volumes: the preform with its pores, the resin, and the air.

The preform may move: its pores and conductances follow the thickness and the area of its cells.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple, Protocol

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from lcmchain.coupling.infiltration.flow.boundaries import Vent
from lcmchain.coupling.infiltration.flow.flow_medium import Links
from lcmchain.coupling.infiltration.flow.network import Conductances, Network, RaceTrack
from lcmchain.coupling.infiltration.flow.preform import FlowMesh, Preform
from lcmchain.coupling.infiltration.flow.pressure import Lift
from lcmchain.coupling.infiltration.flow.state import DrySpot, FillingState
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
        """Set the node positions [m], (N, 3)."""
        self._lies_still = False
        self._renew(self.mesh.moved(points))

    def set_permeability(
        self, tensor: np.ndarray, through: np.ndarray | None, fraction: np.ndarray
    ) -> None:
        """Set the present permeability, of fibres that have moved.

        Parameters
        ----------
        tensor : in space, (C, 3, 3) [m²].
        through : through the thickness, (C,) [m²].
        fraction : fibre volume fraction to which both belong, (C,).

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
        """Return the fibre volume fraction (C,) of cells of a thickness (C,) [m].

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
        """Return the pore volume of the control volumes (N,) [m³] at a thickness (C,) [m]."""
        open_height = thickness * (1.0 - self.fibre_fraction(thickness))
        inside = self.network.corner_sum(self.network.corner_areas * open_height[:, None])
        return inside + self.network.track_volume

    def pore_rate(self, thickness_rate: np.ndarray) -> np.ndarray:
        """Return the rate of the pore volume of the control volumes (N,) [m³/s]."""
        return self.network.corner_sum(self.network.corner_areas * thickness_rate[:, None])

    @property
    def sheet_area(self) -> np.ndarray:
        """Area of the preform at each node (N,) [m²]; 0 at nodes of a layer."""
        if self._links is None:
            return self.node_area
        area = self.node_area.copy()
        area[self._links.above] = 0.0
        return area

    def lift(self, state: FillingState) -> Lift | None:
        """Return the cells that the pressure of their resin thickens, if there are any."""
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


# --- resin ----------------------------------------------------------------------------------------


# A time step is at most as long as the logarithm of the viscosity needs to grow by this, but at
# least this share of the time since the start: close to the gel point the first goes to zero.
_THICKENING, _LEAST_SHARE = 0.2, 5e-4
_LITTLE_CURE = 1e-4


class Resin(Protocol):
    """A liquid of constant density whose viscosity depends on temperature and cure.

    All methods take arrays of one shape, or shapes that broadcast, and return that shape.
    """

    @property
    def density(self) -> float:
        """Density [kg/m3]."""

    @property
    def gel_cure(self) -> float:
        """Cure from which the resin no longer flows; infinite for one that never gels."""

    @property
    def initial_cure(self) -> float:
        """Cure of the resin that enters."""

    @property
    def reacts(self) -> bool:
        """Whether the resin cures at all; if not, nothing of its cure needs to be computed."""

    @property
    def depends_on_temperature(self) -> bool:
        """Whether viscosity or cure depend on the temperature."""

    def viscosity(self, temperature: np.ndarray, cure: np.ndarray) -> np.ndarray:
        """Viscosity [Pa s] at temperature [K] and cure [1]; infinite from the gel point on."""

    def cure_rate(self, temperature: np.ndarray, cure: np.ndarray) -> np.ndarray:
        """Rate of cure [1/s]; not negative, and zero for the cured resin."""

    def advance_cure(
        self,
        cure: np.ndarray,
        temperature: np.ndarray,
        step: float,
        end_temperature: np.ndarray | None = None,
    ) -> np.ndarray:
        """Return the cure after a step [s] of resin that stays where it is."""


class ResinTemperature(Protocol):
    """How the temperature of resin changes where it is; the flow carries it along."""

    def inlet(self, time: float) -> float:
        """Temperature [K] of the resin that enters at a time [s]."""

    def advance(
        self, temperature: np.ndarray, thickness: np.ndarray, time: float, step: float
    ) -> np.ndarray:
        """Return the temperature [K] after a step from a time on [s], where it is [K] now.

        ``temperature`` and ``thickness`` of the textile [m] have one shape.
        """


class _Newtonian:
    """A resin of constant viscosity [Pa s], where only a number was given."""

    density = 0.0
    gel_cure = np.inf
    initial_cure = 0.0
    reacts = False
    depends_on_temperature = False

    def __init__(self, value: float) -> None:
        if not (np.isfinite(value) and value > 0.0):
            raise InputError(f"the viscosity has to be positive, not {value}", key="resin")
        self.value = value

    def viscosity(self, temperature: np.ndarray, cure: np.ndarray) -> np.ndarray:
        return np.full(np.shape(cure), self.value)

    def cure_rate(self, temperature: np.ndarray, cure: np.ndarray) -> np.ndarray:
        return np.zeros(np.shape(cure))

    def advance_cure(
        self,
        cure: np.ndarray,
        temperature: np.ndarray,
        step: float,
        end_temperature: np.ndarray | None = None,
    ) -> np.ndarray:
        return cure


class Liquid:
    """A resin and its temperature in a filling."""

    def __init__(self, resin: Resin | float, temperature: ResinTemperature | None) -> None:
        self.resin: Resin = _Newtonian(float(resin)) if isinstance(resin, (int, float)) else resin
        self.temperature = temperature
        if self.resin.depends_on_temperature and temperature is None:
            raise InputError(
                "the resin's viscosity or cure depends on its temperature; give one",
                key="resin.temperature",
            )
        #: Whether viscosity or cure change while the resin flows.
        self.changes = bool(self.resin.reacts or self.resin.depends_on_temperature)
        self._kept: tuple[int, np.ndarray] | None = None

    def inlet_temperature(self, time: float) -> float:
        """Temperature [K] of the resin that enters; 293.15 where none is needed."""
        return 293.15 if self.temperature is None else float(self.temperature.inlet(time))

    def fluidity(self, medium: Medium, state: FillingState) -> np.ndarray:
        """1/viscosity [1/(Pa s)] of the cells, (C,): the mean viscosity of their wet nodes.

        A cell with gelled resin conducts nothing.
        """
        count = medium.mesh.cell_count
        inlet = np.array([self.resin.initial_cure])
        entering = np.array([self.inlet_temperature(state.time)])
        fresh = float(self.resin.viscosity(entering, inlet)[0])
        if not self.changes:
            if self._kept is None or self._kept[0] != count:
                self._kept = (count, np.full(count, 1.0 / fresh))
            return self._kept[1]
        wet = state.resin_volume > 0.0
        viscosity = np.asarray(self.resin.viscosity(state.temperature, state.cure), dtype=float)
        mean = medium.network.cell_mean(np.where(wet, viscosity, np.nan))
        return 1.0 / np.where(np.isnan(mean), fresh, mean)

    def node_viscosity(self, state: FillingState) -> np.ndarray:
        """Viscosity [Pa s] at the nodes, (N,): of the resin there, or of the film that enters."""
        wet = state.resin_volume > 0.0
        cure = np.where(wet, np.maximum(state.cure, state.film_cure), state.film_cure)
        return np.asarray(self.resin.viscosity(state.temperature, cure), dtype=float)

    def longest_step(self, state: FillingState) -> float:
        """Time step [s] in which curing resin thickens by a fifth at most, or little time passes.

        Resin that only warms or cools has no such limit: a step takes the mean of its ends.
        """
        wet = state.resin_volume > 0.0
        flowing = wet & (state.cure < self.resin.gel_cure)
        if not self.resin.reacts or not flowing.any():
            return np.inf
        temperature, cure = state.temperature[flowing], state.cure[flowing]
        rate = self.resin.cure_rate(temperature, cure)
        viscosity = self.resin.viscosity(temperature, cure)
        # The slope of the logarithm grows towards the gel point: look ahead by a little cure.
        ahead = self.resin.viscosity(temperature, np.minimum(cure + _LITTLE_CURE, 1.0))
        with np.errstate(invalid="ignore"):
            slope = rate * (np.log(ahead) - np.log(viscosity)) / _LITTLE_CURE
        fastest = float(np.max(slope, initial=0.0))
        least = _LEAST_SHARE * state.time
        return max(_THICKENING / fastest, least) if fastest > 0.0 else np.inf

    def gelled(self, state: FillingState) -> np.ndarray:
        """Whether the resin in each control volume has gelled, (N,)."""
        if not np.isfinite(self.resin.gel_cure):
            return np.zeros(len(state.cure), dtype=bool)
        return (state.cure >= self.resin.gel_cure) & (state.resin_volume > 0.0)

    def rest(self, medium: Medium, state: FillingState, wet: np.ndarray, step: float) -> None:
        """Let temperature and cure go on where the resin is, over a step [s] from the state's.

        The film stays at the temperature of the resin that enters.
        """
        thickness = medium.network.node_mean(state.thickness)
        start = state.temperature
        end = start
        if self.temperature is not None:
            end = self.temperature.advance(start, thickness, state.time, step)
        if self.resin.reacts:
            aged = self.resin.advance_cure(state.cure[wet], start[wet], step, end[wet])
            state.cure = state.cure.copy()
            state.cure[wet] = np.clip(aged, 0.0, 1.0)
            before, after = (
                np.array([self.inlet_temperature(time)]) for time in (state.time, state.time + step)
            )
            lying = self.resin.advance_cure(np.array([state.film_cure]), before, step, after)
            state.film_cure = float(lying[0])
        state.temperature = end


# --- air ------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Air:
    """Dry regions of a state.

    Parameters
    ----------
    region : number of the connected region of volumes that are not full, -1 for full ones, (N,).
    vented : whether an open vent lies in the region, (R,).
    pressure : of the air of each region [Pa], (R,).
    volume : of the air of each region [m3], (R,).
    """

    region: np.ndarray
    vented: np.ndarray
    pressure: np.ndarray
    volume: np.ndarray


def find_air(
    edges: np.ndarray,
    state: FillingState,
    pores: np.ndarray,
    vents: list[tuple[int, Vent, float]],
    compressed: bool,
) -> Air:
    """Return the dry regions of a state.

    Parameters
    ----------
    vents : those that are open, with their pressure [Pa]; a region has that of the lowest.
    compressed : enclosed air is an ideal gas at constant temperature (its pressure times volume
        stays); otherwise it keeps its pressure, as if it left.
    """
    count = len(state.full)
    dry = ~state.full
    linked = dry[edges[:, 0]] & dry[edges[:, 1]]
    ends = edges[linked]
    graph = coo_matrix((np.ones(len(ends)), ends.T), shape=(count, count))
    _, component = connected_components(graph, directed=False)
    region = np.full(count, -1)
    _, region[dry] = np.unique(component[dry], return_inverse=True)
    size = region.max(initial=-1) + 1
    where = region[dry]
    room = (pores - state.resin_volume)[dry]
    volume = np.bincount(where, room, minlength=size)
    amount = np.bincount(where, room * state.air_pressure[dry], minlength=size)
    most, least = np.full(size, -np.inf), np.full(size, np.inf)
    np.maximum.at(most, where, state.air_pressure[dry])
    np.minimum.at(least, where, state.air_pressure[dry])
    # One pressure is its own mean, to the bit: looking twice at a state must not change it.
    held = np.where(most == least, most, amount / np.where(volume > 0.0, volume, 1.0))
    lowest = np.full(size, np.inf)
    for _, vent, pressure in vents:
        reached = region[vent.nodes]
        np.minimum.at(lowest, reached[reached >= 0], pressure)
    vented = np.isfinite(lowest)
    if not compressed:
        held = most
    return Air(region, vented, np.where(vented, lowest, held), volume)


def new_dry_spots(
    air: Air, medium: Medium, state: FillingState, pores: np.ndarray
) -> tuple[np.ndarray, tuple[DrySpot, ...]]:
    """Return which nodes are enclosed now, and the pockets that have just closed.

    A pocket counts if the front has not passed one of its nodes at least: single volumes that the
    front leaves behind for a moment are none.
    """
    enclosed = np.zeros(len(state.full), dtype=bool)
    dry = air.region >= 0
    enclosed[dry] = ~air.vented[air.region[dry]]
    spots = []
    area = medium.sheet_area
    for number in np.unique(air.region[enclosed & ~state.enclosed]):
        nodes = np.flatnonzero(air.region == number)
        if state.enclosed[nodes].any() or not np.isnan(state.fill_time[nodes]).any():
            continue
        room = (pores - state.resin_volume)[nodes]
        share = room / pores[nodes]
        place = room @ medium.mesh.points[nodes] / room.sum()
        spots.append(
            DrySpot(state.time, place, float(share @ area[nodes]), float(room.sum()), nodes)
        )
    return enclosed, tuple(spots)


#: Suction that resin bears before air comes in [Pa]: less moves no textile.
NO_SUCTION = 10.0


class OpenFaces(NamedTuple):
    """Faces of a sheet through which air comes in where resin would be drawn apart.

    nodes (N,) : control volumes that air reaches through a face. pressure : of the air [Pa].
    """

    nodes: np.ndarray
    pressure: float

    def drawn(self, full: np.ndarray, pressure: np.ndarray) -> np.ndarray:
        """Return which full control volumes (N,) are under a pressure [Pa] that lets air in."""
        return full & self.nodes & (pressure < self.pressure - NO_SUCTION)
