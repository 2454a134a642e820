"""A target that follows the material: its nodes and weights in every frame, from those of one.

The functions take and return arrays and geometry alone, so that films, files and co-simulation
units use the same ones.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
import xarray as xr

from lcmchain.errors import InputError
from lcmchain.fields.netcdf_file import open_netcdf
from lcmchain.mapping.fields import MappedFields, fibre_mass, with_fibre_mass
from lcmchain.mapping.sheet import Sheet, read_sheet, saved_times_of
from lcmchain.mapping.solids.tetrahedra import solids_of_cells
from lcmchain.mapping.surfaces.search import SmoothSurface, closest_points
from lcmchain.mapping.surfaces.surface import Surface
from lcmchain.mapping.target import TargetMesh
from lcmchain.mapping.transfer import transfer
from lcmchain.mapping.weights import MappingWeights


class MaterialPlaces(NamedTuple):
    """Where P places sit on the material of a sheet.

    nodes : corners of the triangle below each place, shape (P, 3).
    shares : barycentric coordinates of the foot in it, shape (P, 3).
    offset : from the curved sheet over the foot to the place [m], shape (P, 3): along the first
        edge of the triangle, across it, and along the normal of the sheet.
    """

    nodes: np.ndarray
    shares: np.ndarray
    offset: np.ndarray


def material_places(surface: Surface, points: np.ndarray) -> MaterialPlaces:
    """Find the material below points [m], shape (P, 3): the closest place of the sheet.

    Points beyond the edge of the sheet belong to the edge.
    """
    everywhere = surface.size + float(
        np.linalg.norm(points - surface.centroids.mean(axis=0), axis=1).max()
    )
    closest = closest_points(surface, points, everywhere)
    smooth = SmoothSurface(surface)
    triangle, shares = smooth.triangles_at(closest.face, closest.foot)
    nodes = surface.triangles[triangle]
    curved, axes = _axes_at(smooth, nodes, shares)
    return MaterialPlaces(nodes, shares, np.einsum("pki,pi->pk", axes, points - curved))


def positions_of(places: MaterialPlaces, surface: Surface) -> np.ndarray:
    """Positions [m], shape (P, 3), of places on the material where the sheet now is.

    The distance from the sheet stays what it was, whatever became of the thickness. In the frame of
    :func:`material_places` these are the points that it was given.

    surface : the same sheet, faces and all, in another frame.
    """
    curved, axes = _axes_at(SmoothSurface(surface), places.nodes, places.shares)
    return curved + np.einsum("pk,pki->pi", places.offset, axes)


def weights_at(
    weights: MappingWeights, before: Surface, now: Surface, target: TargetMesh
) -> MappingWeights:
    """Weights of one frame for another one: the same material above each cell.

    The shares stay, and so do the places within the faces, which deform with these. Areas of the
    cells are those of the target that was carried along, or for solids what the sheet's faces above
    them have become.

    before, now : the sheet in the frame of the weights, and in the other one.
    """
    if target.is_solid:
        stretch = weights.average_matrix @ (now.areas / before.areas)
        area = weights.cell_area * np.where(weights.mapped, stretch, 1.0)
        if len(weights.solid_thickness):
            volumes = solids_of_cells(target.points, target.corners).volumes
            return replace(weights, cell_area=area, solid_thickness=volumes / area)
    else:
        area = target.surface.areas
    deform = np.einsum(
        "fuk,fkv->fuv", _diagonals(now), np.linalg.inv(_diagonals(before))
    )  # within the face
    place = np.einsum("kuv,kv->ku", deform[weights.face], weights.place)
    return replace(weights, cell_area=area, place=place)


def _diagonals(surface: Surface) -> np.ndarray:
    """Two edges of triangles, the diagonals of quadrilaterals, in the faces' frames, (F, 2, 2)."""
    c, quad = surface.corners, surface.is_quadrilateral[:, None]
    one = np.where(quad, c[:, 2] - c[:, 0], c[:, 1] - c[:, 0])
    other = np.where(quad, c[:, 3] - c[:, 1], c[:, 2] - c[:, 0])
    return np.stack([np.einsum("fui,fi->fu", surface.frames, v) for v in (one, other)], axis=2)


@dataclass(frozen=True)
class MappedFrame:
    """One saved state on the target that follows the material."""

    time: float
    sheet: Sheet
    target: TargetMesh
    weights: MappingWeights
    mapped: MappedFields


def mapped_frames(
    source: Path | str | xr.Dataset, sheet: Sheet, target: TargetMesh, weights: MappingWeights
) -> Iterator[MappedFrame]:
    """Map every saved state of a forming result with the weights of one, one after the other.

    Parameters
    ----------
    source : forming result with all its saved states.
    sheet : the state that the target was made for, whose weights are given.
    target : as it lies in that state; its nodes move with the material below them.

    Raises
    ------
    InputError : the result has no saved states with times.
    """
    dataset = _loaded(source)
    times = saved_times_of(dataset)
    if len(times) == 0:
        raise InputError("the forming result has no saved states with times", file=sheet.name)
    places = material_places(sheet.surface, target.points)
    # plies keep their masses each by itself: their shares of the faces' masses do not change
    mass = None if sheet.is_stack else fibre_mass(weights, transfer(sheet, target, weights))
    for frame, time in enumerate(times):
        now = replace(read_sheet(dataset, frame=frame), provenance=sheet.provenance)
        there = replace(target, points=positions_of(places, now.surface))
        carried = weights_at(weights, sheet.surface, now.surface, there)
        if sheet.is_stack and len(carried.formed_thickness):
            carried = _thickened(carried, sheet, now)
        mapped = transfer(now, there, carried)
        if mass is not None:
            mapped = with_fibre_mass(now, carried, mapped, mass)
        yield MappedFrame(float(time), now, there, carried, mapped)


def _thickened(weights: MappingWeights, before: Sheet, now: Sheet) -> MappingWeights:
    """Weights of a stack on solids with the thickness of all plies in another frame.

    It changes in each cell as that of the plies which the cell holds does.
    """
    if "thickness" not in before.scalars:
        return weights
    mean, after = (weights.average_matrix @ s.scalars["thickness"] for s in (before, now))
    ratio = after / np.where(weights.mapped, mean, 1.0)
    return replace(weights, formed_thickness=weights.formed_thickness * ratio)


def _loaded(source: Path | str | xr.Dataset) -> xr.Dataset:
    if isinstance(source, xr.Dataset):
        return source
    with open_netcdf(source, mask_and_scale=False) as dataset:
        return dataset.load()


def _axes_at(
    smooth: SmoothSurface, nodes: np.ndarray, shares: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Places on the curved sheet [m], shape (P, 3), and unit vectors there, shape (P, 3, 3).

    The vectors are along the first edge of the triangle, across it, and normal.
    """
    place, normals, height = smooth.over(nodes, shares)
    points = smooth.surface.points
    edge = points[nodes[:, 1]] - points[nodes[:, 0]]
    edge -= np.einsum("pi,pi->p", edge, normals)[:, None] * normals
    edge /= np.linalg.norm(edge, axis=1)[:, None]
    axes = np.stack([edge, np.cross(normals, edge), normals], axis=1)
    return place + height[:, None] * normals, axes
