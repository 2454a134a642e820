"""Histories of a run as arrays: tool forces, travel and work, and energies, at their interval."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from lcmchain.fields.tool_stops import has_stops
from lcmchain.solver.histories import let_go_times
from lcmchain.state import SAMPLE_COLUMNS, SAMPLED_ENERGIES, SAMPLES, TOOL_SAMPLE_COLUMNS
from lcmchain.tools.turn import turning

if TYPE_CHECKING:
    from lcmchain.model import Model
    from lcmchain.state import State


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
