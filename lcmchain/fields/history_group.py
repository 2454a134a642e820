"""The group ``/history`` of a forming result: what the frames hold of it, and the histories."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from lcmchain.fields.frames import FrameSeries, Histories
from lcmchain.fields.table import Field
from lcmchain.fields.ugrid import TIME, Variable, saved_times

if TYPE_CHECKING:
    import xarray as xr

HISTORY = "/history"

#: Dimension of the samples of histories, and the coordinate that gives their times.
SAMPLE = "history_time"

#: Angles of the tools in the frames, where one turns.
ANGLE = "tool_angle"

_HISTORY = "history"
_FIELDS = (
    Field(
        "history_sheet_time",
        "s",
        "time that has passed for the sheet",
        _HISTORY,
        "sum of the steps, where the scene leaves its time out; the time of the process over it is "
        "the pace",
    ),
    Field(
        "history_tool_force",
        "N",
        "mean force of the sheets on the tool",
        _HISTORY,
        "mean over the interval that ends here: the impulse of the contact forces of all its "
        "steps, divided by its length",
        is_vector=True,
    ),
    Field(
        "history_tool_peak_force",
        "N",
        "largest force of a step",
        _HISTORY,
        "largest magnitude of the force of the sheets on the tool in a single step of the interval",
    ),
    Field(
        "history_tool_peak_time",
        "s",
        "time of the largest force of a step",
        _HISTORY,
        "when that step was",
    ),
    Field(
        "history_tool_travel",
        "m",
        "travel of the tool",
        _HISTORY,
        "along its direction, since the start",
    ),
    Field(
        "history_tool_angle",
        "rad",
        "angle of the tool",
        _HISTORY,
        "about its axis, since the start; only where a tool turns, and 0 of those that do not",
    ),
    Field(
        "history_tool_moment",
        "N m",
        "mean moment of the sheets on the tool",
        _HISTORY,
        "about its axis, mean over the interval that ends here; as history_tool_angle",
    ),
    Field(
        "history_tool_stop_force",
        "N",
        "mean force of the tool on its stop",
        _HISTORY,
        "along the direction of its travel, mean over the interval that ends here; only where a "
        "guided tool has a stop",
    ),
    Field(
        "history_tool_work",
        "J",
        "work of the tool on the sheets",
        _HISTORY,
        "work of its contact forces since the start",
    ),
    Field(
        "history_gripper_force",
        "N",
        "mean force of the gripper on the sheets",
        _HISTORY,
        "mean over the interval that ends here: its impulse over the length of the interval",
        is_vector=True,
    ),
    Field(
        "history_gripper_travel",
        "m",
        "travel of the place that is gripped",
        _HISTORY,
        "mean displacement of its nodes, weighted by their areas, since the start",
        is_vector=True,
    ),
)

#: Every field of the histories by name, the energies excepted.
HISTORY_FIELDS: dict[str, Field] = {field.name: field for field in _FIELDS}


def history_dataset(frames: FrameSeries, histories: Histories | None = None) -> xr.Dataset:
    """Return the group: energies and tools at the frames, and the histories at their own times.

    Variables of the histories begin with ``history_`` and have the dimension ``history_time``.
    """
    import xarray as xr

    variables = _of_frames(frames)
    if histories is not None and histories.time.size:
        variables |= _of_histories(histories)
    return xr.Dataset(variables, attrs={"Conventions": "CF-1.11"})


def tool_places(history: xr.Dataset) -> np.ndarray:
    """Return the travel [m] of every tool in every frame (F, T), or the angle [rad] if it turns."""
    travel = history["tool_travel"].values
    return travel + history[ANGLE].values if ANGLE in history else travel


def _of_frames(frames: FrameSeries) -> dict[str, Variable]:
    turns = False if frames.tool_turns is None else frames.tool_turns
    variables: dict[str, Variable] = {
        TIME: saved_times(frames.time),
        "tool": (
            "tool",
            np.array(frames.tool_names, dtype=str),
            {"long_name": "name of the tool"},
        ),
        "tool_travel": (
            (TIME, "tool"),
            np.where(turns, 0.0, np.array(frames.tool_travel, dtype=float)),
            {"units": "m", "long_name": "travel of the tool along its direction"},
        ),
    }
    if np.any(turns):
        variables[ANGLE] = (
            (TIME, "tool"),
            np.where(turns, np.array(frames.tool_travel, dtype=float), 0.0),
            {
                "units": "rad",
                "long_name": "angle of the tool about its axis",
                "comment": "0 of tools that do not turn",
            },
        )
    for axis, values in zip("xyz", np.moveaxis(frames.tool_force, -1, 0), strict=True):
        variables[f"tool_force_{axis}"] = (
            (TIME, "tool"),
            np.array(values, dtype=float),
            {
                "units": "N",
                "long_name": f"force of the blank on the tool, {axis} component",
                "comment": "of the frame's last step alone",
            },
        )
    for name, values in frames.energy.items():
        variables[f"energy_{name}"] = TIME, np.array(values, dtype=float), _energy_attributes(name)
    return variables


def _of_histories(histories: Histories) -> dict[str, Variable]:
    variables: dict[str, Variable] = {
        SAMPLE: (
            SAMPLE,
            histories.time,
            {
                "units": "s",
                "long_name": "end of the interval of a sample",
                "standard_name": "time",
                "axis": "T",
            },
        )
    }
    of_tools = {
        "history_tool_force": histories.tool_force,
        "history_tool_peak_force": histories.tool_peak_force,
        "history_tool_peak_time": histories.tool_peak_time,
        "history_tool_travel": histories.tool_travel,
        "history_tool_work": histories.tool_work,
    }
    if histories.tool_angle is not None and histories.tool_moment is not None:
        of_tools["history_tool_angle"] = histories.tool_angle
        of_tools["history_tool_moment"] = histories.tool_moment
    if histories.tool_stop_force is not None:
        of_tools["history_tool_stop_force"] = histories.tool_stop_force
    of_grippers: dict[str, np.ndarray] = {}
    if histories.gripper_names:
        names = np.array(histories.gripper_names, dtype=str)
        variables["gripper"] = "gripper", names, {"long_name": "name of the gripper"}
        variables["gripper_let_go"] = (
            "gripper",
            np.where(np.isfinite(histories.gripper_let_go), histories.gripper_let_go, np.nan),
            {"units": "s", "long_name": "time at which the gripper let go; none where it has not"},
        )
        of_grippers = {
            "history_gripper_force": histories.gripper_force,
            "history_gripper_travel": histories.gripper_travel,
        }
    for name, values in (of_tools | of_grippers).items():
        field = HISTORY_FIELDS[name]
        columns = np.moveaxis(values, -1, 0) if field.is_vector else (values,)
        for variable, column in zip(field.variables, columns, strict=True):
            attributes = field.attributes(variable)
            dimensions = SAMPLE, "gripper" if name in of_grippers else "tool"
            variables[variable] = dimensions, np.ascontiguousarray(column), attributes
    if histories.sheet_time is not None:
        field = HISTORY_FIELDS["history_sheet_time"]
        variables[field.name] = SAMPLE, histories.sheet_time, field.attributes(field.name)
    for name, values in histories.energy.items():
        variables[f"history_energy_{name}"] = SAMPLE, values, _energy_attributes(name)
    return variables


def _energy_attributes(name: str) -> dict[str, str]:
    return {"units": "J", "long_name": f"{name.replace('_', ' ')} (energy balance)"}
