"""Length of the waves of a wrinkled sheet, and whether the mesh resolves them."""

from __future__ import annotations

import math

import numpy as np
import xarray as xr
from scipy.spatial import cKDTree

from lcmchain.fields.sheet import reference_positions, sheet_faces, sheet_positions
from lcmchain.fields.wrinkles import WRINKLE_LENGTH
from lcmchain.materials.law import Material

#: Elements per wave below which its height and length are those of the mesh.
RESOLVED = 8.0
# Nearer to a free edge, in longest waves, heights are uncertain; wrinkles reach farther in.
AT_EDGE = 0.25
# Lower waves are not told from bends; in thicknesses, and as a part of the highest one.
LEAST_HEIGHT, LEAST_PART = 1.0, 0.5


def elements_per_wave(sheet: xr.Dataset, frame: int, nodes: np.ndarray) -> np.ndarray:
    """Return how many elements the waves of ``wrinkle_height`` around some nodes are long.

    A wave sin(k s) has the mean square slope k² times its mean square height, over any whole
    number of half-waves and in any direction. Both are means over the nodes and edges within half
    the longest wave around a node, in the reference. The slope of an edge of length h is smaller
    than that of the wave, 2 sin(k h / 2) / h instead of k, which is undone. Edges along the fibres
    and across them make up the slope; diagonals of triangles count as both.

    Parameters
    ----------
    nodes : of the mid-surface, shape (m,).

    Returns
    -------
    Wavelengths over the median edge, shape (m,), infinite where there is no slope; exact for waves
    along the edges of a regular mesh, up to the rest of a half-wave in the mean, and short by up to
    8 % for waves of four elements across the diagonal.
    """
    reference, height = reference_positions(sheet), sheet["wrinkle_height"].values[frame]
    start, end = np.unique(_edges_of_faces(sheet_faces(sheet)), axis=0).T
    length = np.linalg.norm(reference[end] - reference[start], axis=1)
    edge = float(np.median(length))
    slope = ((height[end] - height[start]) / length) ** 2
    reach = 0.5 * float(sheet["wrinkle_height"].attrs[WRINKLE_LENGTH])
    middles = 0.5 * (reference[start] + reference[end])
    slopes = _means_around(reference[nodes], middles, slope, reach)
    squares = _means_around(reference[nodes], reference, height**2, reach)
    # the mean over edges of two directions is half the square of the gradient
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.sqrt(2.0 * slopes / squares) * edge
        waves = math.pi / np.arcsin(np.clip(0.5 * ratio, 0.0, 1.0))
    return np.where(slopes > 0.0, waves, np.inf)


def wrinkle_warnings(sheet: xr.Dataset, material: Material, frame: int = -1) -> list[str]:
    """Say where the highest wrinkles of the last frame have too few elements per wavelength."""
    if "wrinkle_height" not in sheet:
        return []
    height = np.abs(sheet["wrinkle_height"].values[frame])
    high = height > max(LEAST_HEIGHT * material.thickness, LEAST_PART * height.max())
    if not high.any():
        return []
    reference, edges = reference_positions(sheet), _edges_of_faces(sheet_faces(sheet))
    ends, counts = np.unique(edges, axis=0, return_counts=True)
    outline = np.unique(ends[counts == 1])
    depth, _ = cKDTree(reference[outline]).query(reference)
    longest = float(sheet["wrinkle_height"].attrs[WRINKLE_LENGTH])
    nodes = np.flatnonzero(high & (depth >= AT_EDGE * longest))
    if not len(nodes):
        return []
    waves = elements_per_wave(sheet, frame, nodes)
    coarse = waves < RESOLVED
    if not coarse.any():
        return []
    worst = int(np.argmin(waves))
    highest = nodes[coarse][np.argmax(height[nodes[coarse]])]
    x, y, z = 1e3 * sheet_positions(sheet, frame)[highest]
    return [
        f"wrinkles or bends up to {1e3 * height[highest]:.2g} mm high, "
        f"at ({x:.1f}, {y:.1f}, {z:.1f}) mm, are unresolved: down to {waves[worst]:.1f} elements "
        f"per wavelength, where {RESOLVED:g} "
        "are needed, so that their height and length are those of the mesh; use a smaller "
        "blank.edge_length"
    ]


def _edges_of_faces(faces: np.ndarray) -> np.ndarray:
    """Return the edges (E, 2) of all faces, lower node first; shared ones appear twice."""
    edges = np.stack([faces, np.roll(faces, -1, axis=1)], axis=2).reshape(-1, 2)
    return np.sort(edges[edges[:, 0] != edges[:, 1]], axis=1)


def _means_around(
    centres: np.ndarray, places: np.ndarray, values: np.ndarray, reach: float
) -> np.ndarray:
    """Return the means of the values at all places within the reach of each centre."""
    near = cKDTree(centres).sparse_distance_matrix(cKDTree(places), reach, output_type="ndarray")
    counts = np.bincount(near["i"], minlength=len(centres))
    sums = np.bincount(near["i"], values[near["j"]], minlength=len(centres))
    return sums / np.maximum(counts, 1)
