"""What presses a solid-shell together: the part of its normal stress that others exert on it.

The stress S33 of a bent element is not the pressure of a tool: the bending energy falls with the
thickness, so that a strip bent freely to the curvature κ gets thinner until S33 = -C11^B (κ h)²/3,
with nothing on its faces. What is balanced from outside is the virtual work of the internal forces
when the thickness t = d·n of every node pair is scaled along the normal n of the mid-surface:

    ½ Σ (f_top - f_bottom)·n (d·n) = -p A t

for a pressure p on both faces, whatever the law and the options of the element are. Along the
normal, and not along the director d, because the bending moment of the neighbours does work where a
director that is tilted by transverse shear gets longer.
"""

from __future__ import annotations

import numpy as np
from numba import prange

from lcmchain.elements.blocks import LANES, from_blocks
from lcmchain.elements.family import NormalPressure, internal_forces
from lcmchain.elements.solid_shell.energies import strain_energies
from lcmchain.elements.solid_shell.kernel import CORNER_ROWS, SolidShellData, curvature_rows
from lcmchain.jit import kernel
from lcmchain.materials.law import load_history, membrane_response
from lcmchain.mesh.blank import BlankMesh

PAIRS = 4  # of corners, one below the other


def normal_pressure(
    data: SolidShellData,
    mesh: BlankMesh,
    first_node: int,
    positions: np.ndarray,
    history: np.ndarray,
) -> NormalPressure:
    """Return the Cauchy stress normal to the sheet and the part of it that presses from outside.

    Parameters
    ----------
    data, mesh, first_node : of the body.
    positions : (3, node_count) of the whole model [m]. history : of the body, in blocks.
    """
    own = positions[:, first_node : first_node + mesh.node_count].T
    area_0, area = mesh.areas(mesh.node_positions), mesh.areas(own)
    normal = node_normals(mesh, own)
    thickness = np.einsum("nd,nd->n", own[mesh.pair_count :] - own[: mesh.pair_count], normal)
    force = corner_forces(data, mesh.element_count, positions, history)
    apart = np.einsum("epd,epd->ep", force[:, PAIRS:] - force[:, :PAIRS], normal[mesh.faces])
    work = 0.5 * np.sum(apart * thickness[mesh.faces], axis=1)
    stress, stretch = stress_and_stretch(data, positions, history)
    stress, stretch = stress[: mesh.element_count], stretch[: mesh.element_count]
    with np.errstate(divide="ignore", invalid="ignore"):
        contact = -work / (area * thickness[mesh.faces].mean(axis=1))
        total = -stress * stretch * (area_0 / area)
    return NormalPressure(contact, total)


def corner_forces(
    data: SolidShellData, element_count: int, positions: np.ndarray, history: np.ndarray
) -> np.ndarray:
    """Return the internal forces on the corners of all elements (element_count, 8, 3) [N]."""
    rows = np.zeros(data.corner_node.size * 3)
    internal_forces(data, positions, rows, history.copy())  # the kernel moves a history on
    return from_blocks(rows, CORNER_ROWS, element_count).reshape(element_count, 2 * PAIRS, 3)


def node_normals(mesh: BlankMesh, own: np.ndarray) -> np.ndarray:
    """Return the mean normals of the faces around the mid-surface nodes (pair_count, 3).

    ``own`` are the positions of the body's nodes (mesh.node_count, 3) [m].
    """
    base = mesh.base_vectors(own)
    of_face = np.cross(base[:, 0], base[:, 1])
    nodes, count = mesh.faces.ravel(), mesh.pair_count
    normal = np.column_stack(
        [np.bincount(nodes, np.repeat(part, PAIRS), minlength=count) for part in of_face.T]
    )
    with np.errstate(divide="ignore", invalid="ignore"):
        return normal / np.linalg.norm(normal, axis=1)[:, None]


def stress_and_stretch(
    data: SolidShellData, positions: np.ndarray, history: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return S33 of the law [Pa] and λ = (1 + 2 E33)^½ at the centres (block_count * 16,)."""
    count = data.corner_node.size // (2 * PAIRS)
    strain, energy = np.empty((count, 6)), np.empty((2, count))
    strain_energies(data, positions, history, strain, energy[0], energy[1])
    stress = np.empty(count)
    _stress33(data.law, data.options, strain, history, stress)
    return stress, np.sqrt(np.maximum(1.0 + 2.0 * strain[:, 2], 0.0))


@kernel
def _stress33(law, options, strain, history, stress):
    block_count = stress.size // LANES
    history_size = history.size // block_count
    curvature_size = curvature_rows(options.director) * LANES
    for block in prange(block_count):
        past = history[block * history_size : (block + 1) * history_size][curvature_size:]
        for lane in range(LANES):
            row = strain[block * LANES + lane]
            E = (row[0], row[1], row[2], row[3], row[4], row[5])
            S, _ = membrane_response(law, E, load_history(law, past, lane, LANES))
            stress[block * LANES + lane] = S[2]
