"""Structured sheets over a parametrised mid-surface, with the supports and loads benchmarks need.

Benchmarks come in any consistent units; nothing here is in SI.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from lcmchain.materials.st_venant_kirchhoff import StVenantKirchhoff, isotropic_stiffness
from lcmchain.mesh.blank import BlankMesh
from lcmchain.model import Model, assemble_sheet
from lcmchain.scene import Element

X, Y, Z = range(3)

# The element of the paper, every choice as printed; in it the reference values per mesh were
# computed. Its compaction strain collocates at the corners, which the normal thickness at the
# centre does not: only the former is free of thickness locking where the reference is curved.
AS_PUBLISHED = Element(
    compaction_strain="director", cross_terms=True, hourglass="published", fibre_hourglass=1.0
)
# The hourglass term printed in Eq. (16) brings back the in-plane bending locking of the bilinear
# quadrilateral; without its in-plane shear row it is gone.
NO_SHEAR_ROW = AS_PUBLISHED.model_copy(update={"in_plane_shear_hourglass": False})


# The sets of options that the tables put side by side; the default is that of a scene without any
# entry for its element.
OPTIONS = {
    "default": Element(),
    "as published": AS_PUBLISHED,
    "published without shear row": NO_SHEAR_ROW,
}


def options_of(element: Element) -> str:
    """Return the name of a set of options, empty for one that is not in :data:`OPTIONS`."""
    return next((name for name, given in OPTIONS.items() if given == element), "")


@dataclass(frozen=True)
class Sheet:
    """A sheet of N1 x N2 elements.

    blank : the mesh; grid : (N1 + 1, N2 + 1) pair numbers, empty for an unstructured patch.
    """

    blank: BlankMesh
    grid: np.ndarray

    @property
    def mesh(self) -> str:
        return f"{self.grid.shape[0] - 1}x{self.grid.shape[1] - 1}"

    def nodes(self, pairs: ArrayLike) -> np.ndarray:
        """Return the bottom nodes, then the top nodes, of pairs."""
        pairs = np.ravel(pairs)
        return np.concatenate([pairs, pairs + self.blank.pair_count])

    @cached_property
    def nothing_held(self) -> np.ndarray:
        return np.zeros((3, self.blank.node_count), dtype=bool)

    def held(self, *supports: tuple[ArrayLike, ArrayLike]) -> np.ndarray:
        """Return the mask (3, node_count) that holds (pairs, components) on both faces."""
        mask = self.nothing_held.copy()
        for pairs, components in supports:
            mask[np.ix_(np.asarray(components), self.nodes(pairs))] = True
        return mask

    def edge_load(self, pairs: np.ndarray, force: ArrayLike) -> np.ndarray:
        """Return nodal forces of a total ``force`` (3,) spread evenly over an edge, both faces."""
        middle = self.blank.mid_surface_positions[pairs]
        length = np.linalg.norm(np.diff(middle, axis=0), axis=1)
        share = np.zeros(len(pairs))
        share[:-1] += 0.5 * length
        share[1:] += 0.5 * length
        return self.pair_loads(pairs, np.outer(share / share.sum(), np.asarray(force)))

    def pair_loads(self, pairs: ArrayLike, forces: ArrayLike) -> np.ndarray:
        """Return nodal forces of ``forces`` (n, 3) on pairs, halved over the two faces."""
        loads = np.zeros((3, self.blank.node_count))
        np.add.at(loads.T, self.nodes(pairs), np.tile(0.5 * np.atleast_2d(forces), (2, 1)))
        return loads

    def middle(self, displacement: np.ndarray, pair: ArrayLike) -> np.ndarray:
        """Return the displacement (..., 3) of the mid-surface at pairs."""
        pair = np.asarray(pair)
        top = pair + self.blank.pair_count
        return 0.5 * (displacement[:, pair] + displacement[:, top]).T


def sheet(middle: np.ndarray, normal: np.ndarray, thickness: float) -> Sheet:
    """Mesh a sheet from its mid-surface points and unit normals, both (N1 + 1, N2 + 1, 3).

    The normal points to the side that sees the first, then the second parameter counter-clockwise.
    """
    shape = middle.shape[:2]
    grid = np.arange(shape[0] * shape[1]).reshape(shape)
    quads = np.stack([grid[:-1, :-1], grid[1:, :-1], grid[1:, 1:], grid[:-1, 1:]], axis=-1)
    return from_quads(middle.reshape(-1, 3), normal.reshape(-1, 3), quads.reshape(-1, 4),
                      thickness, grid)  # fmt: skip


def from_quads(
    middle: np.ndarray,
    normal: ArrayLike,
    quads: np.ndarray,
    thickness: float,
    grid: np.ndarray,
    *,
    fibre: ArrayLike | None = None,
) -> Sheet:
    """Mesh a sheet from quadrilaterals of its mid-surface.

    The first material axis is the direction of ``fibre`` (3,), by default that of the elements'
    first edges.
    """
    n = len(middle)
    half = 0.5 * thickness * np.broadcast_to(normal, middle.shape)
    corner = middle[quads]
    e1 = corner[:, 1] + corner[:, 2] - corner[:, 0] - corner[:, 3]
    if fibre is not None:
        e1 = np.broadcast_to(np.asarray(fibre, dtype=float), e1.shape).copy()
    e1 /= np.linalg.norm(e1, axis=1)[:, None]
    e3 = np.cross(corner[:, 2] - corner[:, 0], corner[:, 3] - corner[:, 1])
    e2 = np.cross(e3 / np.linalg.norm(e3, axis=1)[:, None], e1)
    elements = np.concatenate([quads, quads + n], axis=1)
    positions = np.concatenate([middle - half, middle + half])
    return Sheet(BlankMesh(positions, elements, e1, e2, thickness), grid)


def isotropic_model(
    mesh: Sheet,
    young_modulus: float,
    poisson_ratio: float,
    element: Element = AS_PUBLISHED,
    *,
    density: float = 1.0,
) -> Model:
    """Build the model of a sheet of an isotropic material."""
    stiffness = isotropic_stiffness(young_modulus, poisson_ratio)
    material = StVenantKirchhoff(stiffness, thickness=mesh.blank.thickness, density=density)
    return assemble_sheet(mesh.blank, material, element)


def parameters(*counts: int) -> tuple[np.ndarray, ...]:
    """Return grids of parameters from 0 to 1, one per count of elements."""
    return np.meshgrid(*(np.linspace(0.0, 1.0, count + 1) for count in counts), indexing="ij")


def rectangle(length: float, width: float, thickness: float, n1: int, n2: int) -> Sheet:
    """Mesh 0 ≤ x ≤ length, 0 ≤ y ≤ width in the plane z = 0."""
    s, t = parameters(n1, n2)
    middle = np.stack([length * s, width * t, 0 * s], axis=-1)
    return sheet(middle, np.broadcast_to([0.0, 0.0, 1.0], middle.shape), thickness)


def cylinder_sector(
    radius: float, length: float, thickness: float, angle: float, n1: int, n2: int
) -> Sheet:
    """Mesh 0 ≤ y ≤ length of a cylinder about y; the angle [rad] runs from +z towards +x."""
    y, phi = parameters(n1, n2)
    phi = angle * phi
    normal = np.stack([np.sin(phi), 0 * phi, np.cos(phi)], axis=-1)
    middle = radius * normal + np.stack([0 * y, length * y, 0 * y], axis=-1)
    # the normal points outwards where the second parameter turns from the first to the left
    return sheet(middle[:, ::-1], normal[:, ::-1], thickness)


def hemisphere_quarter(radius: float, thickness: float, hole: float, n1: int, n2: int) -> Sheet:
    """Mesh the quarter x, y ≥ 0 of a hemisphere about z; ``hole`` [rad] is its half angle.

    The first parameter runs from the x- to the y-axis, the second from the equator to the hole.
    """
    phi, theta = parameters(n1, n2)
    phi, theta = 0.5 * np.pi * phi, (0.5 * np.pi - hole) * theta
    normal = np.stack(
        [np.cos(theta) * np.cos(phi), np.cos(theta) * np.sin(phi), np.sin(theta)], axis=-1
    )
    return sheet(radius * normal, normal, thickness)


def twisted_strip(
    length: float, width: float, thickness: float, angle: float, n1: int, n2: int
) -> Sheet:
    """Mesh a strip along x that turns about its axis by ``angle`` [rad] from the width along y."""
    s, t = parameters(n1, n2)
    turn = angle * s
    across = np.stack([0 * s, np.cos(turn), np.sin(turn)], axis=-1)
    middle = width * (t - 0.5)[..., None] * across
    middle[..., X] = length * s
    tangent = np.stack(  # derivatives of the mid-surface along s
        [
            np.full_like(s, length),
            -width * (t - 0.5) * angle * np.sin(turn),
            width * (t - 0.5) * angle * np.cos(turn),
        ],
        axis=-1,
    )
    normal = np.cross(tangent, across)
    return sheet(middle, normal / np.linalg.norm(normal, axis=-1)[..., None], thickness)
