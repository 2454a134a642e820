"""One time step of a filling: pressure, front, transport.

The flow is quasi-static. A step takes the flow at its start, moves the front with it as far as it
gets, takes the flow there, and moves the front from the start with the mean of both (Heun). Both
flows are those through one interface, that between the volumes that are full at the start and the
others; what a volume receives beyond its pores goes on to its neighbours
(:mod:`lcmchain.coupling.infiltration.overflow`), so that the front may cross many control volumes
in a step and every step conserves resin to round-off.
"""

from __future__ import annotations

import weakref
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from lcmchain.coupling.infiltration.air import Air, find_air, new_dry_spots
from lcmchain.coupling.infiltration.carried import carry
from lcmchain.coupling.infiltration.factors import Factors
from lcmchain.coupling.infiltration.film_supply import FilmFlow, FilmSinking, FilmSupply
from lcmchain.coupling.infiltration.network import Conductances
from lcmchain.coupling.infiltration.outcome import idle_outcome
from lcmchain.coupling.infiltration.overflow import FULL, Passed, Stuck, pass_on
from lcmchain.coupling.infiltration.pressure import (
    Boundary,
    Flow,
    Lift,
    longest_free_step,
    solve_flow,
)
from lcmchain.coupling.infiltration.state import FillingState
from lcmchain.coupling.infiltration.supply import OpenGate, Priming, prime
from lcmchain.errors import SimulationError

if TYPE_CHECKING:
    from lcmchain.coupling.infiltration.filling import Filling

MOST_CUTS = 60
#: Resin that has no room after a jump of the pores flows in a step cut so often, else in more.
CUTS_OF_EXCESS = 12
#: So many steps in a row, each below this share of what is left of the time, lead nowhere.
MOST_TINY_STEPS, TINY = 2000, 1e-9
#: Of time steps in which the front comes to rest against gravity: their flow lags behind.
MOST_GROWTH = 1.1
# Of the pore volume, over all that is left of the time: less is no flow.
NO_FLOW = 1e-10
# Of the pores of a control volume: what a full one may lack and stay so although they shrink, and
# the round-off of its content.
NEARLY, ROUND_OFF = 0.5 * (1.0 - FULL), 1e-13


@dataclass(frozen=True)
class Situation:
    """What holds at the start of a step and is kept over it."""

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


class Stage(NamedTuple):
    """Flow at the start or end of a step [s], in which excess flows off, and how it is driven."""

    step: float
    flow: Flow
    gate_pressure: np.ndarray
    gate_rate: np.ndarray
    bled: np.ndarray
    film_rate: np.ndarray


class TimeStep:
    """Takes the time steps of a filling."""

    def __init__(self, filling: Filling) -> None:
        # what holds this one; without a circle it is gone as soon as nobody holds it
        self.filling: Filling = weakref.proxy(filling)
        self.factors = Factors()
        self._kept: tuple[Situation, Stage] | None = None
        self._moments: tuple[float, ...] = ()
        self._tiny = 0

    def forget(self) -> None:
        """The state was changed from outside."""
        self._kept = None

    def take(self, until: float) -> tuple[str, str] | None:
        """Take a step towards a time [s]; return outcome and message if nothing moves any more."""
        filling = self.filling
        state = filling.state
        situation, stage, step = self._begin(until)
        moves = self._moves(situation, stage, until)
        switch = filling.supply.next_switch(state.time)
        self._moments = (until, switch) if np.isfinite(switch) else (until,)
        if not moves:
            if not state.full.all() and filling.supply.waits_for_clock(state.time):
                state.time = min(filling.supply.next_look(state.time), until)
                self.forget()
                return None
            return idle_outcome(filling, situation, stage)
        left = until - state.time
        for _ in range(MOST_CUTS):
            share = self._try(situation, stage, step)
            if share >= 1.0:
                self._tiny = self._tiny + 1 if step < TINY * left else 0
                if self._tiny > MOST_TINY_STEPS:
                    break
                return None
            step *= share
            situation = _at_the_same_rate(situation, share)
        raise SimulationError(
            f"time steps collapse at {state.time:.6g} s ({step:.3g} s): resin finds no room "
            f"next to where it is pressed to ({_place(filling, stage)})"
        )

    def refresh(self) -> None:
        """Compute the pressure of the present state."""
        state = self.filling.state
        if self._kept is None:
            situation = self._situation(state)
            self._kept = situation, self._stage(situation, state, state.next_step or 1.0)
        _, stage = self._kept
        state.pressure = stage.flow.pressure
        state.gate_pressure, state.gate_rate = stage.gate_pressure, stage.gate_rate

    def _situation(self, state: FillingState) -> Situation:
        filling = self.filling
        medium, supply = filling.medium, filling.supply
        fluidity = filling.liquid.fluidity(medium, state)
        conductances = medium.conductances(state.thickness, fluidity)
        pores = medium.pores(state.thickness)
        vents = supply.open_vents(state.time, state)
        compressed = filling.options.trapped_air
        air = find_air(medium.network.edges, state, pores, vents, compressed)
        dry = air.region >= 0
        state.air_pressure = state.air_pressure.copy()
        state.air_pressure[dry] = air.pressure[air.region[dry]]
        gates = supply.open_gates(state.time, state, medium.network, conductances)
        primings: list[Priming | FilmSinking] = [
            prime(gate, medium.network, conductances, pores, state)
            for gate in gates
            if not gate.ready
        ]
        vent_pressure = np.full(len(pores), np.nan)
        for _, vent, pressure in vents:
            if not vent.closes_when_wet:
                vent_pressure[vent.nodes] = pressure
        film = None if filling.film is None else self._film(filling.film, state, pores, gates)
        if film is not None and film.sinking is not None:
            primings.append(film.sinking)
        excess = np.where(state.full, state.resin_volume - pores, 0.0)
        # Full volumes may lack a little; what they have too much of is only dropped as round-off.
        excess[(excess > -NEARLY * pores) & (excess < ROUND_OFF * pores)] = 0.0
        return Situation(
            state, conductances, pores, gates, primings, ~np.isnan(vent_pressure), vent_pressure,
            air, excess, medium.pore_rate(state.thickness_rate), medium.lift(state), film,
        )  # fmt: skip

    def _film(
        self, film: FilmSupply, state: FillingState, pores: np.ndarray, gates: list[OpenGate]
    ) -> FilmFlow | None:
        filling = self.filling
        viscosity = filling.liquid.node_viscosity(state)
        under_gates = np.zeros(len(pores), dtype=bool)
        for gate in gates:
            under_gates[gate.gate.nodes] = True
        return film.at(state, filling.medium, pores, viscosity, under_gates)

    def _begin(self, until: float) -> tuple[Situation, Stage, float]:
        """Flow at the start, and the size of the step."""
        filling = self.filling
        state, options = filling.state, filling.options
        if self._kept is None:
            situation = self._situation(state)
        else:
            situation = self._kept[0]
        limit = min(
            until - state.time,
            options.largest_step,
            filling.supply.next_switch(state.time) - state.time,
            filling.supply.longest_step(state.time),
            filling.liquid.longest_step(state),
            *(priming.left for priming in situation.primings if priming.left > 0.0),
        )
        if state.thickness_rate.any() and situation.lift is None:
            fastest = np.max(np.abs(state.thickness_rate) / state.thickness)
            limit = min(limit, options.largest_compaction / fastest)
        jumped = np.abs(situation.excess) > NEARLY * situation.pores
        timed = bool(jumped.any() or len(situation.air.volume) and options.trapped_air)
        timed |= situation.film is not None and len(situation.film.fed) > 0
        if self._kept is not None and not timed and not situation.excess.any():
            stage = self._kept[1]
            return self._resting(situation, stage, min(limit, self._wish(stage, situation)))
        step = min(limit, 2.0 * state.next_step) if timed and state.next_step > 0.0 else limit
        for _ in range(MOST_CUTS if not situation.excess.any() else CUTS_OF_EXCESS):
            if not step > 0.0:
                raise SimulationError(
                    f"no time step is short enough at {state.time:.6g} s: the thickness or the "
                    "pressure changes too fast"
                )
            stage = self._stage(situation, state, step)
            wish = self._wish(stage, situation)
            if not timed or wish >= 0.999 * step:
                break
            step = max(wish, 0.2 * step)
        if situation.lift is not None:
            fastest = np.max(np.abs(_thickness_rate(situation, stage)) / state.thickness)
            step = min(step, options.largest_compaction / max(fastest, 1e-300))
        situation, stage, step = self._resting(situation, stage, min(step, wish))
        return _at_the_same_rate(situation, step / stage.step), stage, step

    def _resting(
        self, situation: Situation, stage: Stage, step: float
    ) -> tuple[Situation, Stage, float]:
        """Flow and step where the front may come to rest against gravity within the step."""
        free = longest_free_step(stage.flow, situation.pores, self._height())
        if step <= free:
            return situation, stage, step
        step = min(step, max(free, MOST_GROWTH * situation.state.next_step))
        return situation, self._stage(situation, situation.state, step, resting=True), step

    def _height(self) -> np.ndarray:
        return self.filling.height(self.filling.medium.mesh.points)

    def _wish(self, stage: Stage, situation: Situation) -> float:
        """Step in which the front crosses as many control volumes as the options say."""
        inflow = np.maximum(stage.flow.inflow, 0.0)
        squared = float(inflow @ inflow)
        if squared == 0.0:
            return np.inf
        crossing = float(inflow @ situation.pores[stage.flow.front.nodes]) / squared
        return self.filling.options.front_step * crossing

    def _moves(self, situation: Situation, stage: Stage, until: float) -> bool:
        left = until - situation.state.time
        if any(np.isfinite(p.duration) and len(p.nodes) for p in situation.primings):
            return True
        if situation.pore_rate.any() or situation.excess.any() or situation.lift is not None:
            return True
        turnover = np.abs(stage.flow.inflow).sum() + np.abs(stage.bled).sum()
        return bool(turnover * left > NO_FLOW * situation.pores.sum())

    def _try(self, situation: Situation, stage: Stage, step: float) -> float:
        """Take a step of this size; if it is too large, return the share of it to try next."""
        state = situation.state
        if stage.step != step and (situation.excess < 0.0).any():
            stage = self._stage(situation, state, step)
        rate = _thickness_rate(situation, stage)
        pores_end = self._pores_at(situation, rate, step)
        first = self._moved(situation, stage.flow.along, pores_end, step)
        if isinstance(first, Stuck):
            return first.share
        ahead = self._predicted(situation, first, pores_end, state.thickness + step * rate)
        conductances = self._conductances_at(situation, ahead)
        later = self.filling.supply.at_time(situation.gates, state.time + step)
        there = replace(situation, conductances=conductances, gates=later)
        second = self._stage(there, ahead, step, resting=bool(self.filling.gravity.any()))
        along = 0.5 * (stage.flow.along + second.flow.along)
        rate = 0.5 * (rate + _thickness_rate(situation, second))
        pores_end = self._pores_at(situation, rate, step)
        last = self._moved(situation, along, pores_end, step)
        if isinstance(last, Stuck):
            return last.share
        self._check_balance(situation, stage)
        fill_time = self._arrivals(situation, (stage, second), last, pores_end, step)
        early = self._before_trigger(state, fill_time, step)
        if early < 1.0:
            return early
        self._finish(situation, (stage, second), last, fill_time, along, pores_end, step)
        state.thickness = state.thickness + step * rate
        state.next_step = step
        return 1.0

    def _pores_at(self, situation: Situation, rate: np.ndarray, step: float) -> np.ndarray:
        """Pores after a step in which the thickness changes at a rate (C,) [m/s]."""
        if not rate.any():
            return situation.pores
        return self.filling.medium.pores(situation.state.thickness + step * rate)

    def _conductances_at(self, situation: Situation, ahead: FillingState) -> Conductances:
        state, filling = situation.state, self.filling
        if not state.thickness_rate.any() and situation.lift is None:
            return situation.conductances
        fluidity = filling.liquid.fluidity(filling.medium, state)
        return filling.medium.conductances(ahead.thickness, fluidity)

    def _moved(
        self, situation: Situation, along: np.ndarray, pores_end: np.ndarray, step: float
    ) -> tuple[Passed, np.ndarray, np.ndarray] | Stuck:
        """Volumes after a step with these flows; what each one received, and from gates."""
        state, network = situation.state, self.filling.medium.network
        first, second = network.edges.T
        forth = state.full[first] & ~state.full[second]
        back = state.full[second] & ~state.full[first]
        count = len(state.full)
        rate = np.zeros(count)  # the count of no edges at all has no decimals
        rate += np.bincount(second[forth], along[forth], minlength=count)
        rate -= np.bincount(first[back], along[back], minlength=count)
        primed = np.zeros(count)
        growth = pores_end - situation.pores
        for priming in situation.primings:
            primed[priming.nodes] += priming.volumes(step, growth[priming.nodes])
        received = step * rate + primed
        squeezed = growth - situation.excess
        volume = state.resin_volume + np.where(state.full, squeezed, received)
        passed = pass_on(
            network.edges, situation.conductances.flow, state.resin_volume, volume, pores_end,
            situation.pores,
            rate + primed / step, situation.bleeds, state.full,
            self.filling.options.largest_excess,
        )  # fmt: skip
        if isinstance(passed, Stuck):
            return passed
        return passed, received, primed

    def _predicted(
        self,
        situation: Situation,
        moved: tuple[Passed, np.ndarray, np.ndarray],
        pores_end: np.ndarray,
        thickness: np.ndarray,
    ) -> FillingState:
        """State after a step by the flow at its start; thickness (C,) [m] is that of its end."""
        state = situation.state
        volume = moved[0].volume
        full = volume >= FULL * pores_end
        # Where the last air goes, the front stays: behind it the flow would stop within the step.
        first, second = self.filling.medium.network.edges.T
        count = len(full)
        open_ends = np.bincount(first, ~full[second], minlength=count)
        open_ends += np.bincount(second, ~full[first], minlength=count)
        # Full volumes stay so, for the balance over the interface that the step began with.
        full = state.full | (full & (open_ends > 0))
        return replace(
            state,
            resin_volume=volume,
            full=full,
            fill=np.minimum(volume / pores_end, 1.0),
            thickness=thickness,
        )

    def _stage(
        self, situation: Situation, state: FillingState, step: float, resting: bool = False
    ) -> Stage:
        """Flow of a state, with gates at their rate unless that needs more than their pressure.

        resting : the step may be longer than the front takes to come to rest against gravity.
        """
        gates = situation.gates
        limited = [gate.rate is None for gate in gates]
        shut = np.zeros(len(state.full), dtype=bool)
        film = situation.film
        spent = np.zeros(0 if film is None else len(film.fed), dtype=bool)
        for _ in range(2 * len(gates) + 12):
            flow = self._solve(situation, state, step, limited, shut, spent, resting)
            pressure, rate = self._at_gates(situation, flow)
            changed = False
            for k, gate in enumerate(gates):
                if not gate.ready or gate.rate is None or gate.pressure is None:
                    continue
                if not limited[k] and pressure[gate.number] > gate.pressure * (1.0 + 1e-9):
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
        shut: np.ndarray,
        spent: np.ndarray,
        resting: bool,
    ) -> Flow:
        filling, count = self.filling, len(state.full)
        network = filling.medium.network
        fixed = np.where(state.full & ~shut, situation.vent_pressure, np.nan)
        contact, outside = np.zeros(count), np.zeros(count)
        source = np.where(state.full, -situation.pore_rate + situation.excess / step, 0.0)
        tied = []
        for gate, at_pressure in zip(situation.gates, limited, strict=True):
            if not gate.ready:
                continue
            nodes = gate.gate.nodes
            if not at_pressure:
                tied.append((nodes, float(gate.rate or 0.0)))
            elif np.isfinite(gate.contact):
                contact[nodes[0]], outside[nodes[0]] = gate.contact, gate.pressure
                tied.append((nodes, 0.0))
            else:
                fixed[nodes] = gate.pressure
        if situation.film is not None:
            situation.film.drive(contact, outside, source, step, spent)
        pocket, compliance = self._pockets(situation, step)
        boundary = Boundary(
            fixed, source, tuple(tied), contact, outside, situation.state.air_pressure,
            self._height(), pocket, compliance, situation.lift,
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

    def _check_balance(self, situation: Situation, stage: Stage) -> None:
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
            place = ", ".join(f"{x:.6g}" for x in self.filling.mesh.points[worst])
            raise SimulationError(
                f"at {situation.state.time:.6g} s resin is squeezed or drawn around node {worst} "
                f"at ({place}) m, and has no way in or out; open a gate or vent there"
            )

    def _finish(
        self,
        situation: Situation,
        stages: tuple[Stage, Stage],
        moved: tuple[Passed, np.ndarray, np.ndarray],
        fill_time: np.ndarray,
        along: np.ndarray,
        pores_end: np.ndarray,
        step: float,
    ) -> None:
        """Write what a step has brought into the state."""
        filling, state = self.filling, situation.state
        passed, _, primed = moved
        volume, full = passed.volume, passed.volume >= FULL * pores_end
        self._count_boundaries(situation, stages, passed, primed, step)
        state.fill_time = fill_time
        if situation.film is not None:
            self._take_film(situation.film, stages, primed, step)
        if filling.liquid.changes:
            self._carry(situation, passed, primed, along, volume, step)
            filling.liquid.rest(filling.medium, state, volume > 0.0, step)
        if filling.options.trapped_air:
            state.air_pressure = _compressed(
                situation.air, state.air_pressure, pores_end - volume, full,
                filling.medium.network.edges,
            )  # fmt: skip
        state.resin_volume, state.full = volume, full
        state.fill = np.minimum(volume / pores_end, 1.0)
        state.pressure = stages[1].flow.pressure
        state.gate_pressure, state.gate_rate = stages[1].gate_pressure, stages[1].gate_rate
        state.time = self._snapped(state.time + step)
        state.step_count += 1
        self._kept = None
        vents = filling.supply.open_vents(state.time, state)
        air = find_air(
            filling.medium.network.edges, state, pores_end, vents, filling.options.trapped_air
        )
        state.enclosed, spots = new_dry_spots(air, filling.medium, state, pores_end)
        state.dry_spots = (*state.dry_spots, *spots)

    def _snapped(self, time: float) -> float:
        """The time, or the moment that the step was meant to reach if it is that to round-off."""
        for moment in self._moments:
            if abs(time - moment) <= 1e-12 * abs(moment):
                return moment
        return time

    def _take_film(
        self,
        film: FilmFlow,
        stages: tuple[Stage, Stage],
        primed: np.ndarray,
        step: float,
    ) -> None:
        """Take from the film what has entered the sheet."""
        state = self.filling.state
        taken = np.zeros(len(state.film))
        taken[film.fed] = 0.5 * step * (stages[0].film_rate + stages[1].film_rate)
        if film.sinking is not None:
            taken[film.sinking.nodes] = primed[film.sinking.nodes]
        state.film = np.maximum(state.film - taken / self.filling.medium.node_area, 0.0)
        state.from_film += float(taken.sum())

    def _count_boundaries(
        self,
        situation: Situation,
        stages: tuple[Stage, Stage],
        passed: Passed,
        primed: np.ndarray,
        step: float,
    ) -> None:
        state, supply = situation.state, self.filling.supply
        state.injected, state.vented = state.injected.copy(), state.vented.copy()
        for gate in situation.gates:
            nodes = gate.gate.nodes
            if gate.ready:
                mean = 0.5 * (stages[0].flow.net[nodes].sum() + stages[1].flow.net[nodes].sum())
                state.injected[gate.number] += step * mean
            else:
                state.injected[gate.number] += primed[nodes].sum()
        was_full = state.full
        bled = 0.5 * step * (stages[0].bled + np.where(was_full, stages[1].bled, 0.0))
        for number, vent, _ in supply.open_vents(state.time, state):
            state.vented[number] += (bled + passed.vented)[vent.nodes].sum()

    def _before_trigger(self, state: FillingState, fill_time: np.ndarray, step: float) -> float:
        """Share of the step after which the front reaches a node that opens or closes a place."""
        watched = self.filling.supply.watched
        new = watched[np.isnan(state.fill_time[watched]) & ~np.isnan(fill_time[watched])]
        if not len(new):
            return 1.0
        share = (float(fill_time[new].min()) - state.time) / step
        return 1.0 if share > 0.98 else max(share, 0.02) * (1.0 + 1e-6)

    def _arrivals(
        self,
        situation: Situation,
        stages: tuple[Stage, Stage],
        moved: tuple[Passed, np.ndarray, np.ndarray],
        pores_end: np.ndarray,
        step: float,
    ) -> np.ndarray:
        """When the front passed the nodes [s], from the fill factor at which it does."""
        state = situation.state
        passed, received, _ = moved
        threshold = np.full(len(pores_end), 0.5)
        for stage in (stages[1], stages[0]):
            threshold[stage.flow.front.nodes] = stage.flow.front.passed()
        handed = np.bincount(passed.target, passed.moved, minlength=len(pores_end))
        reached = (state.resin_volume + received + handed) / pores_end
        new = np.isnan(state.fill_time) & (reached >= threshold * FULL)
        rate = np.where(passed.rate > 0.0, passed.rate, np.inf)
        late = np.maximum(reached - threshold, 0.0) * pores_end / rate
        end = state.time + step
        return np.where(new, np.clip(end - late, state.time, end), state.fill_time)

    def _carry(
        self,
        situation: Situation,
        passed: Passed,
        primed: np.ndarray,
        along: np.ndarray,
        volume: np.ndarray,
        step: float,
    ) -> None:
        filling, state = self.filling, situation.state
        first, second = filling.medium.network.edges.T
        known = state.full[first] | state.full[second]
        source = np.concatenate([first[known], passed.source])
        target = np.concatenate([second[known], passed.target])
        moved = np.concatenate([step * along[known], passed.moved])
        entered = primed + np.where(state.full, 0.0, 0.0)
        balance = np.zeros(len(volume))
        np.add.at(balance, target, moved)
        np.subtract.at(balance, source, moved)
        gates = np.zeros(len(volume), dtype=bool)
        for gate in situation.gates:
            gates[gate.gate.nodes] = gate.ready
        if situation.film is not None:
            gates[situation.film.fed] = True
        missing = volume - state.resin_volume - balance
        entered = entered + np.where(gates & state.full, np.maximum(missing, 0.0), 0.0)
        now = state.time
        cure = np.full(len(volume), filling.liquid.resin.initial_cure)
        if situation.film is not None:
            cure[situation.film.nodes] = state.film_cure
        temperature = np.full(len(volume), filling.liquid.inlet_temperature(now))
        for name, inlet in (("cure", cure), ("temperature", temperature)):
            value = getattr(state, name)
            carried = carry(
                value, state.resin_volume, volume, source, target, moved, entered, inlet
            )
            setattr(state, name, carried)


def _compressed(
    air: Air, pressure: np.ndarray, room: np.ndarray, full: np.ndarray, edges: np.ndarray
) -> np.ndarray:
    """Air pressure (N,) after a step: pressure times volume of each closed region stays.

    Where the front goes back, the volumes that it leaves belong to the region beside them.
    """
    region = air.region.copy()
    opened = (region < 0) & ~full
    while opened.any():
        sides = np.concatenate([edges, edges[:, ::-1]])
        sides = sides[opened[sides[:, 0]] & (region[sides[:, 1]] >= 0)]
        if not len(sides):
            break
        region[sides[:, 0]] = region[sides[:, 1]]
        opened = (region < 0) & ~full
    dry = region >= 0
    size = len(air.volume)
    left = np.bincount(region[dry], np.maximum(room[dry], 0.0), minlength=size)
    # Of the air that the step would squeeze to nothing a thousandth of its volume is left.
    raised = air.pressure * air.volume / np.maximum(left, 1e-3 * air.volume)
    values = np.where(air.vented, air.pressure, raised)
    after = pressure.copy()
    after[dry] = values[region[dry]]
    return after


def _at_the_same_rate(situation: Situation, share: float) -> Situation:
    """Of what has no room, as much as flows in a share of the step; the rest in later ones.

    What a full volume lacks is drawn in at once: else the front would come back to it.
    """
    excess = situation.excess
    if share == 1.0 or not excess.any():
        return situation
    return replace(situation, excess=np.where(excess > 0.0, share * excess, excess))


def _thickness_rate(situation: Situation, stage: Stage) -> np.ndarray:
    """Rate of the cells' thickness [m/s], (C,), with what the pressure of the resin adds."""
    state, lift = situation.state, situation.lift
    if lift is None:
        return state.thickness_rate
    rate = state.thickness_rate.copy()
    rate[lift.cells] += state.lift[lift.cells] * (stage.flow.lifted - lift.reference)
    return rate


def _place(filling: Filling, stage: Stage) -> str:
    front = stage.flow.front.nodes
    if not len(front):
        return "no front"
    node = front[np.argmax(stage.flow.inflow)]
    return "near (" + ", ".join(f"{x:.6g}" for x in filling.mesh.points[node]) + ") m"
