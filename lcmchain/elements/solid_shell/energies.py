"""What the solver asks about the elements between steps: thickness, inversion, stored energy."""

from __future__ import annotations

import math

import numpy as np
from numba import prange

from lcmchain.elements.solid_shell.equations import (
    condensed_enhanced_strain,
    diagonal_product,
    scaled6,
    sum6,
)
from lcmchain.elements.solid_shell.kernel import (
    LANES,
    element_stress,
    load_component,
    mode_vectors,
    replace33,
)
from lcmchain.elements.vectors import cross, dot
from lcmchain.jit import equation, kernel
from lcmchain.materials.fabric import (
    bending_stiffness,
    hourglass_stiffness,
    membrane_stress_and_tangent,
)
from lcmchain.materials.st_venant_kirchhoff import bending_rows, membrane_rows, stress


@equation
def product6(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3] + a[4] * b[4] + a[5] * b[5]


@kernel
def thickness_stretches(position, corner_node, reference_height, stretch):
    """Write a3·n over its reference value for every element; zero or less is inverted.

    Parameters
    ----------
    position : (3, node_count) [m]; corner_node : as for ``internal_forces``.
    reference_height : (block_count * 16,) [m]; stretch : (block_count * 16,), written.
    """
    for block in prange(corner_node.size // (8 * LANES)):
        nodes = corner_node[block * 8 * LANES : (block + 1) * 8 * LANES]
        corner = np.empty(24 * LANES)
        gather(position, nodes, corner)
        for lane in range(LANES):
            a = mode_vectors(
                load_component(corner, lane),
                load_component(corner, lane + LANES),
                load_component(corner, lane + 2 * LANES),
            )
            c = cross(a[0], a[1])
            element = block * LANES + lane
            stretch[element] = dot(a[2], c) / (math.sqrt(dot(c, c)) * reference_height[element])


@equation
def gather(position, nodes, corner):
    for c in range(8):
        for lane in range(LANES):
            for d in range(3):
                corner[(3 * c + d) * LANES + lane] = position[d, nodes[c * LANES + lane]]


@kernel
def strain_energies(
    positions,
    corner_node,
    element_data,
    fabric,
    stiffness,
    flat,
    curved,
    director,
    conservative,
    enhanced,
    moments,
    in_plane_shear,
    centre_strain,
    bending_energy,
    hourglass_energy,
):
    """Write the centre strain and the stored energies of bending and hourglass terms.

    Parameters
    ----------
    positions ... in_plane_shear : as for ``internal_forces``.
    centre_strain : (block_count * 16, 6), written; see the material's ``membrane_energy``.
    bending_energy, hourglass_energy : (block_count * 16,) [J], written. The cross terms of E^0 and
        E^ζζ, and the enhanced strain, have a potential only where C^M and C^B are proportional (or
        diagonal, for the latter); their symmetric part is counted.
    """
    block_count = corner_node.size // (8 * LANES)
    rows = element_data.size // (block_count * LANES)
    for block in prange(block_count):
        nodes = corner_node[block * 8 * LANES : (block + 1) * 8 * LANES]
        data = element_data[block * rows * LANES : (block + 1) * rows * LANES]
        corner = np.empty(24 * LANES)
        gather(positions, nodes, corner)
        for lane in range(LANES):
            a = mode_vectors(
                load_component(corner, lane),
                load_component(corner, lane + LANES),
                load_component(corner, lane + 2 * LANES),
            )
            _, E, _, _, volume, _ = element_stress(
                a,
                data,
                lane,
                fabric,
                stiffness,
                flat,
                curved,
                director,
                conservative,
                enhanced,
                moments,
                in_plane_shear,
            )
            if fabric is not None:
                S, C_M = membrane_stress_and_tangent(fabric, E.centre)
                C_B = bending_stiffness(fabric)
                C_hg = hourglass_stiffness(fabric, C_M)
                S_zeta = diagonal_product(C_B, E.zeta)
                if enhanced is not None:
                    S_zeta = replace33(S_zeta, 0.0)
                S_zeta2 = diagonal_product(C_B, E.zeta2)
                S_cross = diagonal_product(C_B, E.centre)
                xi = product6(E.xi, diagonal_product(C_hg, E.xi))
                eta = product6(E.eta, diagonal_product(C_hg, E.eta))
                eta_zeta = product6(E.eta_zeta, diagonal_product(C_B, E.eta_zeta))
                xi_zeta = product6(E.xi_zeta, diagonal_product(C_B, E.xi_zeta))
            if stiffness is not None:
                M, B = membrane_rows(stiffness), bending_rows(stiffness)
                S = stress(M, E.centre)
                S_zeta = stress(B, E.zeta)
                if enhanced is not None:
                    enhanced33 = condensed_enhanced_strain(S_zeta[2], M[2][2])
                    S_zeta = sum6(S_zeta, scaled6(enhanced33, M[2]))
                S_zeta2 = stress(B, E.zeta2)
                S_cross = stress(B, E.centre)
                xi = product6(E.xi, stress(M, E.xi))
                eta = product6(E.eta, stress(M, E.eta))
                eta_zeta = product6(E.eta_zeta, stress(B, E.eta_zeta))
                xi_zeta = product6(E.xi_zeta, stress(B, E.xi_zeta))
            bending = moments.zeta2 * product6(S_zeta, E.zeta)
            bending += moments.zeta4 * product6(S_zeta2, E.zeta2)
            bending += moments.cross * (product6(S, E.zeta2) + product6(S_cross, E.zeta2))
            element = block * LANES + lane
            for i in range(6):
                centre_strain[element, i] = E.centre[i]
            bending_energy[element] = 0.5 * volume * bending
            hourglass_energy[element] = (
                0.5 * volume * ((xi + eta) / 3.0 + (eta_zeta + xi_zeta) / 9.0)
            )
