"""Flow at the start or end of a time step, with gates, vents and film as they drive it."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from lcmchain.coupling.infiltration.factors import Factors
from lcmchain.coupling.infiltration.pressure import Boundary, Flow, solve_flow
from lcmchain.coupling.infiltration.situation import Situation
from lcmchain.coupling.infiltration.state import FillingState
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
        limited = [gate.rate is None for gate in gates]
        returning = [False] * len(gates)
        shut = np.zeros(len(state.full), dtype=bool)
        film = situation.film
        spent = np.zeros(0 if film is None else len(film.fed), dtype=bool)
        for _ in range(2 * len(gates) + 12):
            flow = self._solve(situation, state, step, limited, returning, shut, spent, resting)
            pressure, rate = self._at_gates(situation, flow)
            changed = False
            for k, gate in enumerate(gates):
                if not gate.ready:
                    continue
                back = limited[k] and gate.contact < 0.0 and rate[gate.number] < 0.0
                if situation.lift is not None and back and not returning[k]:
                    returning[k] = changed = True
                if limited[k] or gate.pressure is None:
                    continue
                if pressure[gate.number] > gate.pressure * (1.0 + 1e-9):
                    limited[k] = changed = True
            drawn = situation.bleeds & (flow.net > 1e-9 * np.abs(flow.along).max(initial=0.0))
            drawn &= state.full & ~shut
            if drawn.any():
                shut |= drawn
                changed = True
            if film is not None:
                over = film.overdrawn(flow.net, step, spent)
                changed |= bool((over & ~spent).any())
                spent = over
            if not changed:
                break
        bled = np.where(situation.bleeds & state.full & ~shut, -flow.net, 0.0)
        drawn_from_film = np.zeros(0) if film is None else film.rate(flow.net, step, spent)
        return Stage(step, flow, pressure, rate, bled, drawn_from_film)

    def _solve(
        self,
        situation: Situation,
        state: FillingState,
        step: float,
        limited: list[bool],
        returning: list[bool],
        shut: np.ndarray,
        spent: np.ndarray,
        resting: bool,
    ) -> Flow:
        filling, count = self.filling, len(state.full)
        network = filling.medium.network
        fixed = np.where(state.full & ~shut, situation.vent_pressure, np.nan)
        contact, outside = np.zeros(count), np.zeros(count)
        source = np.where(state.full, -situation.pore_rate + situation.excess / step, 0.0)
        hole, in_hole = np.full(count, np.nan), np.zeros(count)
        tied = []
        for gate, at_pressure, returns in zip(situation.gates, limited, returning, strict=True):
            if not gate.ready:
                continue
            nodes = gate.gate.nodes
            if not at_pressure:
                tied.append((nodes, float(gate.rate or 0.0)))
                if gate.contact < 0.0:
                    in_hole[nodes] = float(gate.rate or 0.0) / gate.contact
            elif np.isfinite(gate.contact):
                contact[nodes[0]], outside[nodes[0]] = gate.contact, gate.pressure
                tied.append((nodes, 0.0))
                if gate.contact < 0.0 and not returns:
                    hole[nodes] = gate.pressure
            else:
                fixed[nodes] = gate.pressure
        if situation.film is not None:
            situation.film.drive(contact, outside, source, step, spent)
        pocket, compliance = self._pockets(situation, step)
        boundary = Boundary(
            fixed, source, tuple(tied), contact, outside, situation.state.air_pressure,
            self.height(), pocket, hole, in_hole, compliance, situation.lift,
            situation.pores / step if resting else None,
        )  # fmt: skip
        return solve_flow(
            network, situation.conductances, state.full, state.fill, boundary, state.pressure,
            self.factors,
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

    def _at_gates(self, situation: Situation, flow: Flow) -> tuple[np.ndarray, np.ndarray]:
        """Pressure [Pa] and flow rate [m3/s] of all gates, nan for those that are closed."""
        count = len(self.filling.supply.gates)
        pressure, rate = np.full(count, np.nan), np.full(count, np.nan)
        for gate in situation.gates:
            if gate.ready:
                nodes = gate.gate.nodes
                rate[gate.number] = flow.net[nodes].sum()
                pressure[gate.number] = flow.pressure[nodes[0]]
                if np.isfinite(gate.contact):
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
