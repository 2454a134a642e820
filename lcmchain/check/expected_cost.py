"""Expected cost of a run, from the undeformed blank."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from lcmchain.mesh.sheet_mesh import SheetMesh
from lcmchain.model import AUTOMATIC_PENALTY, Model

#: Time per element and step on one core that the estimate assumes, by the kind of element.
SECONDS_PER_ELEMENT_STEP = {"solid-shell": 0.12e-6, "membrane-shell": 0.05e-6}


@dataclass(frozen=True)
class Estimate:
    """Expected cost of a run.

    Parameters
    ----------
    critical_step : stable time step of the undeformed blank [s].
    step_count : steps of the whole process, with the scene's safety factor.
    seconds : expected computing time [s], without compilation.
    controlled_by : what limits the step, in words.
    """

    critical_step: float
    step_count: int
    seconds: float
    controlled_by: str


def estimate_run(model: Model) -> Estimate:
    """Estimate time step, step count and computing time from the undeformed sheets.

    The step follows from the fastest elastic wave: in-plane over the shortest edge, or over the
    thickness, and from the automatic contact stiffness. Compaction and a given
    ``contact.penalty`` may shorten it during a run.
    """
    steps: dict[str, float] = {}
    for body in model.bodies:
        in_plane, normal = body.material.wave_stiffness()
        speed = math.sqrt(in_plane / body.material.density)
        _keep_least(steps, "in-plane waves", _shortest_edge(body.mesh) / speed)
        if body.mesh.has_thickness:
            speed = math.sqrt(normal / body.material.density)
            _keep_least(steps, "waves over the thickness", body.material.thickness / speed)
    controlled_by = min(steps, key=steps.__getitem__)
    critical_step = steps[controlled_by] * _contact_share(model)
    step_count = math.ceil(model.process_time / (critical_step * model.step_safety))
    per_step = sum(
        body.mesh.element_count * SECONDS_PER_ELEMENT_STEP[body.type] for body in model.bodies
    )
    return Estimate(critical_step, step_count, step_count * per_step, controlled_by)


def _keep_least(steps: dict[str, float], name: str, step: float) -> None:
    steps[name] = min(step, steps.get(name, math.inf))


def _contact_share(model: Model) -> float:
    """Return the part of the time step that the automatic contact stiffness leaves."""
    if not model.tool_names or not model.automatic_penalty:
        return 1.0
    return 1.0 / math.sqrt(1.0 + AUTOMATIC_PENALTY)


def _shortest_edge(mesh: SheetMesh) -> float:
    corners = mesh.node_positions[mesh.elements[:, :4]]
    lengths = np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2)
    return float(lengths[lengths > 0.0].min())  # a triangle repeats its last node
