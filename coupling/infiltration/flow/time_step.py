"""One time step of a filling: pressure, front, transport.

The flow is quasi-static. A step computes the flow at its start and moves the front by it, computes
the flow there, and moves the front from the start by the mean of both (Heun). Both flows cross the
same interface, between the volumes that are full at the start and the others. Resin beyond the
pores of a volume goes on to its neighbours (:mod:`lcmchain.coupling.infiltration.flow.motion`), so
that the front may cross many control volumes in a step, and every step conserves resin to
round-off.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from lcmchain.coupling.infiltration.flow.driven_flow import (
    NEARLY,
    DrivenFlow,
    FillingModel,
    Situation,
    Stage,
    at_the_same_rate,
    check_balance,
    situation_of,
    thickness_rate,
)
from lcmchain.coupling.infiltration.flow.motion import (
    Stuck,
    age,
    arrivals,
    finish_step,
    move,
    predict,
)
from lcmchain.coupling.infiltration.flow.network import Conductances
from lcmchain.coupling.infiltration.flow.pressure import Work, longest_free_step
from lcmchain.coupling.infiltration.flow.state import FillingState
from lcmchain.errors import SimulationError

#: Most reductions of a time step.
MOST_CUTS = 60
#: Most times that air comes in before a step; each time the front goes back.
MOST_OPENINGS = 20
#: Most reductions of a step in which resin without room flows off, after a jump of the pores.
CUTS_OF_EXCESS = 12
#: Number of steps in a row below a share of the remaining time, with which a filling fails.
MOST_TINY_STEPS, TINY = 2000, 1e-9
#: Growth of time steps in which the front comes to rest against gravity: their flow lags behind.
MOST_GROWTH = 1.1
# Flow over all the remaining time, relative to the pore volume, that counts as none.
NO_FLOW = 1e-10


class Present(NamedTuple):
    """Pressures of the nodes (N,) [Pa], and of gates (G,) [Pa], and flow rates of gates [m³/s]."""

    pressure: np.ndarray
    gate_pressure: np.ndarray
    gate_rate: np.ndarray


class TimeStep:
    """Takes the time steps of a filling; keeps the flow of the present state.

    The state must be the same object in every call, and only the steps may change it. After any
    other change call :meth:`forget` first.
    """

    def __init__(self, model: FillingModel) -> None:
        self.model = model
        self._driven = DrivenFlow(model)
        self._kept: tuple[Situation, Stage] | None = None
        # whether the state has the pressure of its last step, and the flow of the state itself
        self._behind = False
        self._looked: tuple[Situation, Stage] | None = None
        self._moments: tuple[float, ...] = ()
        self._tiny = 0

    @property
    def work(self) -> Work:
        """Matrices factorised and systems solved so far."""
        return self._driven.factors.work

    def forget(self) -> None:
        """Forget the flow: the state was changed from outside."""
        self._kept = self._looked = None
        self._behind = False

    def take(self, state: FillingState, until: float) -> tuple[str, str] | None:
        """Take a step towards a time [s]; return outcome and message if nothing moves any more."""
        supply = self.model.supply
        self._let_air_in(state)
        situation, stage, step = self._begin(state, until)
        moves = self._moves(situation, stage, until)
        switch = supply.next_switch(state.time)
        self._moments = (until, switch) if np.isfinite(switch) else (until,)
        if not moves:
            if not state.full.all() and supply.waits_for_clock(state.time):
                state.time = min(supply.next_look(state.time), until)
                self.forget()
                self._behind = True
                return None
            return _idle_outcome(self.model, situation)
        left = until - state.time
        for _ in range(MOST_CUTS):
            share = self._try(situation, stage, step)
            if share >= 1.0:
                self._tiny = self._tiny + 1 if step < TINY * left else 0
                if self._tiny > MOST_TINY_STEPS:
                    break
                return None
            step *= share
            situation = at_the_same_rate(situation, share)
        raise SimulationError(
            f"time steps collapse at {state.time:.6g} s ({step:.3g} s): resin finds no room "
            f"next to where it is pressed to ({_place(self.model, stage)})"
        )

    def _let_air_in(self, state: FillingState) -> None:
        """Let air into control volumes beside an open face that would be under suction.

        Their resin may flow back from there. They keep it, and count as full again where it fills
        the pores after a time step.
        """
        faces = self.model.open_faces
        for _ in range(MOST_OPENINGS if faces is not None else 0):
            assert faces is not None
            _, stage = self._kept or self._look(state)
            drawn = faces.drawn(state.full, stage.flow.pressure)
            if not drawn.any():
                return
            state.full = state.full & ~drawn
            state.pressure = np.where(drawn, faces.pressure, state.pressure)
            state.air_pressure = np.where(drawn, faces.pressure, state.air_pressure)
            self.forget()

    def refresh(self, state: FillingState) -> None:
        """Write the pressure of the present state into it."""
        if self._kept is None:
            self._kept = self._look(state)
        _, stage = self._kept
        state.pressure = stage.flow.pressure
        state.gate_pressure, state.gate_rate = stage.gate_pressure, stage.gate_rate
        self._behind = False

    def present(self, state: FillingState) -> Present:
        """Return the pressures of the present state.

        After a step the state has the pressures of that step. They belong to the volumes that were
        full before the step: volumes that became full in it still count as the front there.
        """
        if not self._behind:
            return Present(state.pressure, state.gate_pressure, state.gate_rate)
        _, stage = self._look(state)
        return Present(stage.flow.pressure, stage.gate_pressure, stage.gate_rate)

    def _look(self, state: FillingState) -> tuple[Situation, Stage]:
        """Return situation and flow of the present state, with which the next step may begin."""
        if self._looked is None:
            situation = situation_of(self.model, state)
            stage = self._driven.stage(situation, state, state.next_step or 1.0)
            self._looked = situation, stage
        return self._looked

    def _begin(self, state: FillingState, until: float) -> tuple[Situation, Stage, float]:
        """Return situation and flow at the start, and the size of the step."""
        model, options = self.model, self.model.options
        known = self._kept or self._looked
        situation = situation_of(model, state) if known is None else known[0]
        limit = min(
            until - state.time,
            options.largest_step,
            model.supply.next_switch(state.time) - state.time,
            model.supply.longest_step(state.time),
            model.liquid.longest_step(state),
            *(priming.left for priming in situation.primings if priming.left > 0.0),
        )
        if state.thickness_rate.any() and situation.lift is None:
            fastest = np.max(np.abs(state.thickness_rate) / state.thickness)
            limit = min(limit, options.largest_compaction / fastest)
        jumped = np.abs(situation.excess) > NEARLY * situation.pores
        timed = bool(jumped.any() or len(situation.air.volume) and options.trapped_air)
        timed |= situation.film is not None and len(situation.film.fed) > 0
        timed |= _sinks(model, state)
        if self._kept is not None and not timed and not situation.excess.any():
            stage = self._kept[1]
            return self._resting(
                situation, stage, min(limit, self._crossing_step(stage, situation))
            )
        step = min(limit, 2.0 * state.next_step) if timed and state.next_step > 0.0 else limit
        for _ in range(MOST_CUTS if not situation.excess.any() else CUTS_OF_EXCESS):
            if not step > 0.0:
                raise SimulationError(
                    f"no time step is short enough at {state.time:.6g} s: the thickness or the "
                    "pressure changes too fast"
                )
            if self._looked is None or timed or situation.excess.any():
                stage = self._driven.stage(situation, state, step)
            else:
                stage = self._looked[1]
            crossing = self._crossing_step(stage, situation)
            if not timed or crossing >= 0.999 * step:
                break
            step = max(crossing, 0.2 * step)
        if situation.lift is not None:
            fastest = np.max(np.abs(thickness_rate(situation, stage.flow)) / state.thickness)
            step = min(step, options.largest_compaction / max(fastest, 1e-300))
        situation, stage, step = self._resting(situation, stage, min(step, crossing))
        return at_the_same_rate(situation, step / stage.step), stage, step

    def _resting(
        self, situation: Situation, stage: Stage, step: float
    ) -> tuple[Situation, Stage, float]:
        """Return flow and step where the front may come to rest against gravity in the step."""
        free = longest_free_step(stage.flow, situation.pores, self._driven.height())
        if step <= free:
            return situation, stage, step
        step = min(step, max(free, MOST_GROWTH * situation.state.next_step))
        return situation, self._driven.stage(situation, situation.state, step, resting=True), step

    def _crossing_step(self, stage: Stage, situation: Situation) -> float:
        """Return the step in which the front crosses ``front_step`` control volumes."""
        rows, inflow = stage.flow.filling()
        inflow = np.maximum(inflow, 0.0)
        squared = float(inflow @ inflow)
        if squared == 0.0:
            return np.inf
        crossing = float(inflow @ situation.pores[rows]) / squared
        return self.model.options.front_step * crossing

    def _moves(self, situation: Situation, stage: Stage, until: float) -> bool:
        left = until - situation.state.time
        if any(np.isfinite(p.duration) and len(p.nodes) for p in situation.primings):
            return True
        if situation.pore_rate.any() or situation.excess.any() or situation.lift is not None:
            return True
        turnover = np.abs(stage.flow.filling()[1]).sum() + np.abs(stage.bled).sum()
        return bool(turnover * left > NO_FLOW * situation.pores.sum())

    def _try(self, situation: Situation, stage: Stage, step: float) -> float:
        """Take a step of this size; return 1, or the share of it to try next if it is too large."""
        model, state = self.model, situation.state
        if stage.step != step and (situation.excess < 0.0).any():
            stage = self._driven.stage(situation, state, step)
        rate = thickness_rate(situation, stage.flow)
        pores_end = self._pores_at(situation, rate, step)
        first = move(model, situation, stage.flow.along, pores_end, step)
        if isinstance(first, Stuck):
            return first.share
        ahead = predict(model, situation, first, pores_end, state.thickness + step * rate)
        if model.liquid.changes:
            age(model, situation, first, stage.flow.along, step, ahead)
        conductances = self._conductances_at(situation, ahead)
        later = model.supply.at_time(situation.gates, state.time + step)
        there = replace(situation, conductances=conductances, gates=later)
        second = self._driven.stage(there, ahead, step, resting=bool(model.gravity.any()))
        along = 0.5 * (stage.flow.along + second.flow.along)
        rate = 0.5 * (rate + thickness_rate(situation, second.flow))
        pores_end = self._pores_at(situation, rate, step)
        last = move(model, situation, along, pores_end, step)
        if isinstance(last, Stuck):
            return last.share
        check_balance(model, situation, stage)
        fill_time = arrivals(situation, (stage, second), last, pores_end, step)
        early = self._before_trigger(state, fill_time, step)
        if early < 1.0:
            return early
        time = self._snapped(state.time + step)
        finish_step(
            model, situation, (stage, second), last, fill_time, along, pores_end, step, time
        )
        self._kept = self._looked = None
        self._behind = True
        state.thickness = state.thickness + step * rate
        state.next_step = step
        return 1.0

    def _pores_at(self, situation: Situation, rate: np.ndarray, step: float) -> np.ndarray:
        """Pores after a step in which the thickness changes at a rate (C,) [m/s]."""
        if not rate.any():
            return situation.pores
        return self.model.medium.pores(situation.state.thickness + step * rate)

    def _conductances_at(self, situation: Situation, ahead: FillingState) -> Conductances:
        state, model = situation.state, self.model
        moves = state.thickness_rate.any() or situation.lift is not None
        if not moves and not model.liquid.changes:
            return situation.conductances
        # What enters has the temperature of the start; nothing of it decides where resin is.
        fluidity = model.liquid.fluidity(model.medium, ahead)
        return model.medium.conductances(ahead.thickness, fluidity)

    def _snapped(self, time: float) -> float:
        """Return the time, without round-off where it is one that the step was to reach."""
        for moment in self._moments:
            if abs(time - moment) <= 1e-12 * abs(moment):
                return moment
        return time

    def _before_trigger(self, state: FillingState, fill_time: np.ndarray, step: float) -> float:
        """Return the share of the step after which the front opens or closes a gate or vent."""
        watched = self.model.supply.watched
        new = watched[np.isnan(state.fill_time[watched]) & ~np.isnan(fill_time[watched])]
        if not len(new):
            return 1.0
        share = (float(fill_time[new].min()) - state.time) / step
        return 1.0 if share > 0.98 else max(share, 0.02) * (1.0 + 1e-6)


def _sinks(model: FillingModel, state: FillingState) -> bool:
    """Whether resin flows through the thickness from a flow medium, which depends on the step."""
    links = model.medium.network.links
    return links is not None and bool((state.full[links.above] != state.full[links.below]).any())


def _place(model: FillingModel, stage: Stage) -> str:
    front = stage.flow.front.nodes
    if not len(front):
        return "no front"
    node = front[np.argmax(stage.flow.inflow)]
    return "near (" + ", ".join(f"{x:.6g}" for x in model.medium.mesh.points[node]) + ") m"


# --- why a filling ended --------------------------------------------------------------------------


def share_in_words(share: float) -> str:
    """Say which share of the pores is filled; never 100 % where some are not."""
    if share < 0.9995:
        return f"only {share:.1%} of the pores are filled"
    left = 100.0 * (1.0 - share)
    if left < 1e-6:
        return "the pores are filled but for round-off"
    return f"all but {left:.1g} % of the pores are filled"


def _idle_outcome(model: FillingModel, situation: Situation) -> tuple[str, str]:
    """Return outcome and message of a filling in which nothing moves any more."""
    state, points = situation.state, model.medium.mesh.points
    time = f"{state.time:.6g} s"
    if state.full.all():
        return "filled", f"all pores are full after {time}"
    share = share_in_words(state.stored / float(situation.pores.sum()))
    gelled = model.liquid.gelled(state)
    if gelled.any():
        place = points[gelled].mean(axis=0)
        where = ", ".join(f"{x:.6g}" for x in place)
        return "gelled", (
            f"the resin has gelled and the front stands still since {time} at the latest; {share}, "
            f"{int(gelled.sum())} nodes around ({where}) m have gelled; fill faster, with more "
            "gates or pressure, or cooler"
        )
    if not situation.gates:
        closed = ", ".join(gate.name for gate in model.supply.gates)
        film = ", the film gives no more" if model.film is not None else ""
        ended = f"there is no gate{film} after {time}"
        if closed:
            ended = f"no gate is open after {time} ({closed}){film}"
        return "no_source", f"{ended} and the resin stands still; {share}"
    if not any(gate.ready for gate in situation.gates):
        return "no_source", f"no gate has a pressure above the air's after {time}; {share}"
    dry = np.flatnonzero(~state.full)
    where = ", ".join(f"{x:.6g}" for x in points[dry].mean(axis=0))
    return "trapped", (
        f"the front stands still since {time}; {share}, {len(dry)} nodes around ({where}) m stay "
        "dry: the air there holds the resin back, or the gates' pressure does not exceed the vents'"
    )
