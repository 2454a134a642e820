"""Motion of rigid tools along a fixed direction: at rest, prescribed over time, or guided.

A guided tool (mass on a guide under gravity, a force and the contact) is integrated by the solver;
the table only holds its data.
"""

from __future__ import annotations

import math

import numpy as np

from lcmchain.errors import InputError
from lcmchain.jit import equation

#: Values of ToolTable.motion_kind.
FIXED = 0
PRESCRIBED = 1
GUIDED = 2

#: Values of ToolTable.stroke_profile.
SMOOTH = 0
LINEAR = 1
TABULATED = 2

STANDARD_GRAVITY = 9.81  # [m/s2], along -z


@equation
def smooth_step(s):
    """Quintic smoothstep 10 s^3 - 15 s^4 + 6 s^5 and its derivative, 0 <= s <= 1.

    Velocity and acceleration vanish at both ends, so that a stroke starts and stops without a jerk.
    """
    value = s * s * s * (10.0 + s * (-15.0 + 6.0 * s))
    slope = 30.0 * s * s * (1.0 - s) * (1.0 - s)
    return value, slope


@equation
def guided_load(table, tool, added_force, time):
    """Load [N] on a guided tool along its direction: weight and forces, ramped up at the start."""
    load = table.force[tool] + added_force + table.mass[tool] * table.gravity_along[tool]
    if time < table.ramp[tool]:
        return smooth_step(time / table.ramp[tool])[0] * load
    return load


@equation
def tabulated_travel(times, travels, first, last, time):
    """Piecewise linear travel [m] and its velocity [m/s]; at rest before and after the table."""
    if time <= times[first]:
        return travels[first], 0.0
    if time >= times[last - 1]:
        return travels[last - 1], 0.0
    low, high = first, last - 1
    while high - low > 1:
        middle = (low + high) // 2
        if times[middle] <= time:
            low = middle
        else:
            high = middle
    velocity = (travels[high] - travels[low]) / (times[high] - times[low])
    return travels[low] + velocity * (time - times[low]), velocity


@equation
def prescribed_travel(table, tool, time):
    """Travel [m] of a fixed or prescribed tool along its direction, and its velocity [m/s].

    A guided tool has no prescribed travel: the result is (0, 0).
    """
    if table.motion_kind[tool] != PRESCRIBED:
        return 0.0, 0.0
    if table.stroke_profile[tool] == TABULATED:
        return tabulated_travel(
            table.table_times,
            table.table_travels,
            table.table_start[tool],
            table.table_start[tool + 1],
            time,
        )
    distance = table.stroke_distance[tool]
    start = table.stroke_start[tool]
    duration = table.stroke_end[tool] - start
    s = (time - start) / duration
    if s <= 0.0:
        return 0.0, 0.0
    if s >= 1.0:
        return distance, 0.0
    if table.stroke_profile[tool] == LINEAR:
        return s * distance, distance / duration
    value, slope = smooth_step(s)
    return value * distance, slope * distance / duration


def motion_entries(motion, axis, process_time: float, *, key: str) -> dict:
    """Entries of one tool in the motion columns of the tool table.

    Parameters
    ----------
    motion : motion of a scene tool (fixed, stroke, table or guided).
    axis : unit vector [3] of the tool's local z, the direction of a tool that never moves.
    process_time : end [s] of a stroke that does not say when it ends.
    key : scene key named in errors.

    Raises
    ------
    InputError
        if the direction has no length, a stroke ends before it starts, or table times do not rise.
    """
    entries = {
        "motion_kind": FIXED,
        "direction": np.asarray(axis, dtype=float),
        "mass": 0.0,
        "force": 0.0,
        "damping": 0.0,
        "ramp": 0.0,
        "gravity_along": 0.0,
        "stroke_profile": SMOOTH,
        "stroke_distance": 0.0,
        "stroke_start": 0.0,
        "stroke_end": 1.0,
        "table_times": np.zeros(0),
        "table_travels": np.zeros(0),
    }
    if motion.type == "fixed":
        return entries
    entries["direction"] = _unit_direction(motion.direction, key)
    if motion.type == "stroke":
        entries.update(_stroke(motion, process_time, key))
    elif motion.type == "table":
        entries.update(_tabulated(motion, key))
    elif motion.type == "guided":
        if not motion.mass > 0.0:
            raise InputError(f"must be positive, is {motion.mass:g} kg", key=f"{key}.mass")
        entries.update(
            motion_kind=GUIDED,
            mass=motion.mass,
            force=motion.force,
            damping=motion.damping,
            ramp=motion.ramp,
            gravity_along=-STANDARD_GRAVITY * entries["direction"][2] if motion.gravity else 0.0,
        )
    else:
        raise InputError(f'"{motion.type}" is not a kind of motion', key=f"{key}.type")
    return entries


def _stroke(motion, process_time: float, key: str) -> dict:
    start = 0.0 if motion.start is None else motion.start
    end = process_time if motion.end is None else motion.end
    if not end > start:
        raise InputError(
            f"the stroke ends at {end:g} s but starts at {start:g} s; let it end later",
            key=f"{key}.end",
        )
    if motion.profile not in ("smooth", "linear"):
        raise InputError(f'"{motion.profile}" is not "smooth" or "linear"', key=f"{key}.profile")
    return {
        "motion_kind": PRESCRIBED,
        "stroke_profile": LINEAR if motion.profile == "linear" else SMOOTH,
        "stroke_distance": motion.distance,
        "stroke_start": start,
        "stroke_end": end,
    }


def _tabulated(motion, key: str) -> dict:
    times = np.array(motion.times, dtype=float)
    travels = np.array(motion.travel, dtype=float)
    if len(times) != len(travels):
        raise InputError(
            f"{len(travels)} values for {len(times)} times; give one travel per time",
            key=f"{key}.travel",
        )
    if len(times) < 2:
        raise InputError("a table of motion needs at least two times", key=f"{key}.times")
    if not (np.diff(times) > 0.0).all():
        i = int(np.argmin(np.diff(times) > 0.0)) + 1
        raise InputError(
            f"times must rise, but time {i} ({times[i]:g} s) follows {times[i - 1]:g} s",
            key=f"{key}.times[{i}]",
        )
    return {
        "motion_kind": PRESCRIBED,
        "stroke_profile": TABULATED,
        "table_times": times,
        "table_travels": travels,
    }


def _unit_direction(direction, key: str) -> np.ndarray:
    vector = np.array(direction, dtype=float)
    length = math.hypot(*vector)
    if vector.shape != (3,) or not 0.0 < length < math.inf:
        raise InputError(
            f"{direction} is not a direction; give three numbers, not all zero",
            key=f"{key}.direction",
        )
    return vector / length
