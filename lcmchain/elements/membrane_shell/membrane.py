"""Loops over triangles without their shell part: a membrane, which folds at no cost.

The equations of ``equations.py`` without the curvatures: nothing of them is loaded, stored or
computed. A triangle has no neighbours here, and forces on its own corners alone.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import prange

from lcmchain.dispatch import implements
from lcmchain.elements.blocks import LANES, in_blocks
from lcmchain.elements.family import internal_forces
from lcmchain.elements.membrane_shell.equations import membrane_resultants, membrane_strain
from lcmchain.elements.membrane_shell.kernel import (
    AREA,
    add_membrane_terms,
    corner_gradients,
    largest_eigenvalue,
    load3,
    relative,
    store3,
)
from lcmchain.elements.membrane_shell.patch import CORNERS, TriangleGeometry
from lcmchain.elements.vectors import combination2, cross, dot
from lcmchain.jit import equation, kernel, routine
from lcmchain.materials.law import Law, plane_response

FORCE_ROWS = 3 * CORNERS
# gradients of nodes 1 and 2, area
DATA_ROWS = 5


class MembraneData(NamedTuple):
    """Constants of a body of triangles without bending as its kernels read them.

    law : see :mod:`lcmchain.materials.law`; thickness : initial thickness [m].
    corner_node : (block_count * 3 * 16,) int32. element_data : (block_count * 5 * 16,).
    element_count : without the padding of the last block.
    """

    law: Law
    thickness: float
    corner_node: np.ndarray
    element_data: np.ndarray
    element_count: int


def membrane_data(
    law: Law, thickness: float, geometry: TriangleGeometry, first_node: int
) -> MembraneData:
    """Return the constants of triangles; ``first_node`` is the mesh's first in the model."""
    count = len(geometry.area)
    rows = np.concatenate(
        [geometry.gradient[:, 1:].reshape(count, 4), geometry.area[:, None]], axis=1
    )
    corners = in_blocks(geometry.nodes[:, :CORNERS] + first_node).astype(np.int32)
    return MembraneData(law, thickness, corners, in_blocks(rows), count)


@equation
def load_triangle(x, data, i):
    """Return u1, u2, the gradients of nodes 1 and 2, and the area."""
    L = LANES
    x0 = load3(x, i)
    u = (relative(x, i + 3 * L, x0), relative(x, i + 6 * L, x0))
    gradient = ((data[i], data[i + L]), (data[i + 2 * L], data[i + 3 * L]))
    return u, gradient, data[i + AREA * L]


@equation
def fibre_vectors(u, gradient):
    """Return the deformed fibre directions a1, a2."""
    u1, u2 = u
    a1 = combination2(gradient[0][0], u1, gradient[1][0], u2)
    return a1, combination2(gradient[0][1], u1, gradient[1][1], u2)


@equation
def membrane_in_lane(i, x, data, law, thickness):
    """Replace the corners' positions at ``x[i + row*16]`` by the internal forces."""
    u, gradient, area = load_triangle(x, data, i)
    a1, a2 = fibre_vectors(u, gradient)
    E11, E22, g12 = membrane_strain(a1, a2)
    S, _ = plane_response(law, E11, E22, g12)
    p1, p2 = membrane_resultants(area * thickness, S[0], S[1], S[2], a1, a2)
    f1 = combination2(gradient[0][0], p1, gradient[0][1], p2)
    f2 = combination2(gradient[1][0], p1, gradient[1][1], p2)
    store3(x, i + 3 * LANES, f1)
    store3(x, i + 6 * LANES, f2)
    store3(x, i, (-f1[0] - f2[0], -f1[1] - f2[1], -f1[2] - f2[2]))


@equation
def gather_corners(positions, nodes, x):
    for c in range(CORNERS):
        for lane in range(LANES):
            node = nodes[c * LANES + lane]
            x[3 * c * LANES + lane] = positions[0, node]
            x[(3 * c + 1) * LANES + lane] = positions[1, node]
            x[(3 * c + 2) * LANES + lane] = positions[2, node]


@implements(internal_forces, MembraneData)
def membrane_forces(body, positions, node_force, history):
    """Write the internal forces of all triangles of a body on their corners.

    Parameters
    ----------
    body : :class:`MembraneData`. positions : (3, node_count) [m].
    node_force : (block_count * 9 * 16,) or longer [N], row ``3*corner + component``, written.
    history : empty, no law with memory serves triangles yet.
    """
    membrane_force_loop(
        positions, body.corner_node, body.element_data, node_force, body.law, body.thickness
    )


@kernel
def membrane_force_loop(positions, corner_node, element_data, node_force, law, thickness):
    block_count = corner_node.size // (CORNERS * LANES)
    for block in prange(block_count):
        nodes = corner_node[block * CORNERS * LANES : (block + 1) * CORNERS * LANES]
        x = node_force[block * FORCE_ROWS * LANES : (block + 1) * FORCE_ROWS * LANES]
        data = element_data[block * DATA_ROWS * LANES : (block + 1) * DATA_ROWS * LANES]
        gather_corners(positions, nodes, x)
        for lane in range(LANES):
            membrane_in_lane(lane, x, data, law, thickness)


@kernel
def membrane_state_loop(positions, corner_node, element_data, strain, area_ratio):
    """Write strains (block_count * 16, 6), engineering shear, and current over initial area."""
    block_count = corner_node.size // (CORNERS * LANES)
    for block in prange(block_count):
        nodes = corner_node[block * CORNERS * LANES : (block + 1) * CORNERS * LANES]
        data = element_data[block * DATA_ROWS * LANES : (block + 1) * DATA_ROWS * LANES]
        x = np.empty(FORCE_ROWS * LANES)
        gather_corners(positions, nodes, x)
        for lane in range(LANES):
            u, gradient, _ = load_triangle(x, data, lane)
            a1, a2 = fibre_vectors(u, gradient)
            E11, E22, g12 = membrane_strain(a1, a2)
            N = cross(a1, a2)
            element = block * LANES + lane
            strain[element, 0] = E11
            strain[element, 1] = E22
            strain[element, 2] = 0.0
            strain[element, 3] = g12
            strain[element, 4] = 0.0
            strain[element, 5] = 0.0
            area_ratio[element] = math.sqrt(dot(N, N))


@routine
def membrane_frequency_bounds(body, positions, mass, node_weight, membrane, omega2):
    """Write for every node the share of an upper bound of the membrane's highest frequency.

    As :func:`lcmchain.elements.membrane_shell.kernel.nodal_frequency_bounds`, without bending.
    ``membrane`` : (6, node_count), scratch; ``omega2`` : (node_count,) [1/s²], written.
    """
    membrane[:] = 0.0
    x = np.empty(FORCE_ROWS * LANES)
    for element in range(body.element_count):
        block, lane = divmod(element, LANES)
        nodes = body.corner_node[block * CORNERS * LANES + lane :: LANES][:CORNERS]
        data = body.element_data[block * DATA_ROWS * LANES : (block + 1) * DATA_ROWS * LANES]
        for c in range(CORNERS):
            for d in range(3):
                x[(3 * c + d) * LANES + lane] = positions[d, nodes[c]]
        u, gradient, area = load_triangle(x, data, lane)
        a1, a2 = fibre_vectors(u, gradient)
        g1, g2 = corner_gradients(gradient)
        add_membrane_terms(
            membrane, nodes, node_weight, g1, g2, a1, a2, body.law, area * body.thickness
        )
    for node in range(mass.size):
        M = membrane[:, node]
        omega2[node] = largest_eigenvalue(M[0], M[1], M[2], M[3], M[4], M[5]) / mass[node]
