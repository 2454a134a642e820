"""Plies of a stack: each as a sheet of its own, and what lies over each other at every face.

The root group of a stack's result holds the faces of all plies. A *column* goes through the centre
of a face along its normal; what other plies it meets there is added up: the thickness, fibre mass
and fibre volume fraction of the stack. So a ply that ends inside others counts where it is, and
the fields are known on every ply.
"""

from __future__ import annotations

from collections.abc import Hashable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial import cKDTree

from lcmchain.fields.derived import face_area_vectors
from lcmchain.fields.ugrid import UgridMesh
from lcmchain.materials.law import Material, is_film
from lcmchain.mesh.sheet_mesh import NO_NODE, SheetMesh

if TYPE_CHECKING:
    import xarray as xr

#: Variable of the root group that tells to which ply a face belongs.
PLY = "body"
#: Attribute of that variable: names of the plies that are films, which the preform has no part of.
FILMS = "films"
#: How far a column reaches to either side, in thicknesses of all plies together: plies that have
#: come off each other by less still count as one stack.
REACH = 2.0
#: A line meets a face that it misses by this part of it: faces share their edges.
RIM = 1e-9


def ply_names(sheet: xr.Dataset) -> tuple[str, ...]:
    """Return the names of the plies of a result's root group, bottom first; none for one sheet."""
    if PLY not in sheet:
        return ()
    return tuple(str(sheet[PLY].attrs["flag_meanings"]).split())


def film_names(sheet: xr.Dataset) -> tuple[str, ...]:
    """Return the names of the plies of a result's root group that are films."""
    if PLY not in sheet:
        return ()
    return tuple(str(sheet[PLY].attrs.get(FILMS, "")).split())


def without_films(sheet: xr.Dataset) -> xr.Dataset:
    """Return the root group of a result without the faces of its films."""
    films = film_names(sheet)
    if not films:
        return sheet
    stay = [number for number, name in enumerate(ply_names(sheet)) if name not in films]
    kept = np.flatnonzero(np.isin(sheet[PLY].values, stay))
    return sheet.isel({UgridMesh("sheet").cell_dimension: kept})


def ply_sheet(datasets: Mapping[str, xr.Dataset], name: str) -> xr.Dataset:
    """Return the group of a ply with the names of variables that a result with one sheet has.

    Code that reads the root group of one sheet can read a ply of a stack by it.
    """
    own, one = UgridMesh(name), UgridMesh("sheet")
    dataset = datasets[f"/{name}"]
    corners = dataset[own.cell_nodes].dims[1]
    names: dict[Hashable, Hashable] = {
        own.name: one.name,
        own.cell_nodes: one.cell_nodes,
        own.cell_dimension: one.cell_dimension,
        own.node_dimension: one.node_dimension,
        corners: "sheet_face_corner",
        **dict(zip(own.coordinates, one.coordinates, strict=True)),
    }
    return dataset.rename({key: value for key, value in names.items() if key != value})


def plies_of(datasets: Mapping[str, xr.Dataset]) -> Iterator[tuple[str, dict[str, xr.Dataset]]]:
    """Yield every ply with its groups as those of a result with one sheet, bottom first.

    Yields nothing for a result with one sheet.
    """
    for name in ply_names(datasets["/"]):
        groups = {"/": ply_sheet(datasets, name)}
        if f"/{name}/solid" in datasets:
            groups["/solid"] = datasets[f"/{name}/solid"]
        if "/history" in datasets:
            groups["/history"] = datasets["/history"]
        yield name, groups


@dataclass(frozen=True)
class StackedPly:
    """What columns need of a ply.

    faces : nodes of the faces (m, 4); a triangle repeats its last one.
    positions : of the mid-surface (F, n, 3) [m].
    thickness : (F, m) [m], None where the elements predict none. initial_thickness : [m].
    areal_mass : fibre mass per present area (F, m) [kg/m²].
    fibre_density : [kg/m³], or None.
    is_film : whether it is taken off after forming, and counts in no sum.
    there : in which frames it is there (F,); in the others it counts in no sum. None for all.
    """

    faces: np.ndarray
    positions: np.ndarray
    thickness: np.ndarray | None
    initial_thickness: float
    areal_mass: np.ndarray
    fibre_density: float | None
    is_film: bool = False
    there: np.ndarray | None = None

    @classmethod
    def of_mesh(
        cls,
        mesh: SheetMesh,
        material: Material,
        positions: np.ndarray,
        fields: Mapping[str, np.ndarray],
        there: np.ndarray | None = None,
    ) -> StackedPly:
        """Return a ply by its mesh.

        positions : of its nodes (F, node_count, 3) [m]. fields : of its elements, (F, m) or for
            one frame (m,). there : in which frames it is there (F,), None for all.
        """
        faces = mesh.sheet_faces
        if faces.shape[1] == 3:
            faces = np.pad(faces, ((0, 0), (0, 1)), constant_values=NO_NODE)
        last = np.where(faces[:, 3] == NO_NODE, faces[:, 2], faces[:, 3])
        thickness = fields.get("thickness")
        without = np.zeros((len(positions) if positions.ndim == 3 else 1, len(faces)))
        return cls(
            faces=np.column_stack([faces[:, :3], last]),
            positions=mesh.mid_surface(positions),
            thickness=None if thickness is None else np.atleast_2d(thickness),
            initial_thickness=material.thickness,
            areal_mass=np.atleast_2d(fields.get("areal_fibre_mass", without)),
            fibre_density=material.fibre_density,
            is_film=is_film(material),
            there=there,
        )

    def is_there(self, frame: int) -> bool:
        """Tell whether it is there in a frame."""
        return self.there is None or bool(self.there[frame])

    def counted(self, values: np.ndarray) -> np.ndarray:
        """Return values (F, m) with 0 in the frames in which it is not there."""
        return values if self.there is None else values * self.there[:, np.newaxis]

    @cached_property
    def around(self) -> np.ndarray:
        """Faces that share a node with each face, itself among them; (m, K), -1 after the last."""
        node, face = self.faces.ravel(), np.repeat(np.arange(len(self.faces)), 4)
        order = np.argsort(node, kind="stable")
        first = np.searchsorted(node[order], np.arange(self.positions.shape[1] + 1))
        of_node = [face[order[a:b]] for a, b in zip(first, first[1:])]
        rings = [np.unique(np.concatenate([of_node[n] for n in own])) for own in self.faces]
        table = np.full((len(rings), max(map(len, rings))), -1)
        for row, ring in zip(table, rings, strict=True):
            row[: len(ring)] = ring
        return table


@dataclass(frozen=True)
class Columns:
    """Sums over the plies that the column of every face of one ply meets, (F, m) each.

    ply_count : how many plies, its own among them.
    thickness : [m], None where a ply predicts none. areal_mass : of the fibres [kg/m²].
    fibre_volume_fraction : of the stack, None where it is not known.
    below, above : thickness of the other plies on either side of its own, films among them [m].
    """

    ply_count: np.ndarray
    thickness: np.ndarray | None
    areal_mass: np.ndarray
    fibre_volume_fraction: np.ndarray | None
    below: np.ndarray
    above: np.ndarray


def columns_of(plies: Sequence[StackedPly]) -> list[Columns]:
    """Add up through the stack, films left out, at every face of every ply.

    A ply that is laid down later counts from then on; before, its faces tell what lies there.
    """
    reach = REACH * sum(ply.initial_thickness for ply in plies)
    stay = [ply for ply in plies if not ply.is_film]
    has_thickness = all(ply.thickness is not None for ply in stay)
    is_known = has_thickness and all(ply.fibre_density is not None for ply in stay)
    frames = range(len(plies[0].positions))
    columns = []
    for ply in plies:
        shape = ply.areal_mass.shape
        count = np.full(shape, 0 if ply.is_film else 1, dtype=np.int32)
        mass = ply.areal_mass.copy()
        if ply.there is not None:
            count, mass = ply.counted(count), ply.counted(mass)
        thickness = volume = None
        if has_thickness:
            thickness = np.zeros(shape) if ply.is_film else ply.counted(ply.thickness.copy())  # type: ignore[union-attr]
        if is_known:
            volume = np.zeros(shape) if ply.is_film else mass / ply.fibre_density
        below, above = np.zeros(shape), np.zeros(shape)
        for other in plies:
            if other is ply:
                continue
            for frame in filter(other.is_there, frames):
                met = faces_met(ply, other, frame, reach)
                there = met >= 0
                lies_above = there & is_above(ply, other, frame, met)
                own = other.initial_thickness
                if other.thickness is not None:
                    own = other.thickness[frame, met]
                above[frame] += np.where(lies_above, own, 0.0)
                below[frame] += np.where(there & ~lies_above, own, 0.0)
                if other.is_film:
                    continue
                count[frame] += there
                mass[frame, there] += other.areal_mass[frame, met[there]]
                if thickness is not None:
                    thickness[frame, there] += other.thickness[frame, met[there]]  # type: ignore[index]
                if volume is not None:
                    volume[frame, there] += (
                        other.areal_mass[frame, met[there]] / other.fibre_density
                    )
        fraction = None
        if volume is not None and thickness is not None:
            with np.errstate(divide="ignore", invalid="ignore"):  # a film beside the preform
                fraction = volume / thickness
        columns.append(Columns(count, thickness, mass, fraction, below, above))
    return columns


def is_above(ply: StackedPly, other: StackedPly, frame: int, met: np.ndarray) -> np.ndarray:
    """Tell of every face whether the face ``met`` (m,) of another ply lies over it (m,)."""
    corners = ply.positions[frame][ply.faces]
    away = _centres(other.positions[frame][other.faces[met]]) - _centres(corners)
    return np.einsum("mi,mi->m", away, face_area_vectors(corners)) > 0.0


def faces_met(ply: StackedPly, other: StackedPly, frame: int, reach: float) -> np.ndarray:
    """Return which face of another ply the column of every face meets first (m,), -1 for none.

    reach : how far the column goes to either side [m].
    """
    corners = ply.positions[frame][ply.faces]
    start, normal = _centres(corners), face_area_vectors(corners)
    size = np.linalg.norm(normal, axis=1, keepdims=True)
    normal = normal / np.where(size > 0.0, size, 1.0)
    others = other.positions[frame][other.faces]
    centres = _centres(others)
    tree = cKDTree(centres)
    nearest = tree.query(start)[1]
    met = _first_met(start, normal, others, other.around[nearest], reach)
    missing = np.flatnonzero(met < 0)
    if missing.size:  # where plies are far apart the column leads away from what is nearest to it
        way = np.einsum("mi,mi->m", centres[nearest[missing]] - start[missing], normal[missing])
        ahead = start[missing] + way[:, None] * normal[missing]
        again = other.around[tree.query(ahead)[1]]
        met[missing] = _first_met(start[missing], normal[missing], others, again, reach)
    return met


def _centres(corners: np.ndarray) -> np.ndarray:
    """Return the centres (m, 3) of faces (m, 4, 3), of which triangles repeat the last corner."""
    is_triangle = (corners[:, 2] == corners[:, 3]).all(axis=1)
    return np.where(is_triangle[:, None], corners[:, :3].mean(axis=1), corners.mean(axis=1))


def _first_met(
    start: np.ndarray,
    direction: np.ndarray,
    corners: np.ndarray,
    candidates: np.ndarray,
    reach: float,
) -> np.ndarray:
    """Return the candidate that a line meets nearest to its start, within a reach; -1 for none.

    start, direction : (m, 3). corners : of all faces (M, 4, 3). candidates : (m, K), -1 for none.
    """
    best, met = np.full(len(start), np.inf), np.full(len(start), -1)
    for column in candidates.T:
        face = corners[column]
        for one, two in ((1, 2), (2, 3)):
            way = _way_to_triangle(start, direction, face[:, 0], face[:, one], face[:, two])
            nearer = (column >= 0) & (way < best) & (way <= reach)
            best[nearer], met[nearer] = way[nearer], column[nearer]
    return met


def _way_to_triangle(
    start: np.ndarray, direction: np.ndarray, a: np.ndarray, b: np.ndarray, c: np.ndarray
) -> np.ndarray:
    """Return how far along a line a triangle lies, to either side (m,); infinite beside it."""
    ab, ac, offset = b - a, c - a, start - a
    across = np.cross(direction, ac)
    size = np.einsum("mi,mi->m", ab, across)
    with np.errstate(divide="ignore", invalid="ignore"):
        u = np.einsum("mi,mi->m", offset, across) / size
        turned = np.cross(offset, ab)
        v = np.einsum("mi,mi->m", direction, turned) / size
        way = np.abs(np.einsum("mi,mi->m", ac, turned) / size)
        inside = (u >= -RIM) & (v >= -RIM) & (u + v <= 1.0 + RIM)
    return np.where(inside, way, np.inf)
