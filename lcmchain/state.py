"""Every array that changes during a run; copying it is a checkpoint, restoring it a rollback."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from lcmchain.model import Model

# Columns of ``State.work``: energies [J] accumulated over the run, or of the last step.
KINETIC = 0  # of the sheet and of guided tools, last step
CONTACT = 1  # stored in penalty springs, last step
FRICTION = 2  # dissipated by sliding
CONTACT_DAMPING = 3  # dissipated by contact damping
MASS_DAMPING = 4  # dissipated by mass-proportional damping and by dampers of guided tools
EXTERNAL = 5  # work of prescribed tools, of forces on guided tools and of gravity
WORK_COLUMNS = 6


@dataclass
class State:
    """Mutable state of a run.

    position, velocity : (3, node_count) at time n and at n - ½ [m, m/s].
    stick : (tool_count, 3, node_count) elastic slip of the friction springs [m].
    near : (tool_count, node_count) whether contact of the node with the tool is evaluated.
    tool_travel, tool_velocity : (tool_count,) at n and n - ½.
    tool_input : (tool_count, 2) velocity of a driven tool [m/s], added force of a guided one
        [N].
    driven : (tool_count,) whether the travel follows ``tool_input`` instead of the scene's motion.
    tool_force : (tool_count, 3) force of the sheet on the tool at the last step [N].
    penetration_max : (tool_count,) deepest penetration so far [m].
    support_force, support_impulse : (support_count, 3) force of each support on the sheet at the
        last step [N], and its integral over time [N s].
    work : energies, see the columns above.
    clock : (3,) time [s], size of the last step [s], ω² bound of the elements [1/s²].
    counters : (4,) steps, chunks since the last full frequency evaluation, element that controls
        the step, and a code of what governs it (:mod:`lcmchain.solver.sheet_queries`).
    """

    position: np.ndarray
    velocity: np.ndarray
    stick: np.ndarray
    near: np.ndarray
    tool_travel: np.ndarray
    tool_velocity: np.ndarray
    tool_input: np.ndarray
    driven: np.ndarray
    tool_force: np.ndarray
    penetration_max: np.ndarray
    support_force: np.ndarray
    support_impulse: np.ndarray
    work: np.ndarray
    clock: np.ndarray
    counters: np.ndarray

    @classmethod
    def at_rest(cls, model: Model) -> State:
        """Return the state at time 0: reference positions, no velocity."""
        node_count, tool_count = model.node_count, len(model.tool_names)
        return cls(
            position=np.ascontiguousarray(model.blank.node_positions.T),
            velocity=np.zeros((3, node_count)),
            stick=np.zeros((tool_count, 3, node_count)),
            near=np.zeros((tool_count, node_count), dtype=np.uint8),
            tool_travel=np.zeros(tool_count),
            tool_velocity=np.zeros(tool_count),
            tool_input=np.zeros((tool_count, 2)),
            driven=np.zeros(tool_count, dtype=np.int64),
            tool_force=np.zeros((tool_count, 3)),
            penetration_max=np.zeros(tool_count),
            support_force=np.zeros((len(model.support_names), 3)),
            support_impulse=np.zeros((len(model.support_names), 3)),
            work=np.zeros(WORK_COLUMNS),
            clock=np.zeros(3),
            counters=np.zeros(4, dtype=np.int64),
        )

    def as_dict(self) -> dict[str, np.ndarray]:
        """Return the arrays by name (not copied)."""
        return {f.name: getattr(self, f.name) for f in fields(self)}

    def copy(self) -> State:
        """Return an independent copy, for checkpoints and rollback."""
        return State(**{name: array.copy() for name, array in self.as_dict().items()})

    @property
    def time(self) -> float:
        return float(self.clock[0])

    @property
    def step_count(self) -> int:
        return int(self.counters[0])
