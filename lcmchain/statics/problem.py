"""A static problem of a sheet: supports, loads, couples that follow the director, and forces."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from lcmchain.elements.blocks import LANES
from lcmchain.elements.family import Body, internal_forces
from lcmchain.errors import InputError
from lcmchain.materials.features.shear_friction import shear_friction_of
from lcmchain.materials.law import bending_losses_of
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


class DirectorCouples(NamedTuple):
    """Couples that follow the director of node pairs: a moment about a fixed axis.

    The pair of opposite forces stays normal to the line from bottom to top node and to the axis; in
    the plane normal to the axis it has the potential -M θ.

    pairs : (n,) numbers of the pairs.
    axis : (3,) unit vector.
    moments : (n,) [N m] at load factor 1.
    """

    pairs: np.ndarray
    axis: np.ndarray
    moments: np.ndarray

    def force_and_gradient(self, director: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the force (n, 3) on the top nodes and its derivative (n, 3, 3).

        ``director`` (n, 3) points from the bottom to the top nodes; the bottom nodes get the
        opposite force.
        """
        in_plane = np.eye(3) - np.outer(self.axis, self.axis)
        x, y, z = self.axis
        turn = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
        d = director @ in_plane
        square = np.einsum("nd,nd->n", d, d)[:, None]
        force = self.moments[:, None] * (d @ turn.T) / square
        gradient = self.moments[:, None, None] * turn / square[..., None]
        gradient = gradient - 2.0 * force[:, :, None] * d[:, None, :] / square[..., None]
        return force, gradient


@dataclass(frozen=True, kw_only=True)
class StaticProblem:
    """A sheet with supports and loads; everything below is scaled by the load factor.

    Parameters
    ----------
    model : with one element over the thickness, node ``i + pair_count`` above node ``i``.
    held : (3, node_count) bool, displacement components that are prescribed.
    held_middle : (3, pair_count) bool, components in which the mid-surface is held in place while
        the director is free: a hinge that remains one under large rotations, unlike two held faces.
    forces : (3, node_count) dead loads [N]; none by default.
    gravity : (3,) acceleration [m/s²] that acts on the nodal masses.
    displacements : (3, node_count) [m] prescribed where ``held``; 0 by default.
    couples : moments that follow the directors.

    Raises
    ------
    InputError : a model of several sheets, arrays that do not fit the model, supports that let the
        sheet move rigidly, or a law with memory.
    """

    model: Model
    held: np.ndarray
    forces: np.ndarray | None = None
    gravity: Sequence[float] = (0.0, 0.0, 0.0)
    displacements: np.ndarray | None = None
    couples: tuple[DirectorCouples, ...] = ()
    held_middle: np.ndarray | None = None
    dead_forces: np.ndarray = field(init=False, repr=False)

    def __post_init__(self) -> None:
        body, material = self.body, self.body.material
        losses = bending_losses_of(material)
        if losses is not None:
            raise InputError(
                f'of "{material.name}" loses energy (friction_1, viscous_1) along a way that the '
                "static solver does not follow; use the explicit solver, or leave them out for the "
                "elastic part alone",
                key="material.bending",
            )
        if shear_friction_of(material) is not None:
            raise InputError(
                f'of "{material.name}" takes energy along a way that the static solver does not '
                "follow; use the explicit solver, or leave it out for the elastic part alone",
                key="material.membrane.friction",
            )
        if self.model.resists_rates:
            raise InputError(
                f'of "{material.name}" makes its shear depend on the rate, and the '
                "static solver knows no time; use the explicit solver, or leave it out for the "
                "equilibrium that is reached in the end",
                key="material.viscous",
            )
        if self.model.remembers:
            raise InputError(
                f'"{material.name}" has a law with memory, which the static solver '
                "does not follow; use the explicit solver, or a law without",
                key="material.law",
            )
        shape = (3, self.model.node_count)
        for name in ("held", "forces", "displacements"):
            value = getattr(self, name)
            if value is not None and np.shape(value) != shape:
                raise InputError(f"must have the shape {shape}, not {np.shape(value)}", key=name)
        elements, pair_count = body.mesh.elements, body.mesh.pair_count
        if self.held_middle is not None and np.shape(self.held_middle) != (3, pair_count):
            shape = np.shape(self.held_middle)
            raise InputError(
                f"must have the shape {(3, pair_count)}, not {shape}", key="held_middle"
            )
        if not np.array_equal(elements[:, 4:], elements[:, :4] + pair_count):
            raise InputError(
                "the static solver needs one element over the thickness, with node i + n/2 above "
                "node i",
                key="model",
            )
        require_supports(self.model, self.held, self.held_middle)
        forces = np.zeros(shape) if self.forces is None else np.array(self.forces, dtype=float)
        forces += np.outer(self.gravity, self.model.sheet_mass)
        object.__setattr__(self, "dead_forces", forces)

    @property
    def body(self) -> Body:
        """The sheet that is solved."""
        return self.model.only_body(STATIC_SOLVER)

    @property
    def prescribed(self) -> np.ndarray:
        """Prescribed displacements (3, node_count) [m] at load factor 1; 0 elsewhere."""
        if self.displacements is None:
            return np.zeros((3, self.model.node_count))
        return np.where(self.held, self.displacements, 0.0)

    def directors(self, displacement: np.ndarray) -> np.ndarray:
        """Return the vectors (pair_count, 3) [m] from bottom to top nodes."""
        position = self.body.mesh.node_positions + displacement.T
        n = self.body.mesh.pair_count
        return position[n:] - position[:n]

    def external_forces(self, displacement: np.ndarray) -> np.ndarray:
        """Return the loads (3, node_count) [N] at load factor 1."""
        forces = self.dead_forces.copy()
        if self.couples:
            directors = self.directors(displacement)
            n = self.body.mesh.pair_count
            for couple in self.couples:
                force, _ = couple.force_and_gradient(directors[couple.pairs])
                np.add.at(forces.T, couple.pairs + n, force)
                np.add.at(forces.T, couple.pairs, -force)
        return forces


def require_supports(model: Model, held: np.ndarray, held_middle: np.ndarray | None = None) -> None:
    """Require that no rigid motion leaves all held components in place.

    Raises
    ------
    InputError : one does.
    """
    held = np.asarray(held, dtype=bool)
    if held_middle is not None:
        held = held | np.tile(held_middle, 2)
    centred = model.node_positions - model.node_positions.mean(axis=0)
    centred = centred / abs(centred).max()
    motions = [np.tile(axis, (len(centred), 1)) for axis in np.eye(3)]
    motions += [np.cross(axis, centred) for axis in np.eye(3)]
    at_supports = np.array([motion.T[held] for motion in motions])
    if np.linalg.matrix_rank(at_supports) < 6:
        raise InputError("lets the sheet move rigidly; hold more components", key="held")
