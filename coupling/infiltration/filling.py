"""Filling of a porous sheet with resin.

A filling is a model (:class:`FillingModel`), its state, and its time steps.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from lcmchain.coupling.infiltration.flow.boundaries import Gate, Supply, Vent
from lcmchain.coupling.infiltration.flow.driven_flow import FillingModel, FillingOptions
from lcmchain.coupling.infiltration.flow.film import Film, FilmSupply
from lcmchain.coupling.infiltration.flow.flow_medium import Links, joined_parts
from lcmchain.coupling.infiltration.flow.medium import (
    Liquid,
    Medium,
    OpenFaces,
    Resin,
    ResinTemperature,
)
from lcmchain.coupling.infiltration.flow.motion import find_dry_spots
from lcmchain.coupling.infiltration.flow.network import RaceTrack
from lcmchain.coupling.infiltration.flow.preform import FlowMesh, Preform
from lcmchain.coupling.infiltration.flow.pressure import Work
from lcmchain.coupling.infiltration.flow.state import (
    FULL,
    FillingFrame,
    FillingResult,
    FillingState,
)
from lcmchain.coupling.infiltration.flow.time_step import TimeStep
from lcmchain.errors import InputError, SimulationError

__all__ = ["Filling", "FillingOptions"]


class Filling:
    """Darcy flow with a moving front in a sheet.

    Parameters
    ----------
    mesh, preform : of the sheet.
    resin : law of viscosity and cure (:mod:`lcmchain.coupling.infiltration.resin`), or the
        viscosity [Pa s].
    gates, vents : where resin enters and air leaves.
    temperature : of the resin; needed where viscosity or cure depend on it.
    gravity : acceleration (3,) [m/s²]; needs a resin with a density.
    wetted : fill factors at the start (N,), or rows of nodes that are full.
    film : resin on the sheet and the pressure on it.
    edges : race tracks.
    links : between a flow medium and the preform, see
        :meth:`lcmchain.coupling.infiltration.flow.flow_medium.FlowMedium.layered`.

    Raises
    ------
    InputError : no vent, no source, nodes beyond the mesh, a loose piece of the mesh without a
        source.
    """

    def __init__(
        self,
        mesh: FlowMesh,
        preform: Preform,
        resin: Resin | float,
        gates: Sequence[Gate],
        vents: Sequence[Vent],
        *,
        temperature: ResinTemperature | None = None,
        gravity: np.ndarray | None = None,
        wetted: np.ndarray | None = None,
        film: Film | None = None,
        edges: Sequence[RaceTrack] = (),
        links: Links | None = None,
        options: FillingOptions | None = None,
    ) -> None:
        on_film = 0.0 if film is None else film.pressure
        supply = Supply(gates, vents, mesh.node_count, on_film)
        medium = Medium(mesh, preform, edges, supply.gate_nodes, links)
        liquid = Liquid(resin, temperature)
        gravity = np.zeros(3) if gravity is None else np.asarray(gravity, dtype=float)
        if gravity.shape != (3,) or not np.isfinite(gravity).all():
            raise InputError("has to be three finite numbers [m/s2]", key="gravity")
        if gravity.any() and not liquid.resin.density > 0.0:
            raise InputError("gravity needs a resin with a density", key="resin.density")
        on_top = None if film is None else FilmSupply(film)
        options = options or FillingOptions()
        self.model = FillingModel(medium, liquid, supply, gravity, options, on_top)
        self.state = self._start(wetted)
        self._check_sources()
        self._steps = TimeStep(self.model)

    def _start(self, wetted: np.ndarray | None) -> FillingState:
        mesh, thickness = self.medium.mesh, self.medium.preform.thickness.copy()
        count = mesh.node_count
        fill = _fill_factors(wetted, count)
        pores = self.medium.pores(thickness)
        vents = self.supply.open_vents(0.0, np.full(count, np.nan))
        lowest = min((pressure for _, _, pressure in vents), default=0.0)
        if not self.supply.vents and not self.options.trapped_air and not fill.all():
            raise InputError(
                "there is no vent, so the air cannot leave; name nodes where it does, or set "
                "trapped_air to compress it"
            )
        full = fill >= FULL
        volume = np.where(full, pores, fill * pores)
        temperature = np.full(count, self.liquid.inlet_temperature(0.0))
        air = np.full(count, lowest if vents else self.options.air_pressure)
        gates = len(self.supply.gates)
        return FillingState(
            time=0.0, step_count=0, next_step=0.0, resin_volume=volume, full=full, fill=fill,
            pressure=air.copy(), air_pressure=air, fill_time=np.where(fill >= 0.5, 0.0, np.nan),
            cure=np.full(count, self.liquid.resin.initial_cure), temperature=temperature,
            film=np.zeros(count) if self.film is None else self.film.start(count),
            impregnated=np.zeros(count), thickness=thickness,
            thickness_rate=np.zeros(mesh.cell_count), lift=np.zeros(mesh.cell_count),
            lift_reference=np.zeros(mesh.cell_count), points=mesh.points.copy(),
            injected=np.zeros(gates), vented=np.zeros(len(self.supply.vents)),
            gate_pressure=np.full(gates, np.nan), gate_rate=np.full(gates, np.nan),
            started_volume=float(volume.sum()), enclosed=np.zeros(count, dtype=bool),
            film_cure=float(self.liquid.resin.initial_cure),
        )  # fmt: skip

    def _check_sources(self) -> None:
        """Refuse a loose piece of the mesh without a gate, resin or a film."""
        mesh = self.medium.mesh
        supplied = (self.state.resin_volume > 0.0) | (self.state.film > 0.0)
        for gate in self.supply.gates:
            supplied[gate.nodes] = True
        if not supplied.any():
            raise InputError("there is neither a gate nor resin in or on the sheet; name a gate")
        piece, links = mesh.part_of_node, self.medium.network.links
        if links is not None:
            piece = joined_parts(piece, links)
        lost = np.setdiff1d(np.unique(piece), piece[supplied])
        if len(lost):
            nodes = np.flatnonzero(np.isin(piece, lost))
            centre = ", ".join(f"{x:.6g}" for x in mesh.points[nodes].mean(axis=0))
            raise InputError(
                f"{len(nodes)} nodes around ({centre}) m can never fill: no resin reaches that "
                f"part of the mesh ({len(lost)} loose parts); give it a gate, merge doubled "
                "nodes, or leave it out"
            )

    @property
    def medium(self) -> Medium:
        """Pores and conductances."""
        return self.model.medium

    @property
    def liquid(self) -> Liquid:
        """The resin."""
        return self.model.liquid

    @property
    def supply(self) -> Supply:
        """Gates and vents."""
        return self.model.supply

    @property
    def film(self) -> FilmSupply | None:
        """Resin on the sheet, if there is any."""
        return self.model.film

    @property
    def options(self) -> FillingOptions:
        """Numerical options; they may be changed between two steps."""
        return self.model.options

    @options.setter
    def options(self, options: FillingOptions) -> None:
        self.model.options = options

    @property
    def open_faces(self) -> OpenFaces | None:
        """Faces through which air comes in, None without; no part of the saved states."""
        return self.model.open_faces

    @open_faces.setter
    def open_faces(self, faces: OpenFaces | None) -> None:
        self.model.open_faces = faces

    @property
    def mesh(self) -> FlowMesh:
        return self.medium.mesh

    @property
    def time(self) -> float:
        return self.state.time

    @property
    def pores(self) -> np.ndarray:
        """Present pore volume of the control volumes (N,) [m³]."""
        return self.medium.pores(self.state.thickness)

    @property
    def work(self) -> Work:
        """Numbers of factorisations and solutions of the equations since the start."""
        return self._steps.work

    @property
    def filled_share(self) -> float:
        """Resin over pore volume of the whole sheet."""
        return float(self.state.resin_volume.sum() / self.pores.sum())

    def advance(
        self, until: float, on_step: Callable[[Filling], None] | None = None
    ) -> tuple[str, str]:
        """Fill up to a time [s]; return outcome and message (:class:`FillingResult`).

        ``on_step`` is called after every time step; an exception of it ends the filling between two
        steps. A filling in which nothing moves any more ends earlier.

        Raises
        ------
        InputError : the time is not a number.
        SimulationError : resin that is squeezed finds no way out, or no time step succeeds.
        """
        if np.isnan(until):
            raise InputError("the time to fill up to is not a number")
        outcome, message = "reached", f"{until:.6g} s are reached"
        while self.state.time < until:
            ended = self._steps.take(self.state, until)
            if ended is not None:
                outcome, message = ended
                if self.options.stop_when_idle:
                    break
                self.state.time = until
                continue
            if on_step is not None:
                on_step(self)
        self._steps.refresh(self.state)
        return outcome, message

    def run(
        self, until: float, frames: int = 20, on_step: Callable[[Filling], None] | None = None
    ) -> FillingResult:
        """Fill up to a time [s], and save ``frames`` states at about equal filled shares."""
        self._steps.refresh(self.state)
        saved = [self.frame()]
        last = self.filled_share

        def after_step(filling: Filling) -> None:
            nonlocal last
            if filling.filled_share - last >= 1.0 / frames:
                last = filling.filled_share
                saved.append(filling.frame())
            if on_step is not None:
                on_step(filling)

        outcome, message = self.advance(until, after_step)
        if saved[-1].time < self.time:
            saved.append(self.frame())
        return FillingResult(tuple(saved), self.state.copy(), outcome, message)

    def frame(self) -> FillingFrame:
        """Return the fields of the present state."""
        state, medium = self.state, self.medium
        factor = self.liquid.fluidity(medium, state) * medium.factor(state.thickness)
        height = self.height(medium.mesh.points)
        cells = medium.mesh.cells
        wet: np.ndarray = ((cells < 0) | state.full[cells]).all(axis=1)
        velocity = medium.network.velocity(self._steps.present(state).pressure - height, factor)
        return FillingFrame(
            state.time, state.fill.copy(), self.pressure, state.cure.copy(),
            state.temperature.copy(), state.film.copy(), np.where(wet[:, None], velocity, 0.0),
        )  # fmt: skip

    @property
    def pressure(self) -> np.ndarray:
        """Present pressure of the nodes (N,) [Pa], in a gate's hole at most that of the gate.

        Results and couplings use this pressure. ``state.pressure`` is the unknown of the equations:
        between two steps it belongs to the last one, and at nodes in a hole it is that of the field
        around the hole, which rises further inside.
        """
        present = self._steps.present(self.state)
        pressure = present.pressure.copy()
        for gate, limit in zip(self.supply.gates, present.gate_pressure, strict=True):
            if gate.radius is not None and np.isfinite(limit):
                pressure[gate.nodes] = np.minimum(pressure[gate.nodes], limit)
        return pressure

    @property
    def gate_pressure(self) -> np.ndarray:
        """Present pressure of each gate (G,) [Pa]; nan where no resin enters."""
        return self._steps.present(self.state).gate_pressure

    @property
    def gate_rate(self) -> np.ndarray:
        """Present flow rate of each gate (G,) [m³/s]; nan where no resin enters."""
        return self._steps.present(self.state).gate_rate

    def height(self, points: np.ndarray) -> np.ndarray:
        """Return ρ g·x at positions (K, 3) [m], (K,) [Pa]."""
        return self.model.height(points)

    def save(self) -> FillingState:
        """Return a copy of the state."""
        return self.state.copy()

    def restore(self, saved: FillingState) -> None:
        """Go back to a saved state; going on from it is bit-identical."""
        if not np.array_equal(saved.points, self.medium.mesh.points):
            self.medium.set_points(saved.points)
        self.state = saved.copy()
        self._steps.forget()

    def set_thickness(
        self,
        thickness: np.ndarray,
        rate: np.ndarray | None = None,
        lift: np.ndarray | None = None,
        reference: np.ndarray | None = None,
    ) -> None:
        """Set the thickness of the preform and its rate.

        The thickness changes linearly by its rate while the filling advances. Fibres keep their
        volume per cell; porosity and permeability follow. If the thickness jumps, resin without
        room flows in the next time step.

        Parameters
        ----------
        thickness, rate : (C,) or one number [m], [m/s].
        lift : increase of the rate per pressure of the resin above ``reference``, not negative,
            (C,) [m/(s Pa)].
        reference : (C,) [Pa].

        Raises
        ------
        InputError : values that are not finite, or for another number of cells.
        SimulationError : the fibres alone fill a cell.
        """
        count = self.medium.mesh.cell_count
        none, state = np.zeros(count), self.state
        values = (
            _of_cells(thickness, count, "thickness"),
            _of_cells(none if rate is None else rate, count, "thickness rate"),
            _of_cells(none if lift is None else lift, count, "lift"),
            _of_cells(none if reference is None else reference, count, "reference pressure"),
        )
        self.medium.fibre_fraction(values[0])
        state.thickness, state.thickness_rate, state.lift, state.lift_reference = values
        self._steps.forget()

    def start_at(self, thickness: np.ndarray) -> None:
        """Set another thickness (C,) [m] before anything flows; the fill factors do not change."""
        self.set_thickness(thickness)
        state, pores = self.state, self.pores
        state.resin_volume = np.where(state.full, pores, state.fill * pores)
        state.started_volume = state.stored

    def settle(self) -> None:
        """Let the resin rest in the present pores: it stays in its control volume.

        Air comes in where the pores have become larger than their resin, and all nodes get the
        pressure of the air. An excess within ``largest_excess`` flows in the next time step.

        Raises
        ------
        SimulationError : pores have become smaller than their resin.
        """
        state, pores = self.state, self.pores
        excess = state.resin_volume / pores - 1.0
        worst = int(np.argmax(excess))
        if excess[worst] > max(self.options.largest_excess, 1.0 - FULL):
            place = ", ".join(f"{1e3 * x:.4g}" for x in self.mesh.points[worst])
            raise SimulationError(
                f"at ({place}) mm there is {100.0 * excess[worst]:.3g} % more resin than pores, "
                "and it cannot flow off"
            )
        state.full = excess >= FULL - 1.0
        state.fill = np.minimum(state.resin_volume / pores, 1.0)
        state.pressure = state.air_pressure.copy()
        state.gate_pressure = np.full(len(self.supply.gates), np.nan)
        state.gate_rate = state.gate_pressure.copy()
        state.next_step = 0.0
        find_dry_spots(self.model, state, pores)
        self._steps.forget()

    def set_supply(self, gates: Sequence[Gate], vents: Sequence[Vent]) -> None:
        """Change pressures, rates or schedules of the gates and vents.

        Raises
        ------
        InputError : other gates or vents.
        """
        names = [gate.name for gate in gates], [vent.name for vent in vents]
        supply = self.supply
        if names != ([gate.name for gate in supply.gates], [vent.name for vent in supply.vents]):
            raise InputError("a filling keeps its gates and vents; give each under its name")
        self.model.supply = Supply(gates, vents, self.mesh.node_count, self.supply.on_film)
        self._steps.forget()

    def set_points(self, points: np.ndarray, step: float | None = None) -> None:
        """Move the nodes to (N, 3) [m]; fibres and film keep their volume.

        Without a step the volume of the cells jumps with their areas: as after a jump of the
        thickness, resin without room flows in the next time step. With a step [s] the cells first
        keep their volume, and reach the volume of their thickness (and its rate) at the new
        positions after the step, at a constant rate that goes on beyond.

        Raises
        ------
        SimulationError : the fibres alone fill a cell.
        """
        start, state = self._place(points), self.state
        if step is None:
            self.medium.fibre_fraction(state.thickness)
        else:
            self.medium.fibre_fraction(np.minimum(start, state.thickness))
            state.thickness_rate = (state.thickness - start) / step
            state.thickness = start

    def carry_to(self, points: np.ndarray) -> None:
        """Move the nodes to (N, 3) [m]; cells, fibres and film keep their volume."""
        self.state.thickness = self._place(points)

    def _place(self, points: np.ndarray) -> np.ndarray:
        """Move the nodes, and return the thickness of cells that keep their volume (C,) [m]."""
        state, medium = self.state, self.medium
        volume, node_area = state.thickness * medium.mesh.areas, medium.node_area
        points = np.array(points, dtype=float)
        if points.shape != state.points.shape:
            raise InputError(
                f"the places of the nodes have the shape {points.shape}, not {state.points.shape}"
            )
        medium.set_points(points)
        state.points = points
        state.film = state.film * (node_area / medium.node_area)
        self._steps.forget()
        return volume / medium.mesh.areas

    def set_permeability(self, tensor: np.ndarray, through: np.ndarray | None = None) -> None:
        """Set the permeability of fibres that have moved, see :meth:`Medium.set_permeability`.

        The permeability is no part of the saved states.
        """
        fraction = self.medium.fibre_fraction(self.state.thickness)
        self.medium.set_permeability(tensor, through, fraction)
        self._steps.forget()


def _of_cells(quantity: np.ndarray, count: int, name: str) -> np.ndarray:
    """Return values of cells as an array (C,).

    Raises
    ------
    InputError : another number of values, or one that is not finite.
    """
    values = np.asarray(quantity, dtype=float)
    if values.shape not in ((), (1,), (count,)):
        raise InputError(
            f"the {name} has the shape {values.shape}; give one number or ({count},), one per cell"
        )
    values = np.array(np.broadcast_to(values, (count,)))
    if not np.isfinite(values).all():
        cell = np.flatnonzero(~np.isfinite(values))[0]
        raise InputError(f"the {name} of cell {cell} is not a number")
    return values


def _fill_factors(wetted: np.ndarray | None, count: int) -> np.ndarray:
    fill = np.zeros(count)
    if wetted is None:
        return fill
    wetted = np.asarray(wetted)
    if wetted.dtype.kind in "iu":
        if len(wetted) and (wetted.min() < 0 or wetted.max() >= count):
            raise InputError(f"wetted names node rows outside the mesh, which has {count} nodes")
        fill[wetted] = 1.0
        return fill
    if wetted.shape != (count,) or not ((wetted >= 0.0) & (wetted <= 1.0)).all():
        raise InputError("wetted has to be one fill factor between 0 and 1 per node, or node rows")
    return wetted.astype(float)
