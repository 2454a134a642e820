"""Wrinkles: their height, how many elements their waves have, and where they are to be expected.

The height is the distance of the mid-surface from a smoothed copy of itself. The smoothed copy is a
local regression (Cleveland and Devlin, "Locally weighted regression", J. Am. Stat. Assoc. 83,
1988): at every node a quadratic function of the reference coordinates, fitted to the positions of
all nodes within the reach, weighted by (1 - (r / reach)²)². It depends on the undeformed mesh
alone.

Its errors are known beforehand. Flat sheets, rigid motions and homogeneous deformations are
reproduced exactly. Waves up to :data:`WAVE_PART` of the reach leave at most 5 % of their height in
the copy, inside the sheet and, with 11 %, where they run along an edge; waves parallel to a free
edge are taken for curvature in part: 0.4 to 0.8 of their height is left on the edge and the next
line of nodes, 0.7 and more farther in. A smooth sphere of radius R is missed by reach⁴ / (360 R³),
a cylinder by 3/8 of it.

The fillet of a tool is sharper than that, but no wrinkle. Therefore a height is at most the clear
distance to the tool that the sheet has lifted off from, below a crest or above a trough, less the
plies of a stack that lie between. A sheet that lies on a tool has the tool's shape, and no height.

A wave is where the sheet turns back and forth along a fibre.

The risk tells where wrinkles are to be expected that a coarse mesh hides or shows too long. It has
three parts, without a unit. Each is 1 where wrinkles are to be expected; the risk is the largest.

Compression. Elements that are too long to fold keep the excess length of a fibre as a compressive
strain. Under the mean strain ε of a family over the wave around an element, with the wavelength λ
that the mesh resolves at most (``output.wrinkle_length``), it is -ε / ε_c. A strip of the fabric
along the fibres that is hinged at the inflections of that wave, λ/2 apart, buckles at

    ε_c C_M t = N_c,    1 / N_c = (λ/2)² / (π² B) + 1 / (C_Q t),    B = C_B t³ / 12,

with the stiffnesses along the fibre in the membrane C_M, in bending C_B and of transverse shear
C_Q. Single elements swing by more than ε_c; a wave answers to the mean over its length.

Locking. The shear angle over that from which on the law locks, of the pair of families that is
nearest; only of laws that state it.

Waves. The least elements that resolve a wave over those of the shortest wave along the fibres
there: beyond 1 height and length of a wave are those of the mesh.

A sheet that lies on a tool has the tool's shape. Compression and waves count only where a tool is
farther off than the thickness, of a stack that of all plies, on both faces. Locking counts
everywhere.

Sources: Euler and Engesser for the strip (Timoshenko and Gere, "Theory of Elastic Stability",
sections 2.1 and 2.17); locking as an onset of wrinkles: Prodromou and Chen, "On the relationship
between shear angle and wrinkling of textile composite preforms", Composites A 28, 1997; that it is
none by itself: Boisse, Hamila, Vidal-Sallé and Dumont, "Simulation of wrinkling during textile
composite reinforcement forming", Compos. Sci. Technol. 71, 2011. Their combination: own.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy.sparse import csr_matrix
from scipy.spatial import cKDTree

from lcmchain.fields.derived import PAIRS_OF_FAMILIES, derive_fields, median_edge_length
from lcmchain.fields.sheet import (
    mesh_axes,
    reference_positions,
    sheet_faces,
    sheet_positions,
)
from lcmchain.materials.law import Material, fibre_angles, locking_angles
from lcmchain.mesh.lines import FibreLines, fibre_lines, lines_along
from lcmchain.mesh.sheet_mesh import NO_NODE, SheetMesh
from lcmchain.thresholds import LEAST_ELEMENTS_PER_WAVE
from lcmchain.tools.distance import gaps
from lcmchain.tools.table import ToolTable

if TYPE_CHECKING:
    import xarray as xr


#: Longest wave that counts as wrinkle by default: so many edges of the mesh (fewer do not resolve
#: a wave), and at least so many thicknesses of the sheet.
WAVE_IN_EDGES = 8.0
WAVE_IN_THICKNESSES = 40.0
#: Longest wave relative to the reach of the regression.
WAVE_PART = 0.75
# Above so many edges per reach the regression takes means over squares of a part of the reach.
LONG_REACH, SQUARE = 12.0, 0.1
# Nodes smoothed at a time: bounds the memory, about 400 places lie within the reach of each.
CHUNK = 4000
# A tool lies below or above the sheet where its distances from both faces differ by this part of
# the thickness, that is unless it stands across the sheet.
SIDE = 0.5


def longest_wave(mesh: SheetMesh) -> float:
    """Return the longest wave that counts as wrinkle unless the scene names another [m]."""
    return max(WAVE_IN_EDGES * median_edge(mesh), WAVE_IN_THICKNESSES * mesh.thickness)


def median_edge(mesh: SheetMesh) -> float:
    """Return the median length of the edges of the undeformed mid-surface [m]."""
    reference, faces = mesh.mid_surface(mesh.node_positions), closed_faces(mesh.sheet_faces)
    return median_edge_length(reference[faces])


def wrinkle_height(
    mesh: SheetMesh,
    positions: np.ndarray,
    wavelength: float,
    *,
    tools: ToolTable | None = None,
    travel: np.ndarray | None = None,
) -> np.ndarray:
    """Return how far the mid-surface has lifted off from its smoothed copy, along its normal.

    Parameters
    ----------
    mesh : undeformed sheet.
    positions : of its nodes [m], shape (F, node_count, 3).
    wavelength : longest wave that counts as wrinkle [m].
    tools, travel : tools that the sheet may lie on, and their travel [m], shape (F, T).

    Returns
    -------
    Heights [m], shape (F, n) for n nodes of the mid-surface, positive towards the upper face.
    """
    return lifted_off(mesh, positions, wavelength, tools=tools, travel=travel).height


class Lifted(NamedTuple):
    """How far a sheet has lifted off, and from what.

    height : of the wrinkles, as :func:`wrinkle_height` has it (F, n) [m].
    room : clear distance to the tool on the side that each node has lifted off from (F, n) [m],
        infinite without one.
    """

    height: np.ndarray
    room: np.ndarray

    def less(self, below: np.ndarray, above: np.ndarray) -> np.ndarray:
        """Return the heights where other plies take a part of the room.

        below, above : thickness of what lies between the nodes and a tool there (F, n) [m].
        """
        room = np.maximum(self.room - np.where(self.height > 0.0, below, above), 0.0)
        return np.sign(self.height) * np.minimum(np.abs(self.height), room)


def lifted_off(
    mesh: SheetMesh,
    positions: np.ndarray,
    wavelength: float,
    *,
    tools: ToolTable | None = None,
    travel: np.ndarray | None = None,
) -> Lifted:
    """Return the heights of wrinkles and the room that limits them; as :func:`wrinkle_height`."""
    positions = np.asarray(positions, dtype=float)
    faces = closed_faces(mesh.sheet_faces)
    surfaces = mesh.mid_surface(positions)
    heights = np.zeros(surfaces.shape[:2])
    rooms = np.full(heights.shape, np.inf)
    for frame, smooth in enumerate(_smoothed(mesh, surfaces, wavelength)):
        normals = node_normals(smooth, faces)
        off = np.einsum("ni,ni->n", surfaces[frame] - smooth, normals)
        if tools is not None and travel is not None:
            bottom, top = faces_of_sheet(mesh, positions[frame], surfaces[frame], normals)
            below, above = clear_distances(tools, travel[frame], bottom, top, mesh.thickness)
            rooms[frame] = np.where(off > 0.0, below, above)
            off = np.sign(off) * np.minimum(np.abs(off), rooms[frame])
        heights[frame] = off
    return Lifted(heights, rooms)


# --- smoothing ------------------------------------------------------------------------------------


def _smoothed(mesh: SheetMesh, surfaces: np.ndarray, wavelength: float) -> np.ndarray:
    """Return the smoothed copies (F, n, 3) of surfaces (F, n, 3)."""
    reference = mesh.mid_surface(mesh.node_positions)
    reach = wavelength / WAVE_PART
    tangents = _tangents(node_normals(reference, closed_faces(mesh.sheet_faces)))
    places, values, weights = reference, np.moveaxis(surfaces, 0, 1), np.ones(len(reference))
    if reach > LONG_REACH * median_edge(mesh):
        means, weights = _means_over_squares(reference, SQUARE * reach)
        places, values = means @ places, _times(means, values)
    parts = [
        _times(rows, values) for rows in _regression(places, weights, reference, tangents, reach)
    ]
    return np.moveaxis(np.concatenate(parts), 1, 0)


def _times(matrix: csr_matrix, values: np.ndarray) -> np.ndarray:
    """Return the product with values (n, F, 3)."""
    return (matrix @ values.reshape(len(values), -1)).reshape(-1, *values.shape[1:])


def _means_over_squares(places: np.ndarray, size: float) -> tuple[csr_matrix, np.ndarray]:
    """Return the matrix of means over the nodes in each square or cube, and how many they are."""
    middle = 0.5 * (places.min(axis=0) + places.max(axis=0))
    cells = np.floor((places - middle) / size + 0.5)
    _, cell, counts = np.unique(cells, axis=0, return_inverse=True, return_counts=True)
    cell = cell.reshape(-1)
    shape = len(counts), len(places)
    return csr_matrix((1.0 / counts[cell], (cell, np.arange(len(places)))), shape), counts * 1.0


def _regression(
    places: np.ndarray, weights: np.ndarray, nodes: np.ndarray, tangents: np.ndarray, reach: float
) -> Iterator[csr_matrix]:
    """Yield rows of the matrix of local quadratic fits to the places, evaluated at the nodes."""
    tree = cKDTree(places)
    for start in range(0, len(nodes), CHUNK):
        own = nodes[start : start + CHUNK]
        near = cKDTree(own).sparse_distance_matrix(tree, reach, output_type="ndarray")
        near = near[np.lexsort((near["j"], near["i"]))]
        row, column = near["i"], near["j"]
        away = (places[column] - own[row]) / reach
        x, y = np.einsum("ptd,pd->tp", tangents[start + row], away)
        weight = weights[column] * (1.0 - (near["v"] / reach) ** 2) ** 2
        terms = np.stack([np.ones_like(x), x, y, x * x, x * y, y * y])
        first = np.flatnonzero(np.diff(row, prepend=-1))
        moments = np.empty((len(own), 6, 6))
        for i in range(6):
            weighted = weight * terms[i]
            for j in range(i + 1):
                moments[:, i, j] = moments[:, j, i] = np.add.reduceat(weighted * terms[j], first)
        # The value of a fit at its own node is its constant term. Strips narrower than two edges do
        # not tell all terms; the pseudo-inverse leaves out what they do not.
        constant = np.linalg.pinv(moments, rcond=1e-9, hermitian=True)[:, 0]
        share = weight * np.einsum("pi,ip->p", constant[row], terms)
        yield csr_matrix((share, (row, column)), shape=(len(own), len(places)))


# --- tools ----------------------------------------------------------------------------------------


def faces_of_sheet(
    mesh: SheetMesh, positions: np.ndarray, surface: np.ndarray, normals: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the points of the lower and the upper face at each node of the mid-surface."""
    sides = mesh.sides()
    if "bottom" in sides:
        return positions[sides["bottom"]], positions[sides["top"]]
    half = 0.5 * mesh.thickness * normals
    return surface - half, surface + half


def clear_distances(
    tools: ToolTable, travel: np.ndarray, bottom: np.ndarray, top: np.ndarray, thickness: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return the distances (n,) to the nearest tool below and above, infinite without one."""
    below, above = np.full(len(bottom), np.inf), np.full(len(top), np.inf)
    for tool, reached in enumerate(travel):
        from_bottom, from_top = (
            gaps(tools, tool, np.ascontiguousarray(face), float(reached)) for face in (bottom, top)
        )
        nearer_bottom = from_top - from_bottom > SIDE * thickness
        nearer_top = from_bottom - from_top > SIDE * thickness
        below[nearer_bottom] = np.minimum(below, np.maximum(from_bottom, 0.0))[nearer_bottom]
        above[nearer_top] = np.minimum(above, np.maximum(from_top, 0.0))[nearer_top]
    return below, above


# --- surfaces -------------------------------------------------------------------------------------


def node_normals(points: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Return unit normals (n, 3) of a surface, means over the faces weighted by their areas.

    faces : (F, 4) nodes; a triangle repeats its last one.
    """
    corners = points[faces]
    area = np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1])
    sums = np.zeros_like(points)
    for corner in range(4):
        for axis in range(3):
            sums[:, axis] += np.bincount(faces[:, corner], area[:, axis], len(points))
    length = np.linalg.norm(sums, axis=1)
    return sums / np.where(length > 0.0, length, 1.0)[:, None]


def closed_faces(faces: np.ndarray) -> np.ndarray:
    """Return faces (F, 4) that repeat their last node where they have three."""
    if faces.shape[1] == 3:
        return np.concatenate([faces, faces[:, 2:]], axis=1)
    return np.where(faces == NO_NODE, faces[:, 2:3], faces)


def _tangents(normals: np.ndarray) -> np.ndarray:
    """Return two unit vectors (n, 2, 3) perpendicular to each normal and to each other."""
    helper = np.eye(3)[np.argmin(np.abs(normals), axis=1)]
    first = np.cross(helper, normals)
    first /= np.linalg.norm(first, axis=1)[:, None]
    return np.stack([first, np.cross(normals, first)], axis=1)


# --- waves: how many elements they have, along the fibres -----------------------------------------


#: Turn of the sheet over half a wave that counts as one [rad]. At eight elements of 5 mm it is a
#: wave of 1.1 mm from crest to trough; shallower ones are no wrinkles.
LEAST_TURN = np.radians(10.0)


def elements_per_wave(sheet: xr.Dataset, frame: int = -1) -> np.ndarray:
    """Return the elements per wavelength of the shortest wave along each face, inf without one.

    Along every line of edges that follows a fibre the sheet turns at the nodes. Half a wave is a
    piece that turns one way by ``LEAST_TURN``, between two pieces that turn the other way; it
    reaches from inflection to inflection, and a wave has twice its elements.

    Parameters
    ----------
    sheet : root group of a result.
    frame : saved frame, the last one by default.

    Returns
    -------
    Shape (face_count,).
    """
    faces = sheet_faces(sheet)
    lines = lines_along(reference_positions(sheet), faces, mesh_axes(sheet))
    return elements_in_waves(sheet_positions(sheet, frame), faces, lines)


def elements_in_waves(points: np.ndarray, faces: np.ndarray, lines: FibreLines) -> np.ndarray:
    """Return what :func:`elements_per_wave` does, of a surface (n, 3) with faces (F, 4).

    lines : along the fibres of the undeformed surface.
    """
    normals = node_normals(points, faces)
    shortest = np.full(len(faces), np.inf)
    for before, after in zip(lines.before, lines.after, strict=True):
        of_edge = np.full(len(points), np.inf)  # from a node on
        for line in _lines(before, after):
            for first, last in half_waves(_turns(points[line], normals[line])):
                inside = line[int(first) + 1 : int(last) + 1]
                of_edge[inside] = np.minimum(of_edge[inside], 2.0 * (last - first))
        for side in range(4):
            start, end = faces[:, side], faces[:, (side + 1) % 4]
            for one, other in ((start, end), (end, start)):
                beside = np.where(after[one] == other, of_edge[one], np.inf)
                shortest = np.minimum(shortest, beside)
    return shortest


def _lines(before: np.ndarray, after: np.ndarray) -> Iterator[np.ndarray]:
    """Yield the nodes of every line, from its first to its last."""
    for first in np.flatnonzero((before == NO_NODE) & (after != NO_NODE)):
        line = [first]
        while after[line[-1]] != NO_NODE:
            line.append(after[line[-1]])
        yield np.array(line)


def _turns(points: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """Return the angles [rad] at the inner nodes of a line, positive where it turns upwards.

    Only the turn out of the plane of the sheet counts, not the turn in the plane by shear.
    """
    edges = np.diff(points, axis=0)
    edges /= np.maximum(np.linalg.norm(edges, axis=1), 1e-300)[:, None]
    inner = normals[1:-1]
    ahead, behind = (np.einsum("ni,ni->n", part, inner) for part in (edges[1:], edges[:-1]))
    return np.arcsin(np.clip(ahead, -1.0, 1.0)) - np.arcsin(np.clip(behind, -1.0, 1.0))


def half_waves(turns: np.ndarray) -> list[tuple[float, float]]:
    """Return the places of both inflections of every half wave, in edges from the line's start.

    turns : (n - 1,) [rad], at the inner nodes of a line of n edges; the first one has the place 0.
    """
    ends = np.flatnonzero(np.diff(np.sign(turns)) != 0)
    pieces = np.split(np.arange(len(turns)), ends + 1)
    notable = [p for p in pieces if len(p) and abs(turns[p].sum()) >= LEAST_TURN]
    inflections = []
    for before, piece, after in zip(notable, notable[1:], notable[2:]):
        sign = np.sign(turns[piece[0]])
        if sign != np.sign(turns[before[0]]) and sign != np.sign(turns[after[0]]):
            inflections.append(
                (_inflection(turns, before, piece), _inflection(turns, piece, after))
            )
    return inflections


def _inflection(turns: np.ndarray, one: np.ndarray, other: np.ndarray) -> float:
    """Return where the turn passes zero, between the last node of a piece and the next one's."""
    last, first = int(one[-1]), int(other[0])
    left, right = abs(turns[last]), abs(turns[first])
    return last + (first - last) * left / (left + right)


# --- risk: where wrinkles are to be expected ------------------------------------------------------


#: Names of the fields: the largest part, and the parts.
RISK, COMPRESSION, LOCKING, WAVES = (
    "wrinkle_risk", "wrinkle_risk_compression", "wrinkle_risk_locking", "wrinkle_risk_waves",
)  # fmt: skip
#: Risk from which on wrinkles are to be expected.
EXPECTED = 1.0
#: Reach R of the mean around an element, whose weights go as (1 - (r/R)²)²: as wide as the plain
#: mean over a disc of one wave across.
REACH_IN_WAVES = 0.7

# Strain at which the tangent of a fibre in compression is taken: small against all that buckles.
_AT_COMPRESSION = -1e-6
# Faces whose neighbours are looked up at a time: bounds the memory.
_FACES_AT_A_TIME = 4000


def wrinkle_risk(
    mesh: SheetMesh,
    material: Material,
    positions: np.ndarray,
    wavelength: float,
    *,
    tools: ToolTable | None = None,
    travel: np.ndarray | None = None,
    touch: float | None = None,
) -> dict[str, np.ndarray]:
    """Return the risk and its parts on the faces of a sheet.

    Parameters
    ----------
    mesh : undeformed sheet.
    positions : of its nodes [m], shape (F, node_count, 3).
    wavelength : longest wave that counts as wrinkle [m].
    tools, travel : tools that the sheet may lie on, and their travel [m], shape (F, T).
    touch : distance from a tool up to which the sheet lies on it [m]; the thickness by default, the
        thickness of the stack for a ply.

    Returns
    -------
    ``wrinkle_risk`` and its parts by name, each (F, element_count); without the part of locking
    where the law does not lock.
    """
    positions = np.asarray(positions, dtype=float)
    values = derive_fields(mesh, material, positions)
    free = _free_of_tools(
        mesh, positions, tools, travel, mesh.thickness if touch is None else touch
    )
    parts = {
        COMPRESSION: np.where(free, _compression(mesh, material, values, wavelength), 0.0),
        WAVES: np.where(free, _waves(mesh, positions), 0.0),
    }
    angles = locking_angles(material)
    if any(angle is not None for angle in angles):
        parts[LOCKING] = nearness_of_locking(values, angles)
    return {RISK: np.max(list(parts.values()), axis=0), **parts}


def nearness_of_locking(
    values: dict[str, np.ndarray], angles: tuple[float | None, ...]
) -> np.ndarray:
    """Return the shear angle over the locking angle, of the nearest pair of families.

    Parameters
    ----------
    values : fields by name, the shear angles of all pairs among them [rad].
    angles : locking angles of the pairs [rad], None where a pair does not lock.
    """
    return np.max(
        [
            np.abs(values[name]) / angle
            for name, angle in zip(PAIRS_OF_FAMILIES, angles, strict=False)
            if angle is not None
        ],
        axis=0,
    )


def critical_strains(material: Material, half_wave: float) -> np.ndarray:
    """Return the compressive strain at which a strip along each family buckles, positive.

    Parameters
    ----------
    half_wave : distance of the two hinges [m].

    Returns
    -------
    Shape (families,); infinite for fibres without a stiffness in compression.
    """
    thickness, bending = material.thickness, material.bending_matrix()
    strains = []
    for angle in fibre_angles(material):
        c, s = np.cos(angle), np.sin(angle)
        along = np.array([c * c, s * s, 0.0, 2.0 * c * s, 0.0, 0.0])
        across = np.array([0.0, 0.0, 0.0, 0.0, s, c])  # 23 and 13: tilt of the director along it
        tangent = material.stress_and_tangent(_AT_COMPRESSION * along)[1]
        membrane, shear = along @ tangent @ along, across @ tangent @ across
        euler = np.pi**2 * (along @ bending @ along) * thickness**3 / (12.0 * half_wave**2)
        force = 1.0 / (1.0 / euler + 1.0 / (shear * thickness)) if min(euler, shear) > 0 else 0.0
        strains.append(force / (membrane * thickness) if membrane > 0.0 else np.inf)
    return np.array(strains)


def _compression(
    mesh: SheetMesh, material: Material, values: dict[str, np.ndarray], wavelength: float
) -> np.ndarray:
    """Return the largest compressive strain over the critical one of all families, 0 in tension."""
    critical = critical_strains(material, 0.5 * wavelength)
    strains = np.stack([values[f"fibre_strain_{k}"] for k in range(1, len(critical) + 1)])
    mean = _means_around(mesh, strains, REACH_IN_WAVES * wavelength)
    with np.errstate(divide="ignore"):
        return np.maximum(-mean / critical[:, None, None], 0.0).max(axis=0)


def _means_around(mesh: SheetMesh, values: np.ndarray, reach: float) -> np.ndarray:
    """Return the means of values (..., E) around each face, weighted by area and (1 - (r/R)²)²."""
    corners = mesh.mid_surface(mesh.node_positions)[closed_faces(mesh.sheet_faces)]
    centres, areas = corners.mean(axis=1), mesh.element_areas
    tree = cKDTree(centres)
    means = np.empty_like(values)
    for start in range(0, len(centres), _FACES_AT_A_TIME):
        own = slice(start, min(start + _FACES_AT_A_TIME, len(centres)))
        near = tree.query_ball_point(centres[own], reach, return_sorted=True)
        first = np.cumsum([0, *(len(found) for found in near[:-1])])
        faces = np.concatenate(near).astype(np.intp)
        away = centres[faces] - np.repeat(centres[own], [len(found) for found in near], axis=0)
        weights = areas[faces] * (1.0 - np.einsum("fd,fd->f", away, away) / reach**2) ** 2
        sums = np.add.reduceat(values[..., faces] * weights, first, axis=-1)
        means[..., own] = sums / np.add.reduceat(weights, first)
    return means


def _waves(mesh: SheetMesh, positions: np.ndarray) -> np.ndarray:
    faces, lines = closed_faces(mesh.sheet_faces), fibre_lines(mesh)
    surfaces = mesh.mid_surface(positions)
    elements = [elements_in_waves(surface, faces, lines) for surface in surfaces]
    return LEAST_ELEMENTS_PER_WAVE / np.stack(elements)


def _free_of_tools(
    mesh: SheetMesh,
    positions: np.ndarray,
    tools: ToolTable | None,
    travel: np.ndarray | None,
    touch: float,
) -> np.ndarray:
    """Tell which faces (F, E) have room for a wave on both sides: at a node of each at least."""
    faces = closed_faces(mesh.sheet_faces)
    free = np.ones((len(positions), len(faces)), dtype=bool)
    if tools is None or travel is None:
        return free
    surfaces = mesh.mid_surface(positions)
    for frame, surface in enumerate(surfaces):
        sides = faces_of_sheet(mesh, positions[frame], surface, node_normals(surface, faces))
        distances = clear_distances(tools, travel[frame], *sides, mesh.thickness)
        for distance in distances:
            free[frame] &= distance[faces].max(axis=1) > touch
    return free
