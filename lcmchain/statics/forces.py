"""Forces of the elements on the nodes: the one call of the compiled element kernel in statics."""

from __future__ import annotations

import numpy as np

from lcmchain.elements.blocks import LANES
from lcmchain.elements.family import internal_forces
from lcmchain.model import Model

#: What knows one sheet alone, as errors name it.
STATIC_SOLVER = "the static solver"


def nodal_forces(model: Model, displacement: np.ndarray) -> np.ndarray:
    """Return the internal forces (3, node_count) [N] of the compiled element kernel.

    What elements share with their neighbours is that of the displacement.
    """
    body = model.only_body(STATIC_SOLVER)
    position = np.ascontiguousarray(body.mesh.node_positions.T + displacement)
    corner_force = np.zeros(model.corner_force_size)
    history = np.zeros(model.history_size)
    model.renew(position, history)
    internal_forces(body.data, position, corner_force, history)
    slot = model.nodes.force_slot
    return np.stack([corner_force[slot + d * LANES].sum(axis=0) for d in range(3)])
