"""Flow at the start or end of a time step, with gates, vents and film as they drive it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from lcmchain.coupling.infiltration.factors import Factors
from lcmchain.coupling.infiltration.flow_medium import Sinking
from lcmchain.coupling.infiltration.holes import neighbours, widening
from lcmchain.coupling.infiltration.pressure import Boundary, Flow, solve_flow
from lcmchain.coupling.infiltration.situation import Situation
from lcmchain.coupling.infiltration.state import FillingState
from lcmchain.coupling.infiltration.supply import OpenGate
from lcmchain.errors import SimulationError

if TYPE_CHECKING:
    from lcmchain.coupling.infiltration.filling import Filling


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

    def __init__(self, filling: Filling) -> None:
        self.filling = filling
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
        beside = neighbours(self.filling.medium.network, nodes)
        # Potentials: below the hole the weight of the resin adds to its pressure.
        most = own - float(self.height()[nodes].min())
        return bool((flow.potential[beside[state.full[beside]]] > most).any())

    def _solve(
        self, situation: Situation, state: FillingState, step: float, switches: _Switches
    ) -> Flow:
        filling, count = self.filling, len(state.full)
        network = filling.medium.network
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
                own = widening(network, situation.conductances, gate.gate, gate.contact, state)
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
        network = self.filling.medium.network
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
        if not self.filling.options.trapped_air or air.vented.all():
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
        count = len(self.filling.supply.gates)
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
        return self.filling.height(self.filling.medium.mesh.points)


def check_balance(filling: Filling, situation: Situation, stage: Stage) -> None:
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
        place = ", ".join(f"{x:.6g}" for x in filling.mesh.points[worst])
        raise SimulationError(
            f"at {situation.state.time:.6g} s resin is squeezed or drawn around node {worst} "
            f"at ({place}) m, and has no way in or out; open a gate or vent there"
        )
