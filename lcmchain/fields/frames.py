"""Saved frames of a run as arrays."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from lcmchain.solver.simulation import Snapshot


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
