"""The sheet of a forming result as arrays: positions, faces, areas, vectors."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from lcmchain.fields.derived import face_area_vectors

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


def reference_positions(sheet: xr.Dataset) -> np.ndarray:
    """Return the reference positions of the mid-surface nodes, (node_count, 3) [m]."""
    return vector(sheet, "reference_position")


def sheet_positions(sheet: xr.Dataset, frame: int = -1) -> np.ndarray:
    """Return the positions of the mid-surface nodes in a frame [m], shape (node_count, 3)."""
    return reference_positions(sheet) + vector(sheet, "displacement", frame)


def sheet_faces(sheet: xr.Dataset) -> np.ndarray:
    """Return the nodes of the faces, shape (face_count, 4); a triangle repeats its last node."""
    faces = sheet["sheet_face_nodes"].values
    # Read without mask_and_scale=False, xarray gives floating point numbers with nan for -1.
    faces = np.where(np.isfinite(faces), faces, -1).astype(np.int64)
    if faces.shape[1] == 3:
        faces = np.pad(faces, ((0, 0), (0, 1)), constant_values=-1)
    return np.where(faces < 0, faces[:, 2:3], faces)


def sheet_areas(sheet: xr.Dataset, frame: int = -1) -> np.ndarray:
    """Return the areas of the faces in a frame [m2], as ``areal_fibre_mass`` refers to them."""
    corners = sheet_positions(sheet, frame)[sheet_faces(sheet)]
    return np.linalg.norm(face_area_vectors(corners), axis=-1)


def face_centres(sheet: xr.Dataset, *, formed: bool) -> np.ndarray:
    """Return the centres of the faces, (face_count, 3) [m], formed or in the reference."""
    positions = sheet_positions(sheet) if formed else reference_positions(sheet)
    faces = sheet_faces(sheet)
    triangle = faces[:, 3] == faces[:, 2]  # which repeat their last node
    corners = positions[faces]
    return np.where(triangle[:, None], corners[:, :3].mean(axis=1), corners.mean(axis=1))
