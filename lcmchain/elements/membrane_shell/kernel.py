"""Loops over triangles with membrane and shell part: forces, stored energies, frequency bound.

Layout and packed instructions as in ``elements/solid_shell/kernel.py``: blocks of 16 triangles, one
loop over the lanes around the straight-line equations of ``equations.py``.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import prange

from lcmchain.dispatch import implements
from lcmchain.elements.blocks import LANES, in_blocks
from lcmchain.elements.family import internal_forces
from lcmchain.elements.membrane_shell.equations import (
    membrane_strain,
    patch_forces,
    second_derivative,
)
from lcmchain.elements.membrane_shell.patch import CORNERS, PATCH_NODES, TriangleGeometry
from lcmchain.elements.vectors import combination2, cross, dot
from lcmchain.jit import equation, kernel, routine
from lcmchain.materials.law import Law, plane_bending_stiffness, plane_response

FORCE_ROWS = 3 * PATCH_NODES
# gradients of nodes 1 and 2, area, weights of nodes 1 ... 5 in the three second derivatives
DATA_ROWS = 20
GRADIENT, AREA, WEIGHTS, WEIGHT_COUNT = 0, 4, 5, 5


class MembraneShellData(NamedTuple):
    """Constants of a body of triangles as its kernels read them.

    law : see :mod:`lcmchain.materials.law`; thickness : initial thickness [m].
    corner_node : (block_count * 6 * 16,) int32, nodes of the patches
        (:func:`patch_nodes_in_blocks`).
    element_data : (block_count * 20 * 16,), see :func:`patch_rows`.
    element_count : without the padding of the last block.
    """

    law: Law
    thickness: float
    corner_node: np.ndarray
    element_data: np.ndarray
    element_count: int


def patch_rows(geometry: TriangleGeometry) -> np.ndarray:
    """Return the data (E, 20) of triangles."""
    count = len(geometry.area)
    return np.concatenate(
        [
            geometry.gradient[:, 1:].reshape(count, 4),
            geometry.area[:, None],
            geometry.curvature[:, :, 1:].reshape(count, 15),
        ],
        axis=1,
    )


def patch_nodes_in_blocks(geometry: TriangleGeometry, first_node: int = 0) -> np.ndarray:
    """Return the nodes of the patches in blocks; absent ones, without weight, repeat the first.

    ``first_node`` is the number of the mesh's first node in the model.
    """
    nodes = geometry.nodes
    return in_blocks(np.where(nodes < 0, nodes[:, :1], nodes) + first_node).astype(np.int32)


@equation
def load3(data, i):
    return (data[i], data[i + LANES], data[i + 2 * LANES])


@equation
def load_weights(data, i, row):
    L = LANES
    k = i + (WEIGHTS + WEIGHT_COUNT * row) * L
    return (data[k], data[k + L], data[k + 2 * L], data[k + 3 * L], data[k + 4 * L])


@equation
def load_patch(x, data, i):
    """Return u1 ... u5, the gradients of nodes 1 and 2, the weights, and the area."""
    L = LANES
    x0 = load3(x, i)
    u = (
        relative(x, i + 3 * L, x0),
        relative(x, i + 6 * L, x0),
        relative(x, i + 9 * L, x0),
        relative(x, i + 12 * L, x0),
        relative(x, i + 15 * L, x0),
    )
    k = i + GRADIENT * L
    gradient = ((data[k], data[k + L]), (data[k + 2 * L], data[k + 3 * L]))
    weights = (load_weights(data, i, 0), load_weights(data, i, 1), load_weights(data, i, 2))
    return u, gradient, weights, data[i + AREA * L]


@equation
def relative(x, i, x0):
    return (x[i] - x0[0], x[i + LANES] - x0[1], x[i + 2 * LANES] - x0[2])


@equation
def store3(f, i, v):
    f[i] = v[0]
    f[i + LANES] = v[1]
    f[i + 2 * LANES] = v[2]


@equation
def triangle_in_lane(i, x, data, law, thickness):
    """Replace the node positions of the patch at ``x[i + row*16]`` by the internal forces."""
    u, gradient, weights, area = load_patch(x, data, i)
    f1, f2, f3, f4, f5 = patch_forces(u, gradient, weights, area, law, thickness)
    L = LANES
    store3(x, i + 3 * L, f1)
    store3(x, i + 6 * L, f2)
    store3(x, i + 9 * L, f3)
    store3(x, i + 12 * L, f4)
    store3(x, i + 15 * L, f5)
    f0 = (
        -f1[0] - f2[0] - f3[0] - f4[0] - f5[0],
        -f1[1] - f2[1] - f3[1] - f4[1] - f5[1],
        -f1[2] - f2[2] - f3[2] - f4[2] - f5[2],
    )
    store3(x, i, f0)


@equation
def gather_patches(positions, nodes, x):
    for c in range(PATCH_NODES):
        for lane in range(LANES):
            node = nodes[c * LANES + lane]
            x[3 * c * LANES + lane] = positions[0, node]
            x[(3 * c + 1) * LANES + lane] = positions[1, node]
            x[(3 * c + 2) * LANES + lane] = positions[2, node]


@implements(internal_forces, MembraneShellData)
def membrane_shell_forces(body, positions, node_force, history):
    """Write the internal forces of all triangles of a body on the nodes of their patches.

    Parameters
    ----------
    body : :class:`MembraneShellData`. positions : (3, node_count) [m].
    node_force : (block_count * 18 * 16,) or longer [N], row ``3*node + component``, written.
    history : empty, no law with memory serves triangles yet.
    """
    patch_force_loop(
        positions, body.corner_node, body.element_data, node_force, body.law, body.thickness
    )


@kernel
def patch_force_loop(positions, patch_node, element_data, node_force, law, thickness):
    block_count = patch_node.size // (PATCH_NODES * LANES)
    for block in prange(block_count):
        nodes = patch_node[block * PATCH_NODES * LANES : (block + 1) * PATCH_NODES * LANES]
        x = node_force[block * FORCE_ROWS * LANES : (block + 1) * FORCE_ROWS * LANES]
        data = element_data[block * DATA_ROWS * LANES : (block + 1) * DATA_ROWS * LANES]
        gather_patches(positions, nodes, x)
        for lane in range(LANES):
            triangle_in_lane(lane, x, data, law, thickness)


@equation
def deformation(u, gradient, weights):
    """Return a1, a2, N and the rows h_11, h_22, 2 h_12."""
    u1, u2, u3, u4, u5 = u
    a1 = combination2(gradient[0][0], u1, gradient[1][0], u2)
    a2 = combination2(gradient[0][1], u1, gradient[1][1], u2)
    h = (
        second_derivative(weights[0], u1, u2, u3, u4, u5),
        second_derivative(weights[1], u1, u2, u3, u4, u5),
        second_derivative(weights[2], u1, u2, u3, u4, u5),
    )
    return a1, a2, cross(a1, a2), h


def membrane_shell_state(
    body: MembraneShellData,
    positions: np.ndarray,
    strain: np.ndarray,
    area_ratio: np.ndarray,
    bending_energy: np.ndarray,
) -> None:
    """Write strains, current over initial area, and the stored energy of bending.

    Parameters
    ----------
    body, positions : as for :func:`membrane_shell_forces`.
    strain : (block_count * 16, 6) Green-Lagrange, engineering shear, written; 33, 23, 13 are 0.
    area_ratio : (block_count * 16,), bending_energy : (block_count * 16,) [J], written.
    """
    patch_state_loop(
        positions,
        body.corner_node,
        body.element_data,
        body.law,
        body.thickness,
        strain,
        area_ratio,
        bending_energy,
    )


@kernel
def patch_state_loop(
    positions, patch_node, element_data, law, thickness, strain, area_ratio, bending_energy
):
    block_count = patch_node.size // (PATCH_NODES * LANES)
    for block in prange(block_count):
        nodes = patch_node[block * PATCH_NODES * LANES : (block + 1) * PATCH_NODES * LANES]
        data = element_data[block * DATA_ROWS * LANES : (block + 1) * DATA_ROWS * LANES]
        x = np.empty(FORCE_ROWS * LANES)
        gather_patches(positions, nodes, x)
        for lane in range(LANES):
            u, gradient, weights, area = load_patch(x, data, lane)
            a1, a2, N, h = deformation(u, gradient, weights)
            E11, E22, g12 = membrane_strain(a1, a2)
            squared = dot(N, N)
            k1, k2, k12 = dot(h[0], N), dot(h[1], N), dot(h[2], N)
            B = plane_bending_stiffness(law)
            bending = B[0] * k1 * k1 + B[1] * k2 * k2 + B[2] * k12 * k12
            element = block * LANES + lane
            strain[element, 0] = E11
            strain[element, 1] = E22
            strain[element, 2] = 0.0
            strain[element, 3] = g12
            strain[element, 4] = 0.0
            strain[element, 5] = 0.0
            area_ratio[element] = math.sqrt(squared)
            bending_energy[element] = area * thickness**3 / 24.0 * bending / squared


# --- frequency bound ------------------------------------------------------------------------------


@routine
def add_outer(D, node, factor, v):
    """Add factor v vᵀ to the symmetric matrix (11, 22, 33, 12, 23, 13) of a node."""
    D[0, node] += factor * v[0] * v[0]
    D[1, node] += factor * v[1] * v[1]
    D[2, node] += factor * v[2] * v[2]
    D[3, node] += factor * v[0] * v[1]
    D[4, node] += factor * v[1] * v[2]
    D[5, node] += factor * v[0] * v[2]


@routine
def add_multiple_of_identity(D, node, factor):
    D[0, node] += factor
    D[1, node] += factor
    D[2, node] += factor


@equation
def largest_eigenvalue(a, b, c, d, e, f):
    """Return that of the symmetric matrix with diagonal a, b, c and 12 = d, 23 = e, 13 = f."""
    mean = (a + b + c) / 3.0
    a, b, c = a - mean, b - mean, c - mean
    deviation = math.sqrt((a * a + b * b + c * c + 2.0 * (d * d + e * e + f * f)) / 6.0)
    if deviation == 0.0:
        return mean
    determinant = a * (b * c - e * e) - d * (d * c - e * f) + f * (d * e - b * f)
    cosine = min(1.0, max(-1.0, 0.5 * determinant / deviation**3))
    return mean + 2.0 * deviation * math.cos(math.acos(cosine) / 3.0)


@equation
def corner_gradients(gradient):
    """Return the derivatives of the corners' shape functions along fibre 1 and fibre 2."""
    g1 = (-gradient[0][0] - gradient[1][0], gradient[0][0], gradient[1][0])
    g2 = (-gradient[0][1] - gradient[1][1], gradient[0][1], gradient[1][1])
    return g1, g2


@routine
def add_membrane_terms(membrane, nodes, node_weight, g1, g2, a1, a2, law, volume):
    """Add a triangle's fibre and shear strains to D of its corners.

    See :func:`nodal_frequency_bounds`. ``g1``, ``g2`` : of :func:`corner_gradients` [1/m];
    ``volume`` : of the triangle [m³].
    """
    E11, E22, g12 = membrane_strain(a1, a2)
    (S11, S22, S12), (C11, C22, C12) = plane_response(law, E11, E22, g12)
    sum1, sum2, sum12 = 0.0, 0.0, 0.0
    for c in range(CORNERS):
        sum1 += abs(g1[c]) * node_weight[nodes[c]]
        sum2 += abs(g2[c]) * node_weight[nodes[c]]
        b = combination2(g1[c], a2, g2[c], a1)
        sum12 += math.sqrt(dot(b, b))
    tension1 = volume * (max(S11, 0.0) + abs(S12))
    tension2 = volume * (max(S22, 0.0) + abs(S12))
    for c in range(CORNERS):
        node = nodes[c]
        w = node_weight[node]
        add_outer(membrane, node, volume * C11 * sum1 * abs(g1[c]) / w, a1)
        add_outer(membrane, node, volume * C22 * sum2 * abs(g2[c]) / w, a2)
        b = combination2(g1[c], a2, g2[c], a1)
        length = math.sqrt(dot(b, b))
        if length > 0.0:
            add_outer(membrane, node, volume * max(C12, 0.0) * sum12 / length, b)
        geometric = tension1 * sum1 * abs(g1[c]) + tension2 * sum2 * abs(g2[c])
        add_multiple_of_identity(membrane, node, geometric / w)


@routine
def nodal_frequency_bounds(
    body, positions, mass, node_weight, membrane, bending, omega2, controlling_part
):
    """Write for every node the share of an upper bound of the sheet's highest frequency.

    The second variation of the energy is a sum of terms c (Σ_i b_i·δx_i)². By Cauchy's inequality
    each is at most c (Σ_j w_j|b_j|) Σ_i (b_i·δx_i)²/(w_i|b_i|) with any positive w, which couples
    no nodes any more: it adds a 3x3 matrix D_i to each node, and ω² <= max_i λ_max(D_i)/m_i for the
    whole sheet. Fibres in two directions add to D_i in two directions. With equal masses the bound
    of a mesh with legs of length l along the fibres is 2 c/l, exactly that of the fibre wave of the
    solid-shell.

    Terms: fibre, shear and bending strains by their tangents; the geometric stiffness of tension
    and of shear; and of the moments, whose curvatures have the second variation
    δ²κ = 2 δn·δ'h - κ |δn|², δ'h = Σ_k (d_k - Γ·g_k) δx_k, the last of which only softens.

    Parameters
    ----------
    body, positions : as for :func:`membrane_shell_forces`; mass : (node_count,) [kg].
    node_weight : (node_count,) w of the fibre strains, see :mod:`lcmchain.mesh.cells`.
    membrane, bending : (6, node_count), scratch: D of the two parts.
    omega2 : (node_count,) [1/s²], written. controlling_part : (node_count,) int64, written: 0 where
        the membrane has the larger share, 1 where bending has it.
    """
    membrane[:] = 0.0
    bending[:] = 0.0
    weight = np.empty((CORNERS + 3, 3))
    patch_node, element_data = body.corner_node, body.element_data
    law, thickness = body.law, body.thickness
    stiffnesses = plane_bending_stiffness(law)
    for element in range(body.element_count):
        block, lane = divmod(element, LANES)
        nodes = patch_node[block * PATCH_NODES * LANES + lane :: LANES][:PATCH_NODES]
        data = element_data[block * DATA_ROWS * LANES : (block + 1) * DATA_ROWS * LANES]
        x = np.empty(FORCE_ROWS * LANES)
        for c in range(PATCH_NODES):
            for d in range(3):
                x[(3 * c + d) * LANES + lane] = positions[d, nodes[c]]
        u, gradient, weights, area = load_patch(x, data, lane)
        a1, a2, N, h = deformation(u, gradient, weights)
        volume = area * thickness
        g1, g2 = corner_gradients(gradient)
        add_membrane_terms(membrane, nodes, node_weight, g1, g2, a1, a2, law, volume)

        squared = dot(N, N)
        inverse = 1.0 / math.sqrt(squared)
        n = (inverse * N[0], inverse * N[1], inverse * N[2])
        dual1, dual2 = cross(a2, N), cross(N, a1)
        slope = 0.0  # Σ |spatial gradient of the shape functions|
        gradients = np.empty(CORNERS)
        for c in range(CORNERS):
            s = combination2(g1[c] / squared, dual1, g2[c] / squared, dual2)
            gradients[c] = math.sqrt(dot(s, s))
            slope += gradients[c]
        for row, B in enumerate(stiffnesses):
            D = volume * thickness * thickness / 12.0 * B
            G1, G2 = dot(h[row], dual1) / squared, dot(h[row], dual2) / squared
            total, first = 0.0, 0.0
            for k in range(1, PATCH_NODES):
                e = weights[row][k - 1]
                first -= e
                if k < CORNERS:
                    e -= G1 * g1[k] + G2 * g2[k]
                weight[k, row] = e
                total += abs(e)
            weight[0, row] = first - G1 * g1[0] - G2 * g2[0]
            total += abs(weight[0, row])
            moment = abs(D * dot(h[row], n))
            for k in range(PATCH_NODES):
                e = abs(weight[k, row])
                add_outer(bending, nodes[k], D * total * e, n)
                geometric = moment * slope * e
                if k < CORNERS:
                    geometric += moment * total * gradients[k]
                add_multiple_of_identity(bending, nodes[k], geometric)

    for node in range(mass.size):
        M, B = membrane[:, node], bending[:, node]
        omega2[node] = (
            largest_eigenvalue(
                M[0] + B[0], M[1] + B[1], M[2] + B[2], M[3] + B[3], M[4] + B[4], M[5] + B[5]
            )
            / mass[node]
        )
        trace = B[0] + B[1] + B[2]
        controlling_part[node] = 1 if trace > M[0] + M[1] + M[2] else 0
