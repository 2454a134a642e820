"""Histories: energies, and travel, work and impulse of the tools, sampled at an interval.

The samples are rows of the state, so that checkpoints, saved states and rollback hold them. They
are taken at the steps nearest to the multiples of the interval: no step is changed for them.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from lcmchain.model import Model
from lcmchain.state import (
    GRIPPER_SAMPLE_COLUMNS,
    MASS_DAMPING,
    SAMPLE_COLUMNS,
    SAMPLED_ENERGIES,
    SAMPLES,
    SHEET_TIME,
    TOOL_SAMPLE_COLUMNS,
    State,
)


def next_sample_time(model: Model, state: State) -> float:
    """Return when the next sample is due [s], infinite where no row is left."""
    row = int(state.counters[SAMPLES])
    if row == model.sample_count:
        return math.inf
    return min((row + 1) * model.history_interval, model.process_time)


def is_due(model: Model, state: State, step: float) -> bool:
    """Tell whether no later step of this size [s] ends nearer to the time of the next sample."""
    return next_sample_time(model, state) - state.time <= 0.5 * (state.pace * step)


def steps_to_sample(model: Model, state: State, step: float) -> int:
    """Return the number of steps [s] after which the next sample is due, at least one."""
    ahead = (next_sample_time(model, state) - state.time) / (state.pace * step)
    return max(1, math.ceil(min(ahead, 1e9) - 0.5))


def take_sample(model: Model, state: State, energy: Mapping[str, float]) -> None:
    """Fill the next row with the present; the search for the largest forces starts anew.

    Parameters
    ----------
    energy : from :meth:`lcmchain.solver.simulation.Simulation.energy` [J].
    """
    row = state.samples[state.counters[SAMPLES]]
    energies = {
        "inelastic": 0.0,
        "viscous": 0.0,
        **energy,
        "mass_damping": state.work[MASS_DAMPING],
    }
    own = len(SAMPLE_COLUMNS)
    row[:own] = (
        state.time,
        float(state.clock[SHEET_TIME]),
        state.pace * state.last_step,
        *(energies[name] for name in SAMPLED_ENERGIES),
    )
    width = len(TOOL_SAMPLE_COLUMNS)
    for tool in range(state.tool_travel.size):
        row[own + tool * width :][:width] = (
            state.tool_travel[tool],
            state.tool_work[tool],
            *state.tool_impulse[tool],
            *state.tool_peak[tool],
            state.tool_stop_impulse[tool],
            state.tool_moment_impulse[tool] if state.tool_moment_impulse.size else 0.0,
        )
    first = own + width * state.tool_travel.size
    width = len(GRIPPER_SAMPLE_COLUMNS)
    impulses = of_grips(model, state.gripper_impulse, state.support_impulse)
    for number, (grip, impulse) in enumerate(zip(model.grips, impulses, strict=True)):
        travel = state.position[:, grip.nodes] @ grip.weights - grip.place
        row[first + number * width :][:width] = *impulse, *travel
    state.tool_peak[:] = 0.0
    state.counters[SAMPLES] += 1


def let_go_times(model: Model, state: State) -> list[float]:
    """Return when every gripper let go [s], infinite where it has not, as the scene orders them."""
    return of_grips(model, state.gripper_let_go, state.support_let_go)


def grip_forces(model: Model, state: State) -> list[np.ndarray]:
    """Return the force of every gripper on the sheets at the last step (3,) [N], in that order."""
    return of_grips(model, state.gripper_force, state.support_force)


def grippers_at_work(model: Model) -> list[bool]:
    """Return whether every gripper is at work in the present stage, in that order."""
    stage = model.present_stage
    if stage is None:
        return [True for _ in model.grips]
    works = of_grips(model, stage.grippers_at_work, stage.supports_at_work)
    return [bool(one) for one in works]


def of_grips(model: Model, pulled: np.ndarray, supports: np.ndarray) -> list[Any]:
    """Return values of grippers that pull and of supports in the order of the scene's grippers.

    The supports of grippers that hold stand behind those that are no grippers.
    """
    pulling, holding = iter(pulled), iter(supports[len(supports) - model.held_grip_count :])
    return [next(pulling if grip.settings.pulls else holding) for grip in model.grips]
