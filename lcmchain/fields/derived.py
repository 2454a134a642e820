"""Fields that follow from the positions of the nodes, and pressures on and in a sheet.

The deformation gradient at the element centres gives angles, strains and thickness. Pressures come
from the forces of tools, and from those of the elements.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from lcmchain.materials.law import Material, fibre_angles, tells_fibres
from lcmchain.mesh.sheet_mesh import SheetMesh, angle_of_shear, carried, change_of_angle

if TYPE_CHECKING:
    from lcmchain.elements.family import Body

#: Angles of the families of a fabric with fibres along both axes of the ply.
TWO_ALONG_THE_AXES = (0.0, 0.5 * np.pi)
#: Fields of the change of an angle, and the families that it is between, from 0.
PAIRS_OF_FAMILIES = {"shear_angle": (0, 1), "shear_angle_23": (1, 2), "shear_angle_31": (2, 0)}


def derive_fields(
    mesh: SheetMesh, material: Material, positions: np.ndarray
) -> dict[str, np.ndarray]:
    """Derive the state of the textile in every element from the positions of the nodes.

    With the covariant base vectors a1, a2, a3 of the element centre (modes 1 to 3 of the node
    positions; capitals: reference) the deformation gradient is F = a_k ⊗ A^k. Every measure is
    taken at the centre, where the element has its strains: a face has the area 4 |a1 × a2| and
    the element the thickness 2 a3·n, n normal to a1 and a2, with what a bent element misses of it
    on its chord (:func:`lcmchain.mesh.hexahedron.bend_part`).

    Parameters
    ----------
    mesh : undeformed, with its fibre directions.
    material : with ``areal_mass`` [kg/m²], and ``fibre_density`` [kg/m³] or None.
    positions : node positions [m], shape (..., node_count, 3).

    Returns
    -------
    The variables of those face fields in :data:`lcmchain.quantities.fields.FIELDS` that follow from
    positions, each of shape (..., element_count); without ``fibre_volume_fraction`` where the fibre
    density is unknown, without all that needs a thickness for meshes that have none, and without
    all that is of fibres for films and rubber.

    Notes
    -----
    The fibre volume fraction is conserved volume, v_f = v_f0 / det F. With inextensible fibres
    det F = (t / t0) cos γ, so that shear and compaction both raise it. Pressures follow from
    forces, not from positions alone (:mod:`lcmchain.fields.derived`).
    """
    reference = mesh.initial_base_vectors
    current = mesh.base_vectors(np.asarray(positions, dtype=float))
    area_0, normal_0 = _length_and_direction(np.cross(reference[..., 0, :], reference[..., 1, :]))
    area, normal = _length_and_direction(np.cross(current[..., 0, :], current[..., 1, :]))
    in_plane: dict[str, np.ndarray] = {}
    if tells_fibres(material):
        fibre_1, fibre_2 = (carried(own, current) for own in mesh.fibre_components)
        in_plane = _in_plane_fields(material, area_0 / area, normal, fibre_1, fibre_2)
    if not mesh.has_thickness:
        return in_plane

    chord_0, chord = _dot(reference[..., 2, :], normal_0), _dot(current[..., 2, :], normal)
    bend_0, bend = mesh.initial_bend_part, mesh.bend_part(positions)
    stretch = _thickness_stretch(chord / chord_0, (bend - bend_0) / chord_0**2)
    fields = {"thickness": 2.0 * np.sqrt(chord_0**2 + bend_0) * stretch}
    if material.fibre_density is not None:
        initial_fraction = material.areal_mass / (material.fibre_density * 2.0 * chord_0)
        with np.errstate(divide="ignore"):
            fields["fibre_volume_fraction"] = initial_fraction * (area_0 / (area * stretch))
    return fields | in_plane


def _in_plane_fields(material, area_ratio, normal, fibre_1, fibre_2) -> dict[str, np.ndarray]:
    """Fields of the fibres: ``area_ratio`` is initial over current area, fibres are F·direction."""
    fields = {"areal_fibre_mass": material.areal_mass * area_ratio}
    angles = fibre_angles(material)
    if angles != TWO_ALONG_THE_AXES:
        return fields | _family_fields(angles, normal, fibre_1, fibre_2)
    stretch_1, direction_1 = _length_and_direction(fibre_1)
    stretch_2, direction_2 = _length_and_direction(fibre_2)
    fields["shear_angle"] = angle_of_shear(direction_1, direction_2, normal)
    for name, direction in (("1", direction_1), ("2", direction_2)):
        for axis, component in zip("xyz", np.moveaxis(direction, -1, 0), strict=True):
            fields[f"fibre_direction_{name}_{axis}"] = np.ascontiguousarray(component)
    fields["fibre_strain_1"] = stretch_1 - 1.0
    fields["fibre_strain_2"] = stretch_2 - 1.0
    return fields


def _family_fields(angles, normal, axis_1, axis_2) -> dict[str, np.ndarray]:
    """Fields of families at any angles; the axes are F·direction of those of the ply.

    The shear of a single family is that of the fibres and the line that was across them.
    """
    fields: dict[str, np.ndarray] = {}
    lines = [np.cos(angle) * axis_1 + np.sin(angle) * axis_2 for angle in angles]
    for number, line in enumerate(lines, start=1):
        stretch, direction = _length_and_direction(line)
        for axis, component in zip("xyz", np.moveaxis(direction, -1, 0), strict=True):
            fields[f"fibre_direction_{number}_{axis}"] = np.ascontiguousarray(component)
        fields[f"fibre_strain_{number}"] = stretch - 1.0
    if len(angles) == 1:
        across = np.cos(angles[0]) * axis_2 - np.sin(angles[0]) * axis_1
        fields["strain_across"] = np.linalg.norm(across, axis=-1) - 1.0
        lines.append(across)
        angles = (angles[0], angles[0] + 0.5 * np.pi)
    for name, (first, second) in PAIRS_OF_FAMILIES.items():
        if second < len(lines) and first < len(lines):
            apart = angles[second] - angles[first]
            fields[name] = change_of_angle(lines[first], lines[second], normal, apart)
    return fields


def _thickness_stretch(on_chord: np.ndarray, bend: np.ndarray) -> np.ndarray:
    """Present over initial thickness; an inverted element keeps what it has on the chord."""
    squared = on_chord**2 + bend
    sound = (on_chord > 0.0) & (squared > 0.0)
    return np.where(sound, np.sqrt(np.where(sound, squared, 1.0)), on_chord)


def median_edge_length(corners: np.ndarray) -> float:
    """Return the median length of the edges of faces (face_count, 4, 3) [m].

    Triangles repeat their last corner.
    """
    lengths = np.linalg.norm(corners - np.roll(corners, -1, axis=1), axis=2)
    return float(np.median(lengths[lengths > 0.0]))


def face_area_vectors(corners: np.ndarray) -> np.ndarray:
    """Half the cross product of the diagonals of faces, shape (..., 4, 3) [m], as (..., 3) [m2].

    Its length 4 |a1 × a2| is the area at the centre of a warped face, and the exact area of a
    plane face and of a triangle that repeats its last corner.
    """
    return 0.5 * np.cross(
        corners[..., 2, :] - corners[..., 0, :], corners[..., 3, :] - corners[..., 1, :]
    )


def _dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.einsum("...i,...i->...", a, b)


def _length_and_direction(vector: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    length = np.linalg.norm(vector, axis=-1)
    with np.errstate(invalid="ignore", divide="ignore"):
        return length, vector / length[..., None]


# --- pressures ------------------------------------------------------------------------------------


def pressure_fields(
    body: Body, positions: np.ndarray, history: np.ndarray
) -> dict[str, np.ndarray]:
    """Return what presses on every element from outside, and what comes from within.

    Parameters
    ----------
    positions : of all nodes of the model (node_count, 3) [m].
    history : what the body's law remembers, in blocks of elements.

    Returns
    -------
    ``compaction_pressure`` and ``bending_pressure`` (element_count,) [Pa]; their sum is the Cauchy
    pressure λ |S33| A0 / A. Nothing for a sheet without thickness.
    """
    pressure = body.normal_pressure(np.ascontiguousarray(positions.T), history)
    if pressure is None:
        return {}
    return {
        "compaction_pressure": pressure.contact,
        "bending_pressure": pressure.total - pressure.contact,
    }


def tool_pressure(body: Body, positions: np.ndarray, contact_force: np.ndarray) -> np.ndarray:
    """Return the pressure of the tools on the nodes of a body (mesh.node_count,) [Pa].

    Parameters
    ----------
    positions : of all nodes of the model (node_count, 3) [m].
    contact_force : sum of the normal forces of all tools on each of them (node_count,) [N].
    """
    own = slice(body.first_node, body.first_node + body.mesh.node_count)
    return contact_force[own] / body.present_node_area(np.ascontiguousarray(positions.T))
