"""What a time step of a filling has brought, written into its state."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from lcmchain.coupling.infiltration.air import Air, find_air, new_dry_spots
from lcmchain.coupling.infiltration.carried import carry
from lcmchain.coupling.infiltration.driven_flow import Stage
from lcmchain.coupling.infiltration.film_supply import FilmFlow
from lcmchain.coupling.infiltration.motion import Motion
from lcmchain.coupling.infiltration.overflow import FULL, Passed
from lcmchain.coupling.infiltration.situation import Situation
from lcmchain.coupling.infiltration.state import FillingState

if TYPE_CHECKING:
    from lcmchain.coupling.infiltration.filling import Filling


def finish_step(
    filling: Filling,
    situation: Situation,
    stages: tuple[Stage, Stage],
    motion: Motion,
    fill_time: np.ndarray,
    along: np.ndarray,
    pores_end: np.ndarray,
    step: float,
    time: float,
) -> None:
    """Write what a step has brought into the state."""
    state = situation.state
    passed, _, primed = motion
    volume, full = passed.volume, passed.volume >= FULL * pores_end
    _count_boundaries(filling, situation, stages, passed, primed, step)
    state.fill_time = fill_time
    if situation.film is not None:
        _take_film(filling, situation.film, stages, primed, step)
    if filling.liquid.changes:
        age(filling, situation, motion, along, step, state)
    if filling.options.trapped_air:
        state.air_pressure = _compressed(
            situation.air, state.air_pressure, pores_end - volume, full,
            filling.medium.network.edges,
        )  # fmt: skip
    state.resin_volume, state.full = volume, full
    state.fill = np.minimum(volume / pores_end, 1.0)
    state.pressure = stages[1].flow.pressure
    state.gate_pressure, state.gate_rate = stages[1].gate_pressure, stages[1].gate_rate
    state.time = time
    state.step_count += 1
    vents = filling.supply.open_vents(state.time, state)
    air = find_air(
        filling.medium.network.edges, state, pores_end, vents, filling.options.trapped_air
    )
    state.enclosed, spots = new_dry_spots(air, filling.medium, state, pores_end)
    state.dry_spots = (*state.dry_spots, *spots)


def _take_film(
    filling: Filling,
    film: FilmFlow,
    stages: tuple[Stage, Stage],
    primed: np.ndarray,
    step: float,
) -> None:
    """Take from the film what has entered the sheet."""
    state = filling.state
    taken = np.zeros(len(state.film))
    taken[film.fed] = 0.5 * step * (stages[0].film_rate + stages[1].film_rate)
    if film.sinking is not None:
        taken[film.sinking.nodes] = primed[film.sinking.nodes]
    state.film = np.maximum(state.film - taken / filling.medium.node_area, 0.0)
    state.from_film += float(taken.sum())


def _count_boundaries(
    filling: Filling,
    situation: Situation,
    stages: tuple[Stage, Stage],
    passed: Passed,
    primed: np.ndarray,
    step: float,
) -> None:
    state, supply = situation.state, filling.supply
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


def age(
    filling: Filling,
    situation: Situation,
    motion: Motion,
    along: np.ndarray,
    step: float,
    into: FillingState,
) -> None:
    """Carry cure and temperature along with the resin, and let them go on where it is then.

    ``into`` is the state that they are written into, at the time of the start of the step.
    """
    state, (passed, _, primed) = situation.state, motion
    volume = passed.volume
    first, second = filling.medium.network.edges.T
    known = state.full[first] | state.full[second]
    source = np.concatenate([first[known], passed.source])
    target = np.concatenate([second[known], passed.target])
    moved = np.concatenate([step * along[known], passed.moved])
    balance = np.zeros(len(volume))
    np.add.at(balance, target, moved)
    np.subtract.at(balance, source, moved)
    gates = np.zeros(len(volume), dtype=bool)
    for gate in situation.gates:
        gates[gate.gate.nodes] = gate.ready
    if situation.film is not None:
        gates[situation.film.fed] = True
    missing = volume - state.resin_volume - balance
    entered = primed + np.where(gates & state.full, np.maximum(missing, 0.0), 0.0)
    cure = np.full(len(volume), filling.liquid.resin.initial_cure)
    if situation.film is not None:
        cure[situation.film.nodes] = state.film_cure
    temperature = np.full(len(volume), filling.liquid.inlet_temperature(state.time))
    for name, inlet in (("cure", cure), ("temperature", temperature)):
        value = getattr(state, name)
        carried = carry(value, state.resin_volume, volume, source, target, moved, entered, inlet)
        setattr(into, name, carried)
    filling.liquid.rest(filling.medium, into, volume > 0.0, step)


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
