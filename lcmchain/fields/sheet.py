"""The sheet of a forming result as arrays: positions, faces, areas, vectors."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from lcmchain.fields.derived import face_area_vectors, median_edge_length
from lcmchain.quantities.fields import MOST_FAMILIES

if TYPE_CHECKING:
    import xarray as xr


def vector(dataset: xr.Dataset, stem: str, frame: int | None = None) -> np.ndarray:
    """Return a vector field, shape (..., 3), from its variables ``<stem>_x``, ``_y``, ``_z``.

    Parameters
    ----------
    frame : saved frame of a field that has frames; by default all that is there.
    """
    values = np.stack([dataset[f"{stem}_{axis}"].values for axis in "xyz"], axis=-1)
    return values if frame is None else values[frame]


#: Attribute of ``fibre_direction_1``: its angle from the first axis of the ply [rad]. A fabric with
#: fibres along both axes has none.
FROM_PLY_AXIS = "angle_from_ply_axis_rad"


def families_of(sheet: xr.Dataset) -> tuple[int, ...]:
    """Return the numbers of the families of fibres that a sheet has, from 1."""
    return tuple(k for k in range(1, MOST_FAMILIES + 1) if f"fibre_strain_{k}" in sheet)


#: Attribute of ``fibre_strain_k``: 1 where these fibres buckle, being softer in compression.
BUCKLES = "softer_in_compression"


def fibre_strains(sheet: xr.Dataset) -> np.ndarray:
    """Return the size of the strains of all families (families, F, face_count).

    It is nan where a ply has fewer families, and 0 for the compression of fibres that buckle.
    """
    strains = []
    for k in families_of(sheet):
        strain = sheet[f"fibre_strain_{k}"]
        buckles = strain.attrs.get(BUCKLES, 0)
        strains.append(np.maximum(strain.values, 0.0) if buckles else np.abs(strain.values))
    return np.stack(strains)


def _along_first_edges(sheet: xr.Dataset) -> tuple[np.ndarray, np.ndarray]:
    """Return unit vectors along the first edge of every face and across it (face_count, 3)."""
    points, faces = reference_positions(sheet), sheet_faces(sheet)
    first = points[faces[:, 1]] - points[faces[:, 0]]
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    return first, np.cross(face_normals(sheet, 0), first)


def mesh_axes(sheet: xr.Dataset) -> tuple[np.ndarray, np.ndarray]:
    """Return both directions of the undeformed mesh (face_count, 3): the axes of the plies.

    Where plies of a stack have their first families at unlike angles from their axes, the
    directions are the first family and the line across it. Films have no fibres: theirs are the
    first edges of the elements and the lines across them.
    """
    if "fibre_direction_1_x" not in sheet:
        return _along_first_edges(sheet)
    first = vector(sheet, "fibre_direction_1", 0)
    without = ~np.isfinite(first).all(axis=1)
    if without.any():
        with_fibres = sheet.isel(sheet_face=np.flatnonzero(~without))
        edges, found = _along_first_edges(sheet), mesh_axes(with_fibres)
        for own, axes in zip(edges, found, strict=True):
            own[~without] = axes
        return edges
    angle = sheet["fibre_direction_1_x"].attrs.get(FROM_PLY_AXIS)
    if angle is None and "fibre_direction_2_x" in sheet:
        second = vector(sheet, "fibre_direction_2", 0)
        if np.isfinite(second).all():
            return first, second
    angle = 0.0 if angle is None else angle
    normal = face_normals(sheet, 0)
    across = np.cross(normal, first)
    cos, sin = np.cos(angle), np.sin(angle)
    return cos * first - sin * across, sin * first + cos * across


def reference_positions(sheet: xr.Dataset) -> np.ndarray:
    """Return the reference positions of the mid-surface nodes, (node_count, 3) [m]."""
    return vector(sheet, "reference_position")


def sheet_positions(sheet: xr.Dataset, frame: int = -1) -> np.ndarray:
    """Return the positions of the mid-surface nodes in a frame [m], shape (node_count, 3)."""
    return reference_positions(sheet) + vector(sheet, "displacement", frame)


def sheet_faces(sheet: xr.Dataset) -> np.ndarray:
    """Return the nodes of the faces, shape (face_count, 4); a triangle repeats its last node.

    Parameters
    ----------
    sheet : the group of a whole sheet or stack, or that of one ply.
    """
    name = "sheet_face_nodes"
    if name not in sheet:
        roles = {variable.attrs.get("cf_role"): variable for variable in sheet.data_vars.values()}
        name = roles["mesh_topology"].attrs["face_node_connectivity"]
    faces = sheet[name].values
    # Read without mask_and_scale=False, xarray gives floating point numbers with nan for -1.
    faces = np.where(np.isfinite(faces), faces, -1).astype(np.int64)
    if faces.shape[1] == 3:
        faces = np.pad(faces, ((0, 0), (0, 1)), constant_values=-1)
    return np.where(faces < 0, faces[:, 2:3], faces)


def sheet_areas(sheet: xr.Dataset, frame: int = -1) -> np.ndarray:
    """Return the areas of the faces in a frame [m2], as ``areal_fibre_mass`` refers to them."""
    corners = sheet_positions(sheet, frame)[sheet_faces(sheet)]
    return np.linalg.norm(face_area_vectors(corners), axis=-1)


def node_areas(sheet: xr.Dataset, frame: int = -1) -> np.ndarray:
    """Return the areas of the mid-surface nodes in a frame (node_count,) [m²].

    They are those of the pressures on nodes: a quarter of each face around, of a triangle half for
    its last node.
    """
    faces = sheet_faces(sheet)
    count = sheet["displacement_x"].shape[-1]
    share = np.repeat(sheet_areas(sheet, frame) / 4.0, 4)
    return np.bincount(faces.ravel(), weights=share, minlength=count)


def face_normals(sheet: xr.Dataset, frame: int = -1) -> np.ndarray:
    """Return the unit normals of the faces in a frame (face_count, 3)."""
    normal = face_area_vectors(sheet_positions(sheet, frame)[sheet_faces(sheet)])
    return normal / np.linalg.norm(normal, axis=1)[:, None]


def face_centres(sheet: xr.Dataset, *, formed: bool) -> np.ndarray:
    """Return the centres of the faces, (face_count, 3) [m], formed or in the reference."""
    positions = sheet_positions(sheet) if formed else reference_positions(sheet)
    faces = sheet_faces(sheet)
    triangle = faces[:, 3] == faces[:, 2]  # which repeat their last node
    corners = positions[faces]
    return np.where(triangle[:, None], corners[:, :3].mean(axis=1), corners.mean(axis=1))


def edge_length(sheet: xr.Dataset) -> float:
    """Return the median length of the edges of the undeformed faces [m]."""
    return median_edge_length(reference_positions(sheet)[sheet_faces(sheet)])


def largest_turn(sheet: xr.Dataset, frame: int = -1) -> float:
    """Return the largest angle between two faces that share an edge [rad], 0 to π."""
    faces = sheet_faces(sheet)
    normals = face_area_vectors(sheet_positions(sheet, frame)[faces])
    normals /= np.maximum(np.linalg.norm(normals, axis=1), 1e-300)[:, None]
    ends = np.sort(np.stack([faces, np.roll(faces, -1, axis=1)], axis=2).reshape(-1, 2), axis=1)
    face = np.repeat(np.arange(len(faces)), 4)
    order = np.lexsort(ends.T)
    ends, face = ends[order], face[order]
    shared = (ends[1:] == ends[:-1]).all(axis=1) & (ends[1:, 0] != ends[1:, 1])
    cosine = np.einsum("ni,ni->n", normals[face[1:][shared]], normals[face[:-1][shared]])
    return float(np.arccos(np.clip(cosine.min(initial=1.0), -1.0, 1.0)))


#: Variables of the sheet: number of the course of a face, and gap of a node on a joint [m].
COURSE, JOINT_GAP = "course", "joint_gap"


def course_names(sheet: xr.Dataset) -> tuple[str, ...]:
    """Return the names of the courses of a sheet, by their number; empty without courses."""
    return tuple(sheet[COURSE].attrs["flag_meanings"].split()) if COURSE in sheet else ()
