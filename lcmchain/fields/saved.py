"""What a run saved: its frames and histories, as arrays and as the group ``/history`` of the file.

Frames hold the positions of all nodes. Histories hold energies, and forces, travel and work of the
tools; they have an interval of their own.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from lcmchain.fields.ugrid import TIME, Variable, saved_times
from lcmchain.quantities.fields import Field
from lcmchain.solver.histories import let_go_times
from lcmchain.state import SAMPLE_COLUMNS, SAMPLED_ENERGIES, SAMPLES, TOOL_SAMPLE_COLUMNS
from lcmchain.tools.table import turning

if TYPE_CHECKING:
    import xarray as xr

    from lcmchain.model import Model
    from lcmchain.solver.simulation import Snapshot
    from lcmchain.state import State
    from lcmchain.tools.table import ToolTable


# --- frames ---------------------------------------------------------------------------------------


@dataclass
class FrameSeries:
    """Saved frames of a run; the first one is the start.

    Parameters
    ----------
    time : [s], shape (F,).
    positions : of all nodes [m], shape (F, node_count, 3).
    tool_travel : along each tool's direction [m], or its angle [rad] if it turns, shape (F, T).
    tool_force : of the blank on each tool [N], shape (F, T, 3).
    energy : parts of the energy balance [J] by name, each of shape (F,).
    tool_names : names of the T tools.
    history : what laws with memory remember, shape (F, history_size), empty without one.
    contact_force : normal forces of all tools on each node [N], shape (F, node_count); None if
        they are not known.
    pore_pressure : of the fluid in the elements [Pa], by lane (F, padded_count), see
        :class:`lcmchain.elements.pressed_elements.PressedElements`; None or empty without a fluid.
    tool_turns : whether each tool turns, shape (T,); None where none does.
    between_plies : contact of plies, (F, FRAME_ROWS, node_count), see
        :mod:`lcmchain.interfaces.in_frames`; None where none touch.
    """

    time: np.ndarray
    positions: np.ndarray
    tool_travel: np.ndarray
    tool_force: np.ndarray
    energy: Mapping[str, np.ndarray] = field(default_factory=dict)
    tool_names: tuple[str, ...] = ()
    history: np.ndarray | None = None
    contact_force: np.ndarray | None = None
    pore_pressure: np.ndarray | None = None
    between_plies: np.ndarray | None = None
    tool_turns: np.ndarray | None = None

    def __post_init__(self) -> None:
        frames, tools = len(self.time), len(self.tool_names)
        for name, shape in (
            ("positions", (frames, np.shape(self.positions)[1], 3)),
            ("tool_travel", (frames, tools)),
            ("tool_force", (frames, tools, 3)),
        ):
            if np.shape(getattr(self, name)) != shape:
                raise ValueError(
                    f"{name} has the shape {np.shape(getattr(self, name))}, not {shape}"
                )
        for name, values in self.energy.items():
            if np.shape(values) != (frames,):
                raise ValueError(f"energy {name} has the shape {np.shape(values)}, not {(frames,)}")

    @classmethod
    def from_snapshots(
        cls, snapshots: Sequence[Snapshot], tool_names: tuple[str, ...]
    ) -> FrameSeries:
        """Return the snapshots of a simulation as arrays over frames."""
        shape = len(snapshots), len(tool_names)
        between = [s.between_plies for s in snapshots]
        return cls(
            time=np.array([s.time for s in snapshots]),
            positions=np.array([s.position for s in snapshots]),
            tool_travel=np.array([s.tool_travel for s in snapshots]).reshape(shape),
            tool_force=np.array([s.tool_force for s in snapshots]).reshape(*shape, 3),
            energy={
                name: np.array([s.energy[name] for s in snapshots]) for name in snapshots[0].energy
            },
            tool_names=tool_names,
            history=np.array([s.history for s in snapshots]),
            contact_force=np.array([s.contact_force for s in snapshots]),
            pore_pressure=np.array([s.pore_pressure for s in snapshots]),
            between_plies=None if between[0] is None else np.array(between),
        )

    @property
    def frame_count(self) -> int:
        return len(self.time)


# --- histories ------------------------------------------------------------------------------------


def tables_of_tools(model: Model) -> list[ToolTable]:
    """Return the tools of every stage, or those of a process without stages."""
    return [stage.tools for stage in model.stages] or [model.tools]


def has_stops(model: Model) -> bool:
    """Tell whether a guided tool has a stop."""
    return any(bool(np.isfinite(tools.stop).any()) for tools in tables_of_tools(model))


@dataclass(frozen=True)
class Histories:
    """Samples of a run; a quantity of an interval is that of the interval that ends at its sample.

    Parameters
    ----------
    time : of the samples [s], shape (H,).
    sheet_time : that has passed for the sheet [s], shape (H,); None where it is the same.
    tool_travel : along each tool's direction [m], shape (H, T), 0 of those that turn.
    tool_angle : of each tool about its axis [rad], 0 of those that do not turn, shape (H, T); and
    tool_moment : of the sheets on it about that [N m], mean over the interval, shape (H, T). None
        where no tool turns.
    tool_force : of the sheets on each tool [N], shape (H, T, 3): the mean over the interval, its
        impulse divided by its length.
    tool_peak_force : largest magnitude of that force in a step of the interval [N], shape (H, T).
    tool_peak_time : of that step [s], shape (H, T).
    tool_stop_force : of each tool on its stop along its travel [N], shape (H, T), the mean over the
        interval; None where no tool has one.
    tool_work : of each tool on the sheets since the start [J], shape (H, T).
    gripper_force : of each gripper on the sheets [N], shape (H, G, 3), the mean over the interval.
    gripper_travel : of the place that each grips [m], shape (H, G, 3).
    gripper_names : of them. gripper_let_go : when they let go [s], shape (G,), infinite where not.
    energy : parts of the energy balance [J] by name, each of shape (H,); ``mass_damping`` is the
        part of ``damping`` that is not contact damping.
    """

    time: np.ndarray
    sheet_time: np.ndarray | None
    tool_travel: np.ndarray
    tool_force: np.ndarray
    tool_peak_force: np.ndarray
    tool_peak_time: np.ndarray
    tool_angle: np.ndarray | None
    tool_moment: np.ndarray | None
    tool_stop_force: np.ndarray | None
    tool_work: np.ndarray
    gripper_force: np.ndarray
    gripper_travel: np.ndarray
    gripper_names: tuple[str, ...]
    gripper_let_go: np.ndarray
    energy: Mapping[str, np.ndarray]

    @classmethod
    def from_state(cls, model: Model, state: State) -> Histories:
        """Return the samples taken so far.

        A step's forces act from the middle of the step before to its own middle: the impulses
        belong to the times half a step before the samples.
        """
        rows = state.samples[: state.counters[SAMPLES]]
        own = len(SAMPLE_COLUMNS)
        common = dict(zip(SAMPLE_COLUMNS, rows[:, :own].T.copy(), strict=True))
        shape = len(rows), len(model.tool_names), len(TOOL_SAMPLE_COLUMNS)
        end = own + shape[1] * shape[2]
        columns = np.moveaxis(rows[:, own:end].reshape(shape), -1, 0)
        tools = dict(zip(TOOL_SAMPLE_COLUMNS, columns, strict=True))
        impulse = np.stack([tools[f"impulse_{axis}"] for axis in "xyz"], axis=-1)
        of_grips = rows[:, end:].reshape(len(rows), len(model.grips), 2, 3)
        middle = common["time"] - 0.5 * common["last_step"]
        length = np.diff(middle, prepend=0.0)[:, None, None]
        stop = np.diff(tools["stop_impulse"], axis=0, prepend=0.0) / length[:, 0]
        moment = np.diff(tools["moment_impulse"], axis=0, prepend=0.0) / length[:, 0]
        turns = turning(model.whole.tools)
        energies = set(SAMPLED_ENERGIES)
        if not model.history_size:
            energies.discard("inelastic")
        if not model.resists_rates:
            energies.discard("viscous")
        return cls(
            time=common["time"],
            sheet_time=None if model.whole.pace is None else common["sheet_time"],
            tool_travel=np.where(turns, 0.0, tools["travel"]),
            tool_angle=np.where(turns, tools["travel"], 0.0) if turns.any() else None,
            tool_moment=moment if turns.any() else None,
            tool_force=np.diff(impulse, axis=0, prepend=0.0) / length,
            tool_peak_force=tools["peak_force"],
            tool_peak_time=tools["peak_time"],
            tool_stop_force=stop if has_stops(model.whole) else None,
            tool_work=tools["work"],
            gripper_force=np.diff(of_grips[:, :, 0], axis=0, prepend=0.0) / length,
            gripper_travel=of_grips[:, :, 1].copy(),
            gripper_names=tuple(grip.name for grip in model.grips),
            gripper_let_go=np.array(let_go_times(model, state)),
            energy={name: common[name] for name in SAMPLED_ENERGIES if name in energies},
        )


# --- the group /history ---------------------------------------------------------------------------


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
    import xarray as xr  # a run need not wait for it before its first step

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
