"""Flow at the start or end of a time step, driven by gates, vents and film.

A :class:`FillingModel` is all of a filling but its state. Model and state give the
:class:`Situation` at the start of a step, and this gives the :class:`Stage`: pressures and flows,
also those through gates and vents.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from lcmchain.coupling.infiltration.flow.boundaries import OpenGate, Priming, Supply, prime
from lcmchain.coupling.infiltration.flow.film import FilmFlow, FilmSinking, FilmSupply
from lcmchain.coupling.infiltration.flow.flow_medium import Sinking
from lcmchain.coupling.infiltration.flow.holes import neighbours, widening
from lcmchain.coupling.infiltration.flow.medium import Air, Liquid, Medium, OpenFaces, find_air
from lcmchain.coupling.infiltration.flow.network import Conductances
from lcmchain.coupling.infiltration.flow.pressure import Boundary, Factors, Flow, Lift, solve_flow
from lcmchain.coupling.infiltration.flow.state import FULL, FillingState
from lcmchain.errors import SimulationError


@dataclass(frozen=True)
class FillingOptions:
    """Numerical options of a filling.

    Parameters
    ----------
    front_step : control volumes that the front may cross in a time step, at its mean speed.
    largest_step : largest time step [s].
    largest_compaction : largest change of the thickness of a cell in a time step, relative to it.
    largest_excess : excess of resin, over the pores of a control volume, that is accepted where the
        last air around it closes; it flows off in the next step. With 0 every pocket of air that
        closes ends a step, which are many where a whole part is pressed full.
    trapped_air : air that no vent reaches is compressed (ideal gas, isothermal; all pressures
        absolute) instead of leaving at the vent's pressure.
    air_pressure : of the air at the start where no vent is open [Pa].
    stop_when_idle : a filling in which nothing moves any more stops; otherwise its time goes on.
    """

    front_step: float = 0.6
    largest_step: float = np.inf
    largest_compaction: float = 0.02
    largest_excess: float = 0.0
    trapped_air: bool = False
    air_pressure: float = 0.0
    stop_when_idle: bool = True


@dataclass
class FillingModel:
    """All of a filling but its state.

    Parameters
    ----------
    medium : pores and conductances.
    liquid : the resin.
    supply : gates and vents.
    gravity : (3,) [m/s²].
    film : resin on the sheet, if there is any.
    open_faces : faces through which air comes in, None without. Like the options they are no part
        of the saved states.
    """

    medium: Medium
    liquid: Liquid
    supply: Supply
    gravity: np.ndarray
    options: FillingOptions
    film: FilmSupply | None = None
    open_faces: OpenFaces | None = None

    def height(self, points: np.ndarray) -> np.ndarray:
        """Return ρ g·x at positions (K, 3) [m], (K,) [Pa]."""
        return self.liquid.resin.density * (points @ self.gravity)


# --- the situation at the start of a step ---------------------------------------------------------


# Relative to the pores of a control volume: deficit up to which a full one stays full although its
# pores shrink, and round-off of its resin.
NEARLY, ROUND_OFF = 0.5 * (1.0 - FULL), 1e-13


@dataclass(frozen=True)
class Situation:
    """Quantities at the start of a step that are constant over it.

    Parameters
    ----------
    pores : pore volume of each control volume (N,) [m³].
    primings : gates and films that fill their own control volumes before resin flows on.
    bleeds : whether a control volume is at an open vent through which resin bleeds (N,).
    vent_pressure : of these vents (N,) [Pa], nan elsewhere.
    excess : resin in full control volumes beyond their pores (N,) [m³].
    pore_rate : rate of the pore volume (N,) [m³/s].
    """

    state: FillingState
    conductances: Conductances
    pores: np.ndarray
    gates: list[OpenGate]
    primings: list[Priming | FilmSinking]
    bleeds: np.ndarray
    vent_pressure: np.ndarray
    air: Air
    excess: np.ndarray
    pore_rate: np.ndarray
    lift: Lift | None
    film: FilmFlow | None = None


def situation_of(model: FillingModel, state: FillingState) -> Situation:
    """Return the situation of a state; the pressure of the air is written into the state."""
    medium, supply = model.medium, model.supply
    fluidity = model.liquid.fluidity(medium, state)
    conductances = medium.conductances(state.thickness, fluidity)
    pores = medium.pores(state.thickness)
    vents = supply.open_vents(state.time, state.fill_time)
    compressed = model.options.trapped_air
    air = find_air(medium.network.edges, state, pores, vents, compressed)
    dry = air.region >= 0
    state.air_pressure = state.air_pressure.copy()
    state.air_pressure[dry] = air.pressure[air.region[dry]]
    gates = supply.open_gates(state.time, state, medium.network, conductances)
    primings: list[Priming | FilmSinking] = [
        prime(gate, medium.network, conductances, pores, state) for gate in gates if not gate.ready
    ]
    vent_pressure = np.full(len(pores), np.nan)
    for _, vent, pressure in vents:
        if not vent.closes_when_wet:
            vent_pressure[vent.nodes] = pressure
    film = None if model.film is None else _film_flow(model, model.film, state, pores, gates)
    if film is not None and film.sinking is not None:
        primings.append(film.sinking)
    excess = np.where(state.full, state.resin_volume - pores, 0.0)
    # full volumes may lack a little; of an excess only round-off is dropped
    excess[(excess > -NEARLY * pores) & (excess < ROUND_OFF * pores)] = 0.0
    return Situation(
        state, conductances, pores, gates, primings, ~np.isnan(vent_pressure), vent_pressure,
        air, excess, medium.pore_rate(state.thickness_rate), medium.lift(state), film,
    )  # fmt: skip


def _film_flow(
    model: FillingModel,
    film: FilmSupply,
    state: FillingState,
    pores: np.ndarray,
    gates: list[OpenGate],
) -> FilmFlow | None:
    viscosity = model.liquid.node_viscosity(state)
    under_gates = np.zeros(len(pores), dtype=bool)
    for gate in gates:
        under_gates[gate.gate.nodes] = True
    return film.at(state, model.medium, pores, viscosity, under_gates)


def at_the_same_rate(situation: Situation, share: float) -> Situation:
    """Of what has no room, as much as flows in a share of the step; the rest in later ones.

    What a full volume lacks is drawn in at once: else the front would come back to it.
    """
    excess = situation.excess
    if share == 1.0 or not excess.any():
        return situation
    return replace(situation, excess=np.where(excess > 0.0, share * excess, excess))


def thickness_rate(situation: Situation, flow: Flow) -> np.ndarray:
    """Rate of the cells' thickness [m/s], (C,), with what the pressure of the resin adds."""
    state, lift = situation.state, situation.lift
    if lift is None:
        return state.thickness_rate
    rate = state.thickness_rate.copy()
    rate[lift.cells] += state.lift[lift.cells] * (flow.lifted - lift.reference)
    return rate


# --- the flow -------------------------------------------------------------------------------------


class Stage(NamedTuple):
    """Flow at the start or end of a step [s], in which excess flows off, and how it is driven."""

    step: float
    flow: Flow
    gate_pressure: np.ndarray
    gate_rate: np.ndarray
    bled: np.ndarray
    film_rate: np.ndarray


@dataclass
class _Switches:
    """What is decided while a stage is solved.

    limited : of each gate, whether it is at its pressure. returning : whether resin goes back into
    its hole. wide : whether its hole acts by the edges around it, see :func:`.holes.widening`.
    shut : vents whose resin would be drawn back, (N,). spent : of the film, what has run out.
    resting : the step may be longer than the front takes to come to rest against gravity.
    """

    limited: list[bool]
    returning: list[bool]
    wide: list[bool]
    shut: np.ndarray
    spent: np.ndarray
    resting: bool


class DrivenFlow:
    """Solves the flow of the stages of a step; keeps the factors of its matrices."""

    def __init__(self, model: FillingModel) -> None:
        self.model = model
        self.factors = Factors()

    def stage(
        self, situation: Situation, state: FillingState, step: float, resting: bool = False
    ) -> Stage:
        """Flow of a state, with gates at their rate unless that needs more than their pressure.

        resting : the step may be longer than the front takes to come to rest against gravity.
        """
        gates = situation.gates
        film = situation.film
        switches = _Switches(
            limited=[gate.rate is None for gate in gates],
            returning=[False] * len(gates),
            wide=[False] * len(gates),
            shut=np.zeros(len(state.full), dtype=bool),
            spent=np.zeros(0 if film is None else len(film.fed), dtype=bool),
            resting=resting,
        )
        for _ in range(3 * len(gates) + 12):
            flow = self._solve(situation, state, step, switches)
            pressure, rate = self._at_gates(situation, flow, switches)
            changed = self._switch_gates(situation, state, switches, flow, pressure, rate)
            drawn = situation.bleeds & (flow.net > 1e-9 * np.abs(flow.along).max(initial=0.0))
            drawn &= state.full & ~switches.shut
            if drawn.any():
                switches.shut |= drawn
                changed = True
            if film is not None:
                over = film.overdrawn(flow.net, step, switches.spent)
                changed |= bool((over & ~switches.spent).any())
                switches.spent = over
            if not changed:
                break
        shut = switches.shut
        bled = np.where(situation.bleeds & state.full & ~shut, -flow.net, 0.0)
        drawn_from_film = np.zeros(0) if film is None else film.rate(flow.net, step, switches.spent)
        return Stage(step, flow, pressure, rate, bled, drawn_from_film)

    def _switch_gates(
        self,
        situation: Situation,
        state: FillingState,
        switches: _Switches,
        flow: Flow,
        pressure: np.ndarray,
        rate: np.ndarray,
    ) -> bool:
        """Take back what the gates' pressures and rates were wrongly taken for."""
        changed = False
        for k, gate in enumerate(situation.gates):
            if not gate.ready:
                continue
            limited = switches.limited[k]
            back = limited and gate.contact < 0.0 and rate[gate.number] < 0.0
            if situation.lift is not None and back and not switches.returning[k]:
                switches.returning[k] = changed = True
            if not switches.wide[k] and self._lifts_others(
                gate, state, flow, float(pressure[gate.number])
            ):
                switches.wide[k] = changed = True
                continue
            if limited or gate.pressure is None:
                continue
            if pressure[gate.number] > gate.pressure * (1.0 + 1e-9):
                switches.limited[k] = changed = True
        return changed

    def _lifts_others(self, gate: OpenGate, state: FillingState, flow: Flow, own: float) -> bool:
        """Whether the nodes in a hole, above its pressure [Pa], have lifted one beside it so far.

        Their pressure stands for the field of a hole that gives resin all around. Where a rim, the
        front or another gate is near, a node beside the hole may stand still, and then has theirs.
        """
        nodes = gate.gate.nodes
        if not (np.isfinite(gate.contact) and gate.contact < 0.0 and flow.pressure[nodes[0]] > own):
            return False
        beside = neighbours(self.model.medium.network, nodes)
        # Potentials: below the hole the weight of the resin adds to its pressure.
        most = own - float(self.height()[nodes].min())
        return bool((flow.potential[beside[state.full[beside]]] > most).any())

    def _solve(
        self, situation: Situation, state: FillingState, step: float, switches: _Switches
    ) -> Flow:
        count = len(state.full)
        network = self.model.medium.network
        fixed = np.where(state.full & ~switches.shut, situation.vent_pressure, np.nan)
        contact, outside = np.zeros(count), np.zeros(count)
        source = np.where(state.full, -situation.pore_rate + situation.excess / step, 0.0)
        hole, in_hole = np.full(count, np.nan), np.zeros(count)
        tied = []
        wider = None
        for k, gate in enumerate(situation.gates):
            if not gate.ready:
                continue
            nodes, wide = gate.gate.nodes, switches.wide[k]
            if wide:
                assert gate.gate.radius is not None  # as only holes are wide
                own = widening(
                    network, situation.conductances, nodes, gate.gate.radius, gate.contact, state
                )
                wider = own if wider is None else np.maximum(wider, own)
            if not switches.limited[k]:
                tied.append((nodes, float(gate.rate or 0.0)))
                if gate.contact < 0.0 and not wide:
                    in_hole[nodes] = float(gate.rate or 0.0) / gate.contact
            elif np.isfinite(gate.contact) and not wide:
                contact[nodes[0]], outside[nodes[0]] = gate.contact, gate.pressure
                tied.append((nodes, 0.0))
                if gate.contact < 0.0 and not switches.returning[k]:
                    hole[nodes] = gate.pressure
            else:
                fixed[nodes] = gate.pressure
        if situation.film is not None:
            situation.film.drive(contact, outside, source, step, switches.spent)
        pocket, compliance = self._pockets(situation, step)
        boundary = Boundary(
            fixed, source, tuple(tied), contact, outside, situation.state.air_pressure,
            self.height(), pocket, hole, in_hole, compliance, situation.lift,
            situation.pores / step if switches.resting else None, wider,
            self._sinking(situation, state, step),
        )  # fmt: skip
        return solve_flow(
            network, situation.conductances, state.full, state.fill, boundary, state.pressure,
            self.factors,
        )  # fmt: skip

    def _sinking(self, situation: Situation, state: FillingState, step: float) -> Sinking | None:
        """Columns that fill through the thickness, from where they are at the step's start."""
        network = self.model.medium.network
        if network.links is None:
            return None
        first = network.in_plane_count
        start = situation.state
        return Sinking(
            network.links, first, situation.conductances.flow[first:], state.full, start.fill,
            situation.pores, start.air_pressure - self.height(), step,
        )  # fmt: skip

    def _pockets(self, situation: Situation, step: float) -> tuple[np.ndarray, np.ndarray]:
        air = situation.air
        if not self.model.options.trapped_air or air.vented.all():
            return np.full(len(air.region), -1), np.zeros(0)
        closed = np.flatnonzero(~air.vented)
        number = np.full(len(air.vented), -1)
        number[closed] = np.arange(len(closed))
        pocket = np.where(air.region >= 0, np.append(number, -1)[air.region], -1)
        return pocket, air.volume[closed] / (air.pressure[closed] * step)

    def _at_gates(
        self, situation: Situation, flow: Flow, switches: _Switches
    ) -> tuple[np.ndarray, np.ndarray]:
        """Pressure [Pa] and flow rate [m3/s] of all gates, nan for those that are closed."""
        count = len(self.model.supply.gates)
        pressure, rate = np.full(count, np.nan), np.full(count, np.nan)
        for gate, wide in zip(situation.gates, switches.wide, strict=True):
            if gate.ready:
                nodes = gate.gate.nodes
                rate[gate.number] = flow.net[nodes].sum()
                pressure[gate.number] = flow.pressure[nodes[0]]
                if np.isfinite(gate.contact) and not wide:
                    pressure[gate.number] += rate[gate.number] / gate.contact
        return pressure, rate

    def height(self) -> np.ndarray:
        """ρ g·x of the nodes [Pa], (N,)."""
        return self.model.height(self.model.medium.mesh.points)


def check_balance(model: FillingModel, situation: Situation, stage: Stage) -> None:
    """What full nodes give off beyond their source comes from gates and vents alone."""
    net = np.abs(stage.flow.net)
    for gate in situation.gates:
        net[gate.gate.nodes] = 0.0
    net[situation.bleeds] = 0.0
    if situation.film is not None:
        net[situation.film.fed] = 0.0
    scale = np.abs(stage.flow.along).max(initial=0.0)
    worst = int(np.argmax(net))
    # Where resin comes to rest, as against trapped air, flows are differences of pressures that
    # are next to nothing.
    conductance = np.abs(situation.conductances.flow).max(initial=0.0)
    noise = 1e-12 * float(conductance * np.abs(stage.flow.pressure).max())
    if situation.lift is not None:
        lift = situation.lift
        pressure = np.abs(stage.flow.lifted) + np.abs(lift.reference)
        noise += 1e-12 * float(np.max(lift.conductance * pressure))
    if net[worst] > 1e-6 * scale + noise and net[worst] > 0.0:
        place = ", ".join(f"{x:.6g}" for x in model.medium.mesh.points[worst])
        raise SimulationError(
            f"at {situation.state.time:.6g} s resin is squeezed or drawn around node {worst} "
            f"at ({place}) m, and has no way in or out; open a gate or vent there"
        )
