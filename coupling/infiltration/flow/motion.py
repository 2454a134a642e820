"""Motion of the resin in a time step, and the state at its end.

The flows of a step fill the control volumes. Resin beyond the pores of a volume goes on to its
neighbours (:func:`pass_on`). It carries cure and temperature along.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy.sparse import coo_matrix, csc_matrix
from scipy.sparse.linalg import splu

from lcmchain.coupling.infiltration.flow.driven_flow import FillingModel, Situation, Stage
from lcmchain.coupling.infiltration.flow.film import FilmFlow
from lcmchain.coupling.infiltration.flow.medium import Air, find_air, new_dry_spots
from lcmchain.coupling.infiltration.flow.state import FULL, FillingState

#: Least share of a time step that is tried next.
LEAST_SHARE = 1e-6


class Passed(NamedTuple):
    """Volumes after the overflow.

    Parameters
    ----------
    volume : resin (N,) [m³], between zero and the pores.
    rate : inflow of each volume, with resin that was passed on to it (N,) [m³/s].
    vented : resin that left at open vents (N,) [m³].
    source, target, moved : rows and volumes [m³] of resin that was passed on.
    """

    volume: np.ndarray
    rate: np.ndarray
    vented: np.ndarray
    source: np.ndarray
    target: np.ndarray
    moved: np.ndarray


class Stuck(NamedTuple):
    """An excess had no room; about this share of the time step fills the volume exactly."""

    share: float


def pass_on(
    edges: np.ndarray,
    flow: np.ndarray,
    before: np.ndarray,
    volume: np.ndarray,
    pores: np.ndarray,
    pores_before: np.ndarray,
    rate: np.ndarray,
    bleeds: np.ndarray,
    full: np.ndarray,
    spare: float = 0.0,
) -> Passed | Stuck:
    """Pass the excess of over-full volumes on to those with room, as the edges conduct.

    A volume that would be drained below zero takes resin from its neighbours in the same way. The
    sum of volumes and vented resin is conserved to round-off.

    Parameters
    ----------
    edges, flow : edges (E, 2) and their conductances (E,).
    before, volume : resin before and after the step (N,) [m³].
    pores, pores_before : pores after and before the step (N,) [m³].
    rate : see :class:`Passed`.
    bleeds : whether excess leaves the sheet at a node (N,).
    full : volumes that were full before the step and take nothing (N,).
    spare : excess over its pores that a volume may keep where there is no room.

    Returns
    -------
    :class:`Stuck` if an excess had no room: a smaller time step is needed.
    """
    volume, rate = volume.copy(), rate.copy()
    vented = np.zeros_like(volume)
    out = bleeds & (volume > pores)
    vented[out] = (volume - pores)[out]
    volume[out] = pores[out]
    records: list[tuple[np.ndarray, ...]] = []
    stuck = _spread(edges, flow, volume, pores, rate, full, spare, records)
    if stuck.any():
        room = (pores_before - before)[stuck]
        narrower = (volume - before - pores + pores_before)[stuck]
        share = np.maximum(room / narrower, LEAST_SHARE)
        return Stuck(float(np.min(share)) * (1.0 - 2e-9))
    if (volume < 0.0).any() and not _draw(edges, flow, volume, records):
        return Stuck(0.5)
    joined = [np.concatenate(column) for column in zip(*records, strict=True)] if records else [
        np.empty(0, dtype=np.int64), np.empty(0, dtype=np.int64), np.empty(0)
    ]  # fmt: skip
    return Passed(volume, rate, vented, *joined)


def _spread(edges, flow, volume, pores, rate, full, spare, records) -> np.ndarray:
    """Pass the excess on; return which volumes (N,) had no neighbour with room."""
    done, kept = full.copy(), full.copy()
    while True:
        excess = volume - pores
        over = (excess > 0.0) & ~kept
        if not over.any():
            return over
        done |= over
        room = ~done & (volume < pores)
        source, target, between = _neighbours(edges, flow, over, room)
        share = _shares(between, source, len(volume))
        stuck = over.copy()
        stuck[source] = False
        kept |= stuck & (excess <= spare * pores)
        stuck &= ~kept
        if stuck.any():
            return stuck
        over &= ~kept
        moved = share * excess[source]
        records.append((source, target, moved))
        volume += np.bincount(target, moved, minlength=len(volume))
        rate += np.bincount(target, share * rate[source], minlength=len(volume))
        volume[over] = pores[over]


def _neighbours(
    edges: np.ndarray, flow: np.ndarray, these: np.ndarray, those: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Edges from some volumes to others: rows of both ends, and conductances."""
    first, second = edges.T
    forth = np.flatnonzero(these[first] & those[second])
    back = np.flatnonzero(these[second] & those[first])
    return (
        np.concatenate([first[forth], second[back]]),
        np.concatenate([second[forth], first[back]]),
        np.concatenate([flow[forth], flow[back]]),
    )


def _shares(flow: np.ndarray, owner: np.ndarray, count: int) -> np.ndarray:
    """Shares of each owner's edges: as they conduct, or alike where none of them conducts."""
    positive = np.maximum(flow, 0.0)
    total = np.bincount(owner, positive, minlength=count)
    number = np.bincount(owner, minlength=count)
    conducts = total[owner] > 0.0
    return np.where(conducts, positive / np.where(conducts, total[owner], 1.0), 1.0 / number[owner])


def _draw(edges, flow, volume, records) -> bool:
    """Let drained volumes take what they lack from wet neighbours; return whether all could."""
    done = np.zeros(len(volume), dtype=bool)
    while True:
        under = volume < 0.0
        if not under.any():
            return True
        done |= under
        wet = ~done & (volume > 0.0)
        target, source, between = _neighbours(edges, flow, under, wet)
        share = _shares(between, target, len(volume))
        lost = under.copy()
        lost[target] = False
        if lost.any():
            return False
        moved = share * -volume[target]
        records.append((source, target, moved))
        volume -= np.bincount(source, moved, minlength=len(volume))
        volume[under] = 0.0


# --- volumes at the end of a step -----------------------------------------------------------------


class Motion(NamedTuple):
    """Volumes after a step, what each one received [m3] (N,), and of that from gates or film."""

    passed: Passed
    received: np.ndarray
    primed: np.ndarray


def move(
    model: FillingModel, situation: Situation, along: np.ndarray, pores_end: np.ndarray, step: float
) -> Motion | Stuck:
    """Move the resin with these flows along the edges (E,) [m3/s] for a step [s]."""
    state, network = situation.state, model.medium.network
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
    # in the plane alone: through the thickness resin flows as slowly as its pressure says
    in_plane = slice(network.in_plane_count)
    passed = pass_on(
        network.edges[in_plane], situation.conductances.flow[in_plane],
        state.resin_volume, volume, pores_end, situation.pores,
        rate + primed / step, situation.bleeds, state.full,
        model.options.largest_excess,
    )  # fmt: skip
    if isinstance(passed, Stuck):
        return passed
    return Motion(passed, received, primed)


def predict(
    model: FillingModel,
    situation: Situation,
    motion: Motion,
    pores_end: np.ndarray,
    thickness: np.ndarray,
) -> FillingState:
    """State after a step by the flow at its start; thickness (C,) [m] is that of its end."""
    state = situation.state
    volume = motion.passed.volume
    full = volume >= FULL * pores_end
    # Where the last air goes, the front stays: behind it the flow would stop within the step.
    first, second = model.medium.network.edges.T
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


def arrivals(
    situation: Situation,
    stages: tuple[Stage, Stage],
    motion: Motion,
    pores_end: np.ndarray,
    step: float,
) -> np.ndarray:
    """When the front passed the nodes [s], from the fill factor at which it does."""
    state = situation.state
    passed, received, _ = motion
    threshold = np.full(len(pores_end), 0.5)
    for stage in (stages[1], stages[0]):
        threshold[stage.flow.front.nodes] = stage.flow.front.passed()
        _through(stage, threshold)
    handed = np.bincount(passed.target, passed.moved, minlength=len(pores_end))
    reached = (state.resin_volume + received + handed) / pores_end
    new = np.isnan(state.fill_time) & (reached >= threshold * FULL)
    rate = np.where(passed.rate > 0.0, passed.rate, np.inf)
    late = np.maximum(reached - threshold, 0.0) * pores_end / rate
    end = state.time + step
    return np.where(new, np.clip(end - late, state.time, end), state.fill_time)


def _through(stage: Stage, threshold: np.ndarray) -> None:
    """Of columns that fill more from above than from beside, the front passes the bottom."""
    flow = stage.flow
    if flow.columns is None:
        return
    beside = np.zeros(len(threshold))
    beside[flow.front.nodes] = flow.inflow
    threshold[flow.columns.target[flow.sunk > beside[flow.columns.target]]] = 1.0


# --- what a step leaves in the state --------------------------------------------------------------


def finish_step(
    model: FillingModel,
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
    _count_boundaries(model, situation, stages, passed, primed, step)
    state.fill_time = fill_time
    if situation.film is not None:
        _take_film(model, state, situation.film, stages, primed, step)
    if model.liquid.changes:
        age(model, situation, motion, along, step, state)
    if model.options.trapped_air:
        state.air_pressure = _compressed(
            situation.air, state.air_pressure, pores_end - volume, full,
            model.medium.network.edges,
        )  # fmt: skip
    state.resin_volume, state.full = volume, full
    state.fill = np.minimum(volume / pores_end, 1.0)
    state.pressure = stages[1].flow.pressure
    state.gate_pressure, state.gate_rate = stages[1].gate_pressure, stages[1].gate_rate
    state.time = time
    state.step_count += 1
    find_dry_spots(model, state, pores_end)


def find_dry_spots(model: FillingModel, state: FillingState, pores: np.ndarray) -> None:
    """Write into a state which nodes air encloses, and the pockets that have closed.

    pores : of the control volumes [m3], (N,).
    """
    vents = model.supply.open_vents(state.time, state.fill_time)
    air = find_air(model.medium.network.edges, state, pores, vents, model.options.trapped_air)
    state.enclosed, spots = new_dry_spots(air, model.medium, state, pores)
    state.dry_spots = (*state.dry_spots, *spots)


def _take_film(
    model: FillingModel,
    state: FillingState,
    film: FilmFlow,
    stages: tuple[Stage, Stage],
    primed: np.ndarray,
    step: float,
) -> None:
    """Take from the film what has entered the sheet."""
    taken = np.zeros(len(state.film))
    taken[film.fed] = 0.5 * step * (stages[0].film_rate + stages[1].film_rate)
    if film.sinking is not None:
        taken[film.sinking.nodes] = primed[film.sinking.nodes]
    state.film = np.maximum(state.film - taken / model.medium.node_area, 0.0)
    state.from_film += float(taken.sum())


def _count_boundaries(
    model: FillingModel,
    situation: Situation,
    stages: tuple[Stage, Stage],
    passed: Passed,
    primed: np.ndarray,
    step: float,
) -> None:
    state, supply = situation.state, model.supply
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
    for number, vent, _ in supply.open_vents(state.time, state.fill_time):
        state.vented[number] += (bled + passed.vented)[vent.nodes].sum()


def age(
    model: FillingModel,
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
    first, second = model.medium.network.edges.T
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
    cure = np.full(len(volume), model.liquid.resin.initial_cure)
    if situation.film is not None:
        cure[situation.film.nodes] = state.film_cure
    temperature = np.full(len(volume), model.liquid.inlet_temperature(state.time))
    for name, inlet in (("cure", cure), ("temperature", temperature)):
        value = getattr(state, name)
        carried = _carry(value, state.resin_volume, volume, source, target, moved, entered, inlet)
        setattr(into, name, carried)
    model.liquid.rest(model.medium, into, volume > 0.0, step)


def _carry(
    value: np.ndarray,
    before: np.ndarray,
    after: np.ndarray,
    source: np.ndarray,
    target: np.ndarray,
    moved: np.ndarray,
    entered: np.ndarray,
    inlet: np.ndarray,
) -> np.ndarray:
    """Carry a value per resin volume over a time step: upwind, implicit, conservative.

    W' y' - W y = Σ_in q y'_from - Σ_out q y' + q_entered y_inlet; y stays between its least and
    largest values for any step. First order: fronts of cure are smeared over some control volumes.

    Parameters
    ----------
    value : of the resin in each control volume, (N,); what stands where there is none is ignored.
    before, after : resin volumes [m3], (N,).
    source, target, moved : rows and volumes [m3] of all transfers between control volumes.
    entered : volume [m3] that came from outside into each control volume, with the value ``inlet``,
        (N,).

    Returns
    -------
    The values (N,); where no resin is, the inlet's.
    """
    count = len(value)
    back = moved < 0.0
    start, end = np.where(back, target, source), np.where(back, source, target)
    moved = np.abs(moved)
    # What comes in is known to round-off from both sides; its sum is the one that conserves.
    incoming = np.bincount(end, moved, minlength=count) + np.maximum(entered, 0.0)
    held = before + incoming
    wet = held > 0.0
    diagonal = np.where(wet, held, 1.0)
    right = np.where(wet, before * value + np.maximum(entered, 0.0) * inlet, inlet)
    rows = np.concatenate([np.arange(count), end])
    columns = np.concatenate([np.arange(count), start])
    entries = np.concatenate([diagonal, -moved])
    matrix = csc_matrix(coo_matrix((entries, (rows, columns)), shape=(count, count)))
    carried = splu(matrix).solve(right)
    return np.where(after > 0.0, carried, inlet)


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
