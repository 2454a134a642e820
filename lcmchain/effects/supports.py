"""Nodes whose motion is prescribed: clamps, grips, frames, planes of symmetry.

Adds: groups of nodes that move affinely, x = A(t) X + b(t), in the components that are held, and
the force that this takes.
Source: Belytschko, Liu, Moran, "Nonlinear Finite Elements", box 6.1.
Stability limit: none, holding a node only raises the stable step.
Scene: ``[[grippers]]`` with ``hold`` (:mod:`lcmchain.effects.grippers`); coupon tests and
verification cases give theirs to :func:`lcmchain.model.assemble_model`.
Fields: ``history_gripper_force`` of grippers; ``State.support_force`` and ``support_impulse`` hold
the forces of all supports.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from lcmchain.effects.effect import Effect, EffectModel
from lcmchain.errors import InputError
from lcmchain.jit import equation
from lcmchain.tools.table import rotation_and_shift

# Motions are tabulated once: cubic pieces between so many values leave 1e-9 of a smooth stroke.
TABLE_SIZE = 401


@dataclass(frozen=True)
class Support:
    """A group of nodes and how it is held.

    Parameters
    ----------
    name : for errors and results.
    nodes : (n,) node numbers.
    components : held components out of "xyz".
    motion : returns [A | b] (3, 4) at a time [s], identity and zero at the start; None holds the
        nodes where they are.
    release_time, release_force : at which the support lets go for good [s], [N]; the force is that
        on all its nodes together. Infinite for one that never does.
    """

    name: str
    nodes: np.ndarray
    components: str = "xyz"
    motion: Callable[[float], np.ndarray] | None = None
    release_time: float = math.inf
    release_force: float = math.inf


class SupportTable(NamedTuple):
    """Supports as arrays.

    node, group : (n,) int32; anchor : (3, n) positions X [m] in the reference.
    start, interval : time of the first value of the motions, and between two of them [s].
    affine, slope : (group_count, TABLE_SIZE, 3, 4) [A | b] and its derivative over the interval.
    release_time, release_force : (group_count,) [s], [N], infinite where never.
    """

    node: np.ndarray
    group: np.ndarray
    anchor: np.ndarray
    start: float
    interval: float
    affine: np.ndarray
    slope: np.ndarray
    release_time: np.ndarray
    release_force: np.ndarray


def translation(
    direction: ArrayLike, travel: Callable[[float], float]
) -> Callable[[float], np.ndarray]:
    """Return the motion of a grip that travels by ``travel(time)`` [m] along ``direction``."""
    along = np.asarray(direction, dtype=float)
    along = along / np.linalg.norm(along)
    return lambda time: np.column_stack([np.eye(3), travel(time) * along])


def rotation(
    axis: ArrayLike, point: ArrayLike, angle: Callable[[float], float]
) -> Callable[[float], np.ndarray]:
    """Return the motion of a grip that turns by ``angle(time)`` [rad] about an axis.

    Right-handed about ``axis`` through ``point`` [m], which stays where it is.
    """
    along = np.asarray(axis, dtype=float)
    along = along / np.linalg.norm(along)
    center = np.asarray(point, dtype=float)
    return lambda time: np.column_stack(rotation_and_shift(np.zeros(3), along, center, angle(time)))


def build_supports(
    supports: Sequence[Support], positions: np.ndarray, process_time: float
) -> tuple[SupportTable | None, np.ndarray | None]:
    """Return the table and the free components (3, node_count); None for both without supports.

    Parameters
    ----------
    positions : (node_count, 3) reference [m]; process_time : end of the motions [s].

    Raises
    ------
    InputError : a node of two groups, or a motion that does not start at rest in the reference.
    """
    if not supports:
        return None, None
    free = np.ones((3, len(positions)))
    times = np.linspace(0.0, process_time, TABLE_SIZE)
    affine = np.zeros((len(supports), TABLE_SIZE, 3, 4))
    owner = np.full(len(positions), -1)
    for group, support in enumerate(supports):
        taken = support.nodes[owner[support.nodes] >= 0]
        if taken.size:
            other = supports[owner[taken[0]]].name
            raise InputError(f"node {taken[0]} is held by {other} and by {support.name}")
        owner[support.nodes] = group
        for component in support.components:
            free["xyz".index(component), support.nodes] = 0.0
        rest = np.eye(3, 4)
        motion = support.motion or (lambda time, rest=rest: rest)  # type: ignore[misc]
        affine[group] = [motion(time) for time in times]
        if not np.allclose(affine[group, 0], rest, rtol=0.0, atol=1e-12):
            raise InputError(f"the motion of {support.name} does not start in the reference")
    node = np.flatnonzero(owner >= 0)
    slope = np.gradient(affine, axis=1, edge_order=2)
    slope[:, 0] = 0.0  # everything starts at rest
    table = SupportTable(
        node=node.astype(np.int32),
        group=owner[node].astype(np.int32),
        anchor=np.ascontiguousarray(positions[node].T),
        start=0.0,
        interval=process_time / (TABLE_SIZE - 1),
        affine=affine,
        slope=slope,
        release_time=np.array([support.release_time for support in supports]),
        release_force=np.array([support.release_force for support in supports]),
    )
    return table, free


@equation
def hermite(value, next_value, slope, next_slope, s):
    """Return the cubic with these values and slopes at s = 0 and s = 1."""
    change = next_value - value
    curve = slope + next_slope - 2.0 * change
    return value + s * (slope + s * (change - slope - curve + s * curve))


@equation
def prescribed_position(supports, k, d, piece, s):
    """Return component ``d`` of entry ``k`` at the fraction ``s`` of ``piece`` of its motion."""
    g = supports.group[k]
    x = 0.0
    for column in range(4):
        coefficient = hermite(
            supports.affine[g, piece, d, column],
            supports.affine[g, piece + 1, d, column],
            supports.slope[g, piece, d, column],
            supports.slope[g, piece + 1, d, column],
            s,
        )
        x += coefficient * (supports.anchor[column, k] if column < 3 else 1.0)
    return x


def active(model: EffectModel) -> list[Effect]:
    """Return one effect per group of held nodes."""
    if model.supports is None:
        return []
    counts = np.bincount(model.supports.group, minlength=len(model.support_names))
    return [
        Effect(f"support {name}", True, f"{count} nodes")
        for name, count in zip(model.support_names, counts.tolist(), strict=True)
    ]
