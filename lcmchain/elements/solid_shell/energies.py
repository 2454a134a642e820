"""What the solver asks about the elements between steps: their stretches and stored energy."""

from __future__ import annotations

import math

import numpy as np
from numba import prange

from lcmchain.elements.blocks import LANES
from lcmchain.elements.solid_shell.equations import curvature_compaction
from lcmchain.elements.solid_shell.kernel import (
    SolidShellData,
    constants_of_block,
    curvature_rows,
    element_stress,
    full_history,
    load_component,
    load_corners,
    load_curvature,
    mode_vectors,
    stresses,
)
from lcmchain.elements.vectors import cross, dot
from lcmchain.jit import equation, kernel
from lcmchain.materials.law import (
    bending_excess,
    load_history,
    stored_bending,
    with_bending_losses,
)
from lcmchain.materials.stiffness import product

ZERO = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


@equation
def product6(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3] + a[4] * b[4] + a[5] * b[5]


@kernel
def centre_stretches(
    position,
    corner_node,
    corner_run,
    reference_height,
    reference_area,
    history,
    options,
    thickness_stretch,
    area_stretch,
):
    """Write thickness and mid-surface area of every element over their reference values.

    The thickness is a3·n with the shared curvature; zero or less is that of an inverted element.

    Parameters
    ----------
    position : (3, node_count) [m]; corner_node, corner_run : as for ``internal_forces``.
    reference_height, reference_area : (block_count * 16,) [m, m²].
    history, options : of the body.
    thickness_stretch, area_stretch : (block_count * 16,), written.
    """
    block_count = corner_node.size // (8 * LANES)
    history_size = history.size // block_count
    for block in prange(block_count):
        shared = history[block * history_size : (block + 1) * history_size]
        corner = np.empty(24 * LANES)
        load_corners(position, corner_node, corner_run, block, corner)
        own = slice(block * LANES, (block + 1) * LANES)
        height, area_before = reference_height[own], reference_area[own]
        thickness, area_ratio = thickness_stretch[own], area_stretch[own]
        for lane in range(LANES):
            a = mode_vectors(
                load_component(corner, lane),
                load_component(corner, lane + LANES),
                load_component(corner, lane + 2 * LANES),
            )
            c = cross(a[0], a[1])
            area = math.sqrt(dot(c, c))
            stretch = dot(a[2], c) / (area * height[lane])
            curvature = load_curvature(options.director, shared, lane)
            zeta = (dot(a[0], a[5]), dot(a[1], a[4]), dot(a[0], a[4]) + dot(a[1], a[5]))
            squared = stretch * stretch + 2.0 * curvature_compaction(curvature, zeta)
            upright = (stretch > 0.0) & (squared > 0.0)
            thickness[lane] = math.sqrt(squared) if upright else stretch
            area_ratio[lane] = area / area_before[lane]


def strain_energies(
    body: SolidShellData,
    positions: np.ndarray,
    history: np.ndarray,
    centre_strain: np.ndarray,
    bending_energy: np.ndarray,
    hourglass_energy: np.ndarray,
) -> None:
    """Write the centre strain and the stored energies of bending and hourglass terms.

    Parameters
    ----------
    body, positions, history : as for :func:`lcmchain.elements.solid_shell.kernel.internal_forces`;
        the history is that of the end of a step to these positions.
    centre_strain : (block_count * 16, 6), written; see the material's ``membrane_energy``.
    bending_energy, hourglass_energy : (block_count * 16,) [J], written. The cross terms of E^0 and
        E^ζζ, and the enhanced strain, have a potential only where C^M and C^B are proportional (or
        diagonal, for the latter); their symmetric part is counted.
    """
    element_energies(
        np.ascontiguousarray(positions),
        body.corner_node,
        body.corner_run,
        body.element_data,
        full_history(body.options.director, body.corner_node, history),
        body.law,
        body.options,
        centre_strain,
        bending_energy,
        hourglass_energy,
    )


@kernel
def element_energies(
    positions,
    corner_node,
    corner_run,
    element_data,
    history,
    law,
    options,
    centre_strain,
    bending_energy,
    hourglass_energy,
):
    block_count = corner_node.size // (8 * LANES)
    history_size = history.size // block_count
    curvature_size = curvature_rows(options.director) * LANES
    for block in prange(block_count):
        data = constants_of_block(options, element_data, block)
        own = history[block * history_size : (block + 1) * history_size]
        shared, past = own[:curvature_size], own[curvature_size:]
        corner = np.empty(24 * LANES)
        load_corners(positions, corner_node, corner_run, block, corner)
        for lane in range(LANES):
            a = mode_vectors(
                load_component(corner, lane),
                load_component(corner, lane + LANES),
                load_component(corner, lane + 2 * LANES),
            )
            lane_history = load_history(law, past, lane, LANES)
            curvature = load_curvature(options.director, shared, lane)
            _, E, _, _, volume, inverse_height = element_stress(
                a, data, lane, law, lane_history, curvature, options
            )
            S = stresses(law, lane_history, options, options.enhanced, inverse_height, E)
            bending = product6(S.zeta, E.zeta) + bending_excess(law, E.zeta, inverse_height)
            lost = with_bending_losses(law, ZERO, E.zeta, inverse_height, lane_history)
            stored = stored_bending(law, lane_history) / (inverse_height * inverse_height)
            bending += stored - product6(lost, E.zeta)
            bending *= options.zeta2
            bending += options.zeta4 * product6(S.zeta2, E.zeta2)
            S_cross = product(S.C_B, E.centre)
            bending += options.cross * (product6(S.centre, E.zeta2) + product6(S_cross, E.zeta2))
            warping = product6(E.xi, S.xi) + product6(E.eta, S.eta)
            twisting = product6(E.eta_zeta, S.eta_zeta) + product6(E.xi_zeta, S.xi_zeta)
            element = block * LANES + lane
            for i in range(6):
                centre_strain[element, i] = E.centre[i]
            bending_energy[element] = 0.5 * volume * bending
            hourglass_energy[element] = 0.5 * volume * (warping / 3.0 + twisting / 9.0)
