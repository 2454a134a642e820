"""Where the resin of a time step goes: volumes at its end, and when the front passed the nodes."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from lcmchain.coupling.infiltration.driven_flow import Stage
from lcmchain.coupling.infiltration.overflow import FULL, Passed, Stuck, pass_on
from lcmchain.coupling.infiltration.situation import Situation
from lcmchain.coupling.infiltration.state import FillingState

if TYPE_CHECKING:
    from lcmchain.coupling.infiltration.filling import Filling


class Motion(NamedTuple):
    """Volumes after a step, what each one received [m3] (N,), and of that from gates or film."""

    passed: Passed
    received: np.ndarray
    primed: np.ndarray


def move(
    filling: Filling, situation: Situation, along: np.ndarray, pores_end: np.ndarray, step: float
) -> Motion | Stuck:
    """Move the resin with these flows along the edges (E,) [m3/s] for a step [s]."""
    state, network = situation.state, filling.medium.network
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
        filling.options.largest_excess,
    )  # fmt: skip
    if isinstance(passed, Stuck):
        return passed
    return Motion(passed, received, primed)


def predict(
    filling: Filling,
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
    first, second = filling.medium.network.edges.T
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
