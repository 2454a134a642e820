"""Upper bound of an element's highest frequency, from its present tangent and stress.

In the space of the mode vectors the element stiffness is K = Σ_i d_i b_i b_iᵀ + Σ ⊗ 1: one row b_i
for every strain component of every Taylor term (Eq. 10), d_i the tangent times the weight of
Eqs. (15) and (16), Σ the generalised stresses of ``stress_matrix``. With nodal masses m/8 the
highest circular frequency obeys ω² = λ_max(K)/m, and the block form of Gershgorin's theorem bounds
λ_max by the largest row sum Σ_l ‖K_kl‖ over the seven modes. For a fibre-aligned rectangle of a
fabric with stiff fibres the bound is exact up to the small moduli (0.1 % for MD600). Coupled
stiffnesses are first replaced by a diagonal that dominates them, and the enhanced strain, which
only softens, is left out.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit, prange

from lcmchain.elements.kernel import LANES, element_stress, load_component, mode_vectors
from lcmchain.elements.packing import COVARIANT_PRODUCTS, TERMS
from lcmchain.elements.vectors import cross, dot
from lcmchain.jit import FLOATING_POINT, equation, kernel
from lcmchain.materials.fabric import (
    bending_stiffness,
    compaction_tangent_curvature,
    compaction_tangent_slope,
    membrane_stress_and_tangent,
    shear_tangent_curvature,
    shear_tangent_slope,
)
from lcmchain.materials.st_venant_kirchhoff import bending_rows, membrane_rows

IN_PLANE_MODES = (0, 1, 3)
ZERO = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)

_ENTRIES = [
    (TERMS.index(term), component, k - 1, m - 1, factor)
    for term, component, products in COVARIANT_PRODUCTS
    for factor, k, m in products
]
PRODUCT_INDEX = np.array([entry[:4] for entry in _ENTRIES], dtype=np.int64)
PRODUCT_FACTOR = np.array([entry[4] for entry in _ENTRIES])


@equation
def tangent_derivatives(law, E):
    """Return first and second derivative of the diagonal tangent C^M of a fabric."""
    slope33, slope12 = compaction_tangent_slope(law, E[2]), shear_tangent_slope(law, E[3])
    slope = (0.0, 0.0, slope33, slope12, 0.0, 0.0)
    curvature = (
        0.0,
        0.0,
        compaction_tangent_curvature(law, E[2]),
        shear_tangent_curvature(law, E[3]),
        0.0,
        0.0,
    )
    return slope, curvature


@equation
def dominating_diagonal(C):
    """Return D with D - C positive semidefinite: C_ii Σ_j |C_ij| / sqrt(C_ii C_jj)."""
    return (
        dominating_entry(C, 0),
        dominating_entry(C, 1),
        dominating_entry(C, 2),
        dominating_entry(C, 3),
        dominating_entry(C, 4),
        dominating_entry(C, 5),
    )


@equation
def dominating_entry(C, i):
    total = 0.0
    for j in range(6):
        total += abs(C[i][j]) / math.sqrt(C[j][j])
    return total * math.sqrt(C[i][i])


@njit(error_model="numpy", fastmath=FLOATING_POINT, cache=True)
def covariant_gradients(a, in_plane_shear, rows):
    """Fill ``rows`` (7 terms, 6 components, 21) with the gradients of the covariant strains."""
    rows[:] = 0.0
    for n in range(PRODUCT_FACTOR.size):
        t, c, k, m = PRODUCT_INDEX[n]
        f = PRODUCT_FACTOR[n]
        if c == 3 and (t == 3 or t == 4):
            f *= in_plane_shear
        for d in range(3):
            rows[t, c, 3 * k + d] += f * a[m, d]
            rows[t, c, 3 * m + d] += f * a[k, d]


@njit(error_model="numpy", fastmath=FLOATING_POINT, cache=True)
def add_transformed(T, source, target):
    """Add T (6, 6) times the rows ``source`` (6, 21) to ``target`` (6, 21)."""
    for i in range(6):
        for j in range(6):
            if T[i, j] != 0.0:
                for k in range(21):
                    target[i, k] += T[i, j] * source[j, k]


@njit(error_model="numpy", fastmath=FLOATING_POINT, cache=True)
def mode_norms(row, norms):
    """Fill ``norms`` (7,) with the lengths of the parts of a row that belong to the modes."""
    total = 0.0
    for k in range(7):
        x, y, z = row[3 * k], row[3 * k + 1], row[3 * k + 2]
        squared = x * x + y * y + z * z
        norms[k] = math.sqrt(squared) if squared > 0.0 else 0.0
        total += norms[k]
    return total


@njit(error_model="numpy", fastmath=FLOATING_POINT, cache=True)
def material_row_sums(rows, C_M, C_B, moments, slope, curvature, E, sums):
    """Add the row sums of the material stiffness Σ d b bᵀ to ``sums`` (7,).

    ``slope`` and ``curvature`` are the derivatives of the tangent C^M in the conservative hourglass
    energy (1/6) E^ξ:C(E⁰):E^ξ; they stiffen E⁰ and couple it with E^ξ and E^η.
    """
    norms, other = np.empty(7), np.empty(7)
    for i in range(6):
        xi, eta = abs(E.xi[i]), abs(E.eta[i])
        centre = C_M[i] + abs(curvature[i]) * (xi * xi + eta * eta) / 6.0
        add_row(rows[0, i], centre, sums, norms)
        add_row(rows[1, i], moments.zeta2 * C_B[i], sums, norms)
        add_row(rows[2, i], moments.zeta4 * C_B[i], sums, norms)
        add_row(rows[3, i], C_M[i] / 3.0, sums, norms)
        add_row(rows[4, i], C_M[i] / 3.0, sums, norms)
        add_row(rows[5, i], C_B[i] / 9.0, sums, norms)
        add_row(rows[6, i], C_B[i] / 9.0, sums, norms)
        # cross terms of B^0 and B^ζζ: not symmetric, their symmetric part counts
        cross = 0.5 * moments.cross * (C_M[i] + C_B[i])
        add_pair(rows[0, i], rows[2, i], cross, sums, norms, other)
        if slope[i] != 0.0:
            add_pair(rows[0, i], rows[3, i], abs(slope[i]) * xi / 3.0, sums, norms, other)
            add_pair(rows[0, i], rows[4, i], abs(slope[i]) * eta / 3.0, sums, norms, other)


@njit(error_model="numpy", fastmath=FLOATING_POINT, cache=True)
def add_row(row, d, sums, norms):
    """Add the row sums of d b bᵀ."""
    total = mode_norms(row, norms)
    for k in range(7):
        sums[k] += d * norms[k] * total


@njit(error_model="numpy", fastmath=FLOATING_POINT, cache=True)
def add_pair(row, other_row, d, sums, norms, other):
    """Add the row sums of d (b cᵀ + c bᵀ)."""
    if d == 0.0:
        return
    total = mode_norms(row, norms)
    other_total = mode_norms(other_row, other)
    for k in range(7):
        sums[k] += d * (norms[k] * other_total + other[k] * total)


@equation
def stress_row_sums(sigma):
    """Return the row sums of |Σ_kl|: the bound of the geometric stiffness Σ ⊗ 1."""
    s1, s2, s3, s4, s5, s6, s77 = sigma
    s11, s12, s13, s14, s15, s16, s17 = s1
    s22, s23, s24, s25, s26, s27 = s2
    s33, s34, s35, s36, s37 = s3
    s45, s46 = s4
    s55, s56, s57 = s5
    s66, s67 = s6
    return (
        # a compressive diagonal entry lowers the frequency
        max(s11, 0.0) + abs(s12) + abs(s13) + abs(s14) + abs(s15) + abs(s16) + abs(s17),
        abs(s12) + max(s22, 0.0) + abs(s23) + abs(s24) + abs(s25) + abs(s26) + abs(s27),
        abs(s13) + abs(s23) + max(s33, 0.0) + abs(s34) + abs(s35) + abs(s36) + abs(s37),
        abs(s14) + abs(s24) + abs(s34) + abs(s45) + abs(s46),
        abs(s15) + abs(s25) + abs(s35) + abs(s45) + max(s55, 0.0) + abs(s56) + abs(s57),
        abs(s16) + abs(s26) + abs(s36) + abs(s46) + abs(s56) + max(s66, 0.0) + abs(s67),
        abs(s17) + abs(s27) + abs(s37) + abs(s57) + abs(s67) + max(s77, 0.0),
    )


@njit(error_model="numpy", fastmath=FLOATING_POINT, cache=True)
def normal_compaction_row_sums(a1, a2, a3, gradients, S33, inverse_height, row, sums):
    """Set the row of E33 by the normal thickness t = a3·n, and add its geometric stiffness.

    The second variation of ½t² is (δt)² + t δ²t with δ²t = -2 (n·δa_α)(a^α·δa3) + 2 (n·δa_α)
    (a^α·δa_β)(a^β·a3) - t |δn|² over the dual base a^α of the mid-surface; the bound takes every
    product by its length.
    """
    row[:] = 0.0
    for k in range(3):
        for d in range(3):
            row[3 * k + d] = gradients[k][d]
    c = cross(a1, a2)
    area = math.sqrt(dot(c, c))
    t = abs(dot(a3, c)) / area
    dual1, dual2 = math.sqrt(dot(a2, a2)) / area, math.sqrt(dot(a1, a1)) / area
    tilt = math.sqrt(max(dot(a3, a3) - t * t, 0.0))
    w = abs(S33) * inverse_height * inverse_height * t
    in_plane = (t + 2.0 * tilt) * (dual1 + dual2)
    sums[0] += w * dual1 * (1.0 + in_plane)
    sums[1] += w * dual2 * (1.0 + in_plane)
    sums[2] += w * (dual1 + dual2)
    if S33 > 0.0:
        add_row(row, S33 / (t * inverse_height) ** 2, sums, np.empty(7))


@kernel
def frequency_bounds(
    positions,
    corner_node,
    element_data,
    transformation,
    transformation_change,
    density,
    fabric,
    stiffness,
    flat,
    curved,
    director,
    conservative,
    enhanced,
    moments,
    in_plane_shear,
    omega2,
    controlling_mode,
):
    """Write the bound of ω² [1/s²] of every element, and the mode (0 ... 6) whose row sum it is.

    Parameters
    ----------
    positions ... in_plane_shear : as for ``internal_forces``.
    transformation : (block_count * 16, 6, 6) T⁰; transformation_change : (..., 3, 6, 6) T^ξ, T^η,
        T^ζ, read only for curved references.
    density : [kg/m³]; nodal masses are one eighth of the element's.
    """
    block_count = corner_node.size // (8 * LANES)
    rows = element_data.size // (block_count * LANES)
    for block in prange(block_count):
        nodes = corner_node[block * 8 * LANES : (block + 1) * 8 * LANES]
        data = element_data[block * rows * LANES : (block + 1) * rows * LANES]
        corner = np.empty(24 * LANES)
        a_array = np.empty((7, 3))
        covariant = np.empty((7, 6, 21))
        material = np.empty((7, 6, 21))
        sums = np.empty(7)
        for c in range(8):
            for lane in range(LANES):
                for d in range(3):
                    corner[(3 * c + d) * LANES + lane] = positions[d, nodes[c * LANES + lane]]
        for lane in range(LANES):
            mx = load_component(corner, lane)
            my = load_component(corner, lane + LANES)
            mz = load_component(corner, lane + 2 * LANES)
            a = mode_vectors(mx, my, mz)
            for k in range(7):
                a_array[k, 0], a_array[k, 1], a_array[k, 2] = mx[k], my[k], mz[k]
            sigma, E, S33, normal, _, inverse_height = element_stress(
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
                C_M = membrane_stress_and_tangent(fabric, E.centre)[1]
                C_B = bending_stiffness(fabric)
                slope, curvature = ZERO, ZERO
                if conservative is not None:
                    slope, curvature = tangent_derivatives(fabric, E.centre)
            if stiffness is not None:
                slope, curvature = ZERO, ZERO
                C_M = dominating_diagonal(membrane_rows(stiffness))
                C_B = dominating_diagonal(bending_rows(stiffness))

            element = block * LANES + lane
            covariant_gradients(a_array, in_plane_shear, covariant)
            material[:] = 0.0
            for t in range(7):
                add_transformed(transformation[element], covariant[t], material[t])
            if curved is not None:
                T_xi = transformation_change[element, 0]
                T_eta = transformation_change[element, 1]
                T_zeta = transformation_change[element, 2]
                add_transformed(T_zeta, covariant[0], material[1])
                add_transformed(T_zeta, covariant[1], material[2])
                add_transformed(T_xi, covariant[0], material[3])
                add_transformed(T_eta, covariant[0], material[4])
                add_transformed(T_eta, covariant[1], material[5])
                add_transformed(T_zeta, covariant[4], material[5])
                add_transformed(T_xi, covariant[1], material[6])
                add_transformed(T_zeta, covariant[3], material[6])

            geometric = stress_row_sums(sigma)
            for k in range(7):
                sums[k] = geometric[k]
            if director is None:
                normal_compaction_row_sums(
                    a[0], a[1], a[2], normal[1:], S33, inverse_height, material[0, 2], sums
                )
            material_row_sums(material, C_M, C_B, moments, slope, curvature, E, sums)
            mode = np.argmax(sums)
            omega2[element] = sums[mode] / density
            controlling_mode[element] = mode
