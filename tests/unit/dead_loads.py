"""Forces on the nodes of a model that keep their size and direction, for tests of creep.

Whoever implements a function from outside the package moves the cache of the whole process, as the
kernels may hold that function. Here it is moved for the time of a test: else no command that a test
starts would find what this process has compiled, and would compile it again.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import NamedTuple

import numba
import numpy as np

from lcmchain.dispatch import implements
from lcmchain.effects.interaction import add_to_nodes
from lcmchain.jit import equation, move_cache
from lcmchain.model import Model
from lcmchain.state import EXTERNAL


class Dead(NamedTuple):
    """Forces on the nodes that keep size and direction (3, node_count) [N]."""

    force: np.ndarray


@equation
def add_dead(loads, arrays, environment, chunk, first, last, dt_last, dt, work, sums):
    for i in range(first, last):
        for d in range(3):
            arrays.force[d, i] += loads.force[d, i]
            sums[EXTERNAL] += dt_last * loads.force[d, i] * arrays.velocity[d, i]


@contextmanager
def kept_apart() -> Iterator[None]:
    """Let kernels take these forces, and keep those that are compiled here in a folder apart."""
    before = numba.config.CACHE_DIR
    implements(add_to_nodes, Dead)(add_dead)
    try:
        yield
    finally:
        numba.config.CACHE_DIR = before
        move_cache()


def loaded(model, force):
    """Return a model on whose nodes forces (3, node_count) [N] act."""

    class Loaded(Model):
        @property
        def interactions(self):
            return (*super().interactions, Dead(force))

    object.__setattr__(model, "__class__", Loaded)
    return model
