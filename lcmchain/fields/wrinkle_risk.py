"""Wrinkle risk: where wrinkles are to be expected that a coarse mesh hides or shows too long.

Three parts, without a unit. Each is 1 where wrinkles are to be expected; the risk is the largest.

Compression. Elements that are too long to fold keep the excess length of a fibre as a compressive
strain. Under the mean strain ε of a family over the wave around an element, with the wavelength λ
that the mesh resolves at most (``output.wrinkle_length``), it is -ε / ε_c. A strip of the fabric
along the fibres that is hinged at the inflections of that wave, λ/2 apart, buckles at

    ε_c C_M t = N_c,    1 / N_c = (λ/2)² / (π² B) + 1 / (C_Q t),    B = C_B t³ / 12,

with the stiffnesses along the fibre in the membrane C_M, in bending C_B and of transverse shear
C_Q. Single elements swing by more than ε_c; a wave answers to the mean over its length.

Locking. The shear angle over that from which on the law locks, of the pair of families that is
nearest; only of laws that state it.

Waves. The least elements that resolve a wave over those of the shortest wave along the fibres there
(:mod:`lcmchain.fields.wrinkles`): beyond 1 height and length of a wave are those of the mesh.

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

import numpy as np
from scipy.spatial import cKDTree

from lcmchain.fields.derived import PAIRS_OF_FAMILIES, derive_fields
from lcmchain.fields.wrinkles import (
    clear_distances,
    closed_faces,
    elements_in_waves,
    faces_of_sheet,
    node_normals,
)
from lcmchain.materials.law import Material, fibre_angles, locking_angles
from lcmchain.mesh.lines import fibre_lines
from lcmchain.mesh.sheet_mesh import SheetMesh
from lcmchain.thresholds import LEAST_ELEMENTS_PER_WAVE
from lcmchain.tools.table import ToolTable

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
_CHUNK = 4000


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
    for start in range(0, len(centres), _CHUNK):
        own = slice(start, min(start + _CHUNK, len(centres)))
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
