"""Gravity: the weight of the sheets.

Adds: a force -m g along z on every node. A guided tool has a weight of its own
(:mod:`lcmchain.effects.process.tool_motion`).
Source: Belytschko, Liu, Moran, "Nonlinear Finite Elements", section 6.2.
Stability limit: none.
Scene: ``process.gravity``.
Fields: ``energy_external`` (history) holds its work.
"""

from __future__ import annotations

import numpy as np
from numba import types
from numba.extending import overload

from lcmchain.effects.effect import Effect, EffectModel, Switch, of_table
from lcmchain.jit import INLINED
from lcmchain.packs import load_first

#: Acceleration of the nodes by their weight [m/s²]: one for all, or an array (node_count,) where
#: mass that weighs nothing was added to some of them (:mod:`.process.mass_scaling`).
Gravity = float | np.ndarray


def weights_of(gravity: Gravity, first: int, last: int) -> Gravity:
    """Return the accelerations of nodes ``first`` to ``last`` [m/s²] for :func:`weight_at`."""
    return gravity[first:last] if isinstance(gravity, np.ndarray) else gravity


@overload(weights_of, jit_options=INLINED)
def _choose_weights(gravity, first, last):
    if isinstance(gravity, types.Array):
        return lambda gravity, first, last: gravity[first:last]
    return lambda gravity, first, last: gravity


def weight_at(gravity: Gravity, node: int) -> float:
    """Return the acceleration of a node [m/s²]."""
    return gravity[node] if isinstance(gravity, np.ndarray) else gravity


@overload(weight_at, jit_options=INLINED)
def _choose_weight(gravity, node):
    if isinstance(gravity, types.Array):
        return lambda gravity, node: gravity[node]
    return lambda gravity, node: gravity


def weights_from(gravity: Gravity, first: int, count: int) -> Gravity:
    """Return the accelerations of a pack of nodes [m/s²] as :func:`weight_at` does of one."""
    raise NotImplementedError("a pack of nodes is of compiled code alone")


@overload(weights_from, jit_options=INLINED)
def _choose_weights_from(gravity, first, count):
    if isinstance(gravity, types.Array):
        return lambda gravity, first, count: load_first(gravity, first, count)
    return lambda gravity, first, count: gravity


SWITCH = Switch(
    entry="process.gravity",
    without="the weight of the sheet",
    called=lambda scene: scene.process.gravity,
    off=of_table("process", gravity=False),
    on=of_table("process", gravity=True),
)


def active(model: EffectModel) -> list[Effect]:
    if not np.any(model.environment.gravity):
        return [Effect("gravity", False, "process.gravity = false")]
    weight = float((model.environment.gravity * model.nodes.mass).sum())
    g = weight / float(model.sheet_mass.sum())
    return [Effect("gravity", True, f"{g:g} m/s2 along -z on the sheet")]
