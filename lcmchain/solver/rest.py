"""A stage that ends at rest: the sheet is stopped at each peak of its kinetic energy.

What is released swings: stored energy turns into motion until it is least on this way, and back.
There the kinetic energy has its peak. Stopped there, the sheet starts again from less stored
energy, and comes to rest within some swings of its slowest vibration, whatever that is: no rate
has to be known or guessed.
Source: kinetic damping in dynamic relaxation, Cundall (1976); Barnes, "Form finding and analysis of
tension structures by dynamic relaxation", Int. J. Space Structures 14 (1999).

A peak is what has been released of stored energy since the last stop. One below a given part of
what was stored when the motions of the stage had ended is none: stopped there, fast vibrations
would hold slow ones back. The sheet is at rest when there was no peak for as long as the longest
swing has taken. What is left of its time then passes without steps: nothing moves.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from lcmchain.model import Model
from lcmchain.solver.guards import energy_floor
from lcmchain.solver.histories import next_sample_time, take_sample
from lcmchain.state import (
    KINETIC,
    LAST_STEP,
    MASS_DAMPING,
    REST_LAST,
    REST_LEFT,
    REST_PEAK,
    REST_SCALE,
    REST_STOPPED,
    REST_STOPS,
    REST_SWING,
    REST_TIME,
    SAMPLES,
    TIME,
    State,
)

#: Part of its time that a stage takes at least to find that nothing moves.
LEAST_SWING = 0.02


def is_at_rest(model: Model, state: State) -> bool:
    """Tell whether the sheet has come to rest in the present stage, so that its time may pass.

    A fabric that relaxes goes on, however still it is.
    """
    stage = model.present_stage
    if stage is None or stage.rest_energy is None or model.resists_rates:
        return False
    return bool(state.rest[model.stage, REST_TIME] > 0.0)


def calm(model: Model, state: State, stored: Callable[[], float]) -> None:
    """Stop the sheet where its kinetic energy has passed a peak; for after every chunk of steps.

    stored : returns the energy that the sheets and what couples them store [J].
    """
    stage = model.present_stage
    if stage is None or stage.rest_energy is None or state.time < stage.settled:
        return
    rest, kinetic = state.rest[model.stage], _kinetic(model, state)
    if rest[REST_SCALE] == 0.0:
        rest[REST_SCALE] = max(stored(), kinetic, energy_floor(model))
        rest[REST_STOPPED] = state.time
    largest = stage.rest_energy * rest[REST_SCALE]
    waited = state.time - rest[REST_STOPPED]
    last, rest[REST_LAST] = rest[REST_LAST], kinetic
    rest[REST_PEAK] = max(rest[REST_PEAK], kinetic)
    if kinetic < last and last > largest:
        _stop(model, state, stored)
        rest[REST_STOPS] += 1
        rest[REST_SWING] = max(rest[REST_SWING], waited)
        rest[REST_STOPPED], rest[REST_LAST] = state.time, 0.0
        rest[REST_LEFT], rest[REST_PEAK] = rest[REST_PEAK], 0.0
    elif rest[REST_PEAK] <= largest and rest[REST_TIME] == 0.0:
        least = LEAST_SWING * (stage.end - stage.start)
        if waited >= max(rest[REST_SWING], least):
            _stop(model, state, stored)
            rest[REST_TIME] = state.time


def starts_again(model: Model, state: State) -> bool:
    """Tell whether the next step is the first after a stop: it is made alone."""
    stage = model.present_stage
    if stage is None or stage.rest_energy is None:
        return False
    return state.last_step == 0.0 and state.step_count > 0


def book_start(model: Model, state: State) -> None:
    """Book what the first step after a stop takes out of the sum that later steps keep.

    Steps keep the stored energy and ½ m v(n - 1/2) v(n + 1/2). Both velocities around a place of
    rest are half of a step's acceleration, of opposite sign: the product is -½ m v².
    """
    taken = _kinetic(model, state)
    state.work[MASS_DAMPING] += float(state.work[KINETIC]) + taken
    state.work[KINETIC] = -taken


def _kinetic(model: Model, state: State) -> float:
    """Return the energy of the present velocities [J], which no vibration makes negative."""
    moved = float(np.sum(model.nodes.mass * np.sum(state.velocity**2, axis=0)))
    return 0.5 * (moved + float(np.sum(model.tools.mass * state.tool_velocity**2)))


def _stop(model: Model, state: State, stored: Callable[[], float]) -> None:
    """Stop the sheets and all guided tools; their motion counts as damped.

    The energies are those of the last step, before the nodes moved on; of what rests they are those
    of now. What was stored or released in between is not lost.
    """
    before = stored()
    state.velocity[:] = 0.0
    state.tool_velocity[model.tools.mass > 0.0] = 0.0
    # From rest the first step moves on with half the acceleration. With all of it, a vibration that
    # steps hardly resolve would be larger after each stop: 2.6 times at nine tenths of the limit.
    state.clock[LAST_STEP] = 0.0
    state.work[MASS_DAMPING] += float(state.work[KINETIC]) + before - stored()
    state.work[KINETIC] = 0.0


def pass_time(model: Model, state: State, until: float, energy: dict[str, float]) -> None:
    """Let the process go on to a time [s] while everything rests, with its samples.

    Forces stay, and so their impulses grow with the time.
    """
    while state.time < until:
        due = next_sample_time(model, state)
        end = min(due, until)
        passed = end - state.time
        state.tool_impulse += passed * state.tool_force
        state.tool_stop_impulse += passed * state.tool_stop_force
        state.tool_moment_impulse += passed * state.tool_moment
        state.support_impulse += passed * state.support_force
        state.gripper_impulse += passed * state.gripper_force
        state.clock[TIME] = end
        if end >= due and state.counters[SAMPLES] < model.sample_count:
            take_sample(model, state, energy)
