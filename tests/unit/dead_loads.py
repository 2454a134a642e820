"""Forces on the nodes of a model that keep their size and direction, for tests of creep."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from lcmchain.dispatch import implements
from lcmchain.effects.interaction import add_to_nodes, on_nodes
from lcmchain.jit import equation
from lcmchain.model import Model
from lcmchain.state import EXTERNAL


class Dead(NamedTuple):
    """Forces on the nodes that keep size and direction (3, node_count) [N]."""

    force: np.ndarray


@implements(on_nodes, Dead)
@equation
def dead_on_nodes(interaction):
    return interaction


@implements(add_to_nodes, Dead)
@equation
def add_dead(acting, arrays, environment, chunk, first, last, dt_last, dt, work, sums):
    for i in range(first, last):
        for d in range(3):
            arrays.force[d, i] += acting.force[d, i]
            sums[EXTERNAL] += dt_last * acting.force[d, i] * arrays.velocity[d, i]


def loaded(model, force):
    """Return a model on whose nodes forces (3, node_count) [N] act."""

    class Loaded(Model):
        @property
        def interactions(self):
            return (*super().interactions, Dead(force))

    object.__setattr__(model, "__class__", Loaded)
    return model
