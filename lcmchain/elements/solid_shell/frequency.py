"""Upper bound of an element's highest frequency, from its present tangent and stress.

In the space of the mode vectors the element stiffness is K = Σ_t B_tᵀ C_t B_t + Σ ⊗ 1: six rows B_t
for every Taylor term (Eq. 10), C_t the tangent times the weight of Eqs. (15) and (16), Σ the
generalised stresses of ``stress_matrix``. With nodal masses m/8 the highest circular frequency
obeys ω² = |λ|_max(K)/m, and λ is bounded by the spectral radius of the 7x7 matrix of the norms of
the blocks K_kl (Ostrowski's block form of the theorem of Perron and Frobenius), which in turn is
bounded by max_k (N d)_k/d_k for any positive d. For a fibre-aligned rectangle of a fabric with
stiff fibres the bound is exact up to the small moduli (0.1 % for MD600). No symmetry is needed: the
cross terms of Eqs. (15) and (19) have none.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import prange

from lcmchain.elements.blocks import LANES
from lcmchain.elements.solid_shell.bending import inverse_stretch
from lcmchain.elements.solid_shell.equations import stress_matrix
from lcmchain.elements.solid_shell.geometry import COVARIANT_PRODUCTS, TERMS
from lcmchain.elements.solid_shell.kernel import (
    SolidShellData,
    constants_of_block,
    curvature_rows,
    element_stress,
    full_history,
    hourglass_stiffness,
    load_component,
    load_curvature,
    mode_vectors,
    stabilising_tangent,
    stresses,
)
from lcmchain.elements.vectors import cross, dot
from lcmchain.jit import equation, kernel, routine
from lcmchain.materials.law import (
    bending_bound,
    bending_viscosity,
    load_history,
    membrane_response,
    tangent_coupling,
    tangent_curvature,
    tangent_slope,
    viscosity,
)
from lcmchain.materials.stiffness import by_structure, orthotropic_rows, read_by
from lcmchain.mesh.hexahedron import MODES


class Parts(NamedTuple):
    """Scratch for the parts of a row that belong to the modes, of two rows.

    length : (2, 7) of the parts. mode : (2, 7) int64, the modes that the row has a part of; most
    rows have one of few.
    """

    length: np.ndarray
    mode: np.ndarray


class NodalShares(NamedTuple):
    """Bounds of the stiffness of elements of a diagonal law by 3x3 matrices of their corners.

    weight : (block_count * 16, 8) positive numbers d of the corners.
    is_triangle : (block_count * 16,) whether corners 2 and 3, and 6 and 7, are one.
    stiffness : (block_count * 16, 8, 6), written: 11, 22, 33, 12, 23, 13 over the volume [Pa/m²].
    """

    weight: np.ndarray
    is_triangle: np.ndarray
    stiffness: np.ndarray


IN_PLANE_MODES = (0, 1, 3)
ZERO = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
# Six sweeps bring the bound within some per cent of the spectral radius of the block norms.
POWER_ITERATIONS = 6
SMALLEST_WEIGHT = 1e-6

_ENTRIES = [
    (TERMS.index(term), component, k - 1, m - 1, factor)
    for term, component, products in COVARIANT_PRODUCTS
    for factor, k, m in products
]
PRODUCT_INDEX = np.array([entry[:4] for entry in _ENTRIES], dtype=np.int64)
PRODUCT_FACTOR = np.array([entry[4] for entry in _ENTRIES])


@equation
def value_or_zero(x):
    if x is None:
        return 0.0
    return x


@equation
def values_or_zero(x):
    return (
        value_or_zero(x[0]),
        value_or_zero(x[1]),
        value_or_zero(x[2]),
        value_or_zero(x[3]),
        value_or_zero(x[4]),
        value_or_zero(x[5]),
    )


@equation
def with_fibre_share(f, x):
    return (f * x[0], f * x[1], x[2], x[3], x[4], x[5])


@routine
def covariant_gradients(a, rows):
    """Fill ``rows`` (7 terms, 6 components, 21) with the gradients of the covariant strains."""
    rows[:] = 0.0
    for n in range(PRODUCT_FACTOR.size):
        t, c, k, m = PRODUCT_INDEX[n]
        f = PRODUCT_FACTOR[n]
        for d in range(3):
            rows[t, c, 3 * k + d] += f * a[m, d]
            rows[t, c, 3 * m + d] += f * a[k, d]


@routine
def add_transformed(T, source, target):
    """Add T (6, 6) times the rows ``source`` (6, 21) to ``target`` (6, 21)."""
    for i in range(6):
        for j in range(6):
            if T[i, j] != 0.0:
                for k in range(21):
                    target[i, k] += T[i, j] * source[j, k]


@routine
def scale_in_plane_shear(T, read, factor, rows):
    """Weight the in-plane shear of ``rows`` (6, 21) in the covariant axes of T, as the kernel.

    read : the row of the inverse of T that gives that shear (6,).
    """
    for k in range(21):
        shear = 0.0
        for i in range(6):
            shear += read[i] * rows[i, k]
        for i in range(6):
            rows[i, k] += (factor - 1.0) * shear * T[i, 3]


@routine
def find_parts(row, length, mode):
    """Fill a row of each of ``Parts``; return how many modes the row (21,) has a part of."""
    count = 0
    for k in range(7):
        x, y, z = row[3 * k], row[3 * k + 1], row[3 * k + 2]
        squared = x * x + y * y + z * z
        length[k] = 0.0
        if squared > 0.0:
            length[k] = math.sqrt(squared)
            mode[count] = k
            count += 1
    return count


@routine
def add_diagonal_stiffness(
    C_M, C_B, rows, law, history, options, conservative, enhanced, E, norms, parts
):
    """Add bounds of the blocks of Σ d b bᵀ, for diagonal stiffnesses, to ``norms``.

    The derivatives of the tangent C^M in the conservative hourglass energy (1/6) E^ξ:C(E⁰):E^ξ
    stiffen E⁰ and couple it with E^ξ and E^η.
    """
    slope, curvature = ZERO, ZERO
    if conservative is not None:
        slope = values_or_zero(tangent_slope(law, E.centre, history))
        curvature = values_or_zero(tangent_curvature(law, E.centre, history))
        slope = with_fibre_share(options.fibre_share, slope)
        curvature = with_fibre_share(options.fibre_share, curvature)
    C_hg = stabilising_tangent(conservative, law, E.centre, C_M, history)
    C_hg = hourglass_stiffness(C_hg, options.fibre_share)
    for i in range(6):
        xi, eta = abs(E.xi[i]), abs(E.eta[i])
        centre = C_M[i] + abs(curvature[i]) * (xi * xi + eta * eta) / 6.0
        add_row(rows[0, i], centre, norms, parts)
        add_row(rows[1, i], options.zeta2 * C_B[i], norms, parts)
        add_row(rows[2, i], options.zeta4 * C_B[i], norms, parts)
        add_row(rows[3, i], C_hg[i] / 3.0, norms, parts)
        add_row(rows[4, i], C_hg[i] / 3.0, norms, parts)
        add_row(rows[5, i], C_B[i] / 9.0, norms, parts)
        add_row(rows[6, i], C_B[i] / 9.0, norms, parts)
        # cross terms of B^0 and B^ζζ: not symmetric, their symmetric part counts
        cross = 0.5 * options.cross * (C_M[i] + C_B[i])
        add_pair(rows[0, i], rows[2, i], cross, norms, parts)
        if slope[i] != 0.0:
            add_pair(rows[0, i], rows[3, i], abs(slope[i]) * xi / 3.0, norms, parts)
            add_pair(rows[0, i], rows[4, i], abs(slope[i]) * eta / 3.0, norms, parts)
    coupling = tangent_coupling(law, E.centre, history)
    add_coupling(coupling, options.cross, conservative, rows, E, norms, parts)


@routine
def add_nodal_stiffness(
    C_M, C_B, rows, law, history, options, conservative, E, norms, parts, weight, is_triangle, nodal
):
    """Share out :func:`add_diagonal_stiffness` to the corners; couplings of two rows stay norms."""
    slope, curvature = ZERO, ZERO
    if conservative is not None:
        slope = values_or_zero(tangent_slope(law, E.centre, history))
        curvature = values_or_zero(tangent_curvature(law, E.centre, history))
        slope = with_fibre_share(options.fibre_share, slope)
        curvature = with_fibre_share(options.fibre_share, curvature)
    C_hg = stabilising_tangent(conservative, law, E.centre, C_M, history)
    C_hg = hourglass_stiffness(C_hg, options.fibre_share)
    corner = np.empty((8, 3))
    nodal[:] = 0.0
    for i in range(6):
        xi, eta = abs(E.xi[i]), abs(E.eta[i])
        whole = C_M[i] + abs(curvature[i]) * (xi * xi + eta * eta) / 6.0
        share_out(rows[0, i], whole, weight, is_triangle, corner, nodal)
        share_out(rows[1, i], options.zeta2 * C_B[i], weight, is_triangle, corner, nodal)
        share_out(rows[2, i], options.zeta4 * C_B[i], weight, is_triangle, corner, nodal)
        share_out(rows[3, i], C_hg[i] / 3.0, weight, is_triangle, corner, nodal)
        share_out(rows[4, i], C_hg[i] / 3.0, weight, is_triangle, corner, nodal)
        share_out(rows[5, i], C_B[i] / 9.0, weight, is_triangle, corner, nodal)
        share_out(rows[6, i], C_B[i] / 9.0, weight, is_triangle, corner, nodal)
        cross = 0.5 * options.cross * (C_M[i] + C_B[i])
        add_pair(rows[0, i], rows[2, i], cross, norms, parts)
        if slope[i] != 0.0:
            add_pair(rows[0, i], rows[3, i], abs(slope[i]) * xi / 3.0, norms, parts)
            add_pair(rows[0, i], rows[4, i], abs(slope[i]) * eta / 3.0, norms, parts)
    coupling = tangent_coupling(law, E.centre, history)
    add_coupling(coupling, options.cross, conservative, rows, E, norms, parts)


@routine
def add_coupling(coupling, cross, conservative, rows, E, norms, parts):
    """Add what couples the normal strain 33 with the shear 12; ``None`` for nothing."""
    if coupling is not None:
        add_pair(rows[0, 2], rows[0, 3], abs(coupling.modulus), norms, parts)
        add_pair(rows[0, 2], rows[2, 3], 0.5 * cross * abs(coupling.modulus), norms, parts)
        if conservative is not None:
            xi, eta = abs(E.xi[2]), abs(E.eta[2])
            squares = (xi * xi + eta * eta) / 6.0
            add_pair(rows[0, 2], rows[0, 3], abs(coupling.mixed) * squares, norms, parts)
            add_row(rows[0, 3], abs(coupling.curvature) * squares, norms, parts)
            add_pair(rows[0, 3], rows[3, 2], abs(coupling.slope) * xi / 3.0, norms, parts)
            add_pair(rows[0, 3], rows[4, 2], abs(coupling.slope) * eta / 3.0, norms, parts)


@routine
def share_out(row, d, weight, is_triangle, corner, nodal):
    """Add the bounds of d b bᵀ at the corners, d (Σ_c |b_c| w_c) b_n b_nᵀ/(|b_n| w_n)."""
    if not d > 0.0:
        return
    for n in range(8):
        for k in range(3):
            corner[n, k] = 0.0
            for mode in range(7):
                corner[n, k] += MODES[mode, n] * row[3 * mode + k]
    if is_triangle:
        for n in (2, 6):
            for k in range(3):
                corner[n, k] += corner[n + 1, k]
                corner[n + 1, k] = 0.0
    total = 0.0
    for n in range(8):
        x, y, z = corner[n, 0], corner[n, 1], corner[n, 2]
        total += weight[n] * math.sqrt(x * x + y * y + z * z)
    for n in range(8):
        x, y, z = corner[n, 0], corner[n, 1], corner[n, 2]
        length = math.sqrt(x * x + y * y + z * z)
        if length > 0.0:
            factor = d * total / (length * weight[n])
            nodal[n, 0] += factor * x * x
            nodal[n, 1] += factor * y * y
            nodal[n, 2] += factor * z * z
            nodal[n, 3] += factor * x * y
            nodal[n, 4] += factor * y * z
            nodal[n, 5] += factor * x * z


@routine
def add_row(row, d, norms, parts):
    """Add the norms of the blocks of d b bᵀ."""
    length, mode = parts.length[0], parts.mode[0]
    count = find_parts(row, length, mode)
    for i in range(count):
        k = mode[i]
        for j in range(count):
            norms[k, mode[j]] += d * length[k] * length[mode[j]]


@routine
def add_pair(row, other_row, d, norms, parts):
    """Add the norms of the blocks of d (b cᵀ + c bᵀ)."""
    if d == 0.0:
        return
    length, other = parts.length[0], parts.length[1]
    count = find_parts(row, length, parts.mode[0])
    other_count = find_parts(other_row, other, parts.mode[1])
    for i in range(count):
        k = parts.mode[0, i]
        for j in range(other_count):
            m = parts.mode[1, j]
            product = d * length[k] * other[m]
            norms[k, m] += product
            norms[m, k] += product


@routine
def matrix6(rows, C):
    """Fill C (6, 6) with a tuple of rows."""
    for i in range(6):
        for j in range(6):
            C[i, j] = rows[i][j]


@routine
def add_full_stiffness(
    M_rows, B_rows, rows, law, history, options, conservative, enhanced, E, norms, parts
):
    """Add the norms of the blocks of Σ Bᵀ C B for full 6x6 stiffnesses to ``norms``.

    The blocks are those of the sum, so that opposite couplings cancel; their Frobenius norms bound
    them. The enhanced strain relieves the ζ-linear stress, Eq. (17).
    """
    C_M, C_B = np.empty((6, 6)), np.empty((6, 6))
    matrix6(M_rows, C_M)
    matrix6(B_rows, C_B)
    C_hg = np.empty((6, 6))
    matrix6(stabilising_tangent(options.conservative, law, E.centre, M_rows, history), C_hg)
    K = np.zeros((21, 21))
    image = np.empty((6, 21))
    C_zeta = C_B.copy()
    if enhanced is not None:
        for i in range(6):
            for j in range(6):
                C_zeta[i, j] -= C_M[i, 2] * C_B[2, j] / C_M[2, 2]
    add_product(rows[0], C_M, 1.0, rows[0], image, K)
    add_product(rows[1], C_zeta, options.zeta2, rows[1], image, K)
    add_product(rows[2], C_B, options.zeta4, rows[2], image, K)
    add_product(rows[3], C_hg, 1.0 / 3.0, rows[3], image, K)
    add_product(rows[4], C_hg, 1.0 / 3.0, rows[4], image, K)
    add_product(rows[5], C_B, 1.0 / 9.0, rows[5], image, K)
    add_product(rows[6], C_B, 1.0 / 9.0, rows[6], image, K)
    if options.cross != 0.0:
        add_product(rows[0], C_B, options.cross, rows[2], image, K)
        add_product(rows[2], C_M, options.cross, rows[0], image, K)
    for k in range(7):
        for m in range(7):
            squared = 0.0
            for i in range(3):
                for j in range(3):
                    squared += K[3 * k + i, 3 * m + j] ** 2
            norms[k, m] += math.sqrt(squared)


@routine
def add_orthotropic_stiffness(
    C_M, C_B, rows, law, history, options, conservative, enhanced, E, norms, parts
):
    """Add the norms of the blocks for stiffnesses that couple the normal strains alone."""
    M_rows, B_rows = orthotropic_rows(C_M), orthotropic_rows(C_B)
    add_full_stiffness(
        M_rows, B_rows, rows, law, history, options, conservative, enhanced, E, norms, parts
    )


class DirectionRows(NamedTuple):
    """Rows and weights of a stiffness along directions, for its nine strains.

    rows : (7, 9, 21) of the Taylor terms. weights : (7, 9), by which their squares count.
    cross : (9,), what couples terms 0 and 2. xi, eta : (9,), what couples term 0 with 3 and 4.
    """

    rows: np.ndarray
    weights: np.ndarray
    cross: np.ndarray
    xi: np.ndarray
    eta: np.ndarray


@routine
def direction_moduli(C, normal, moduli):
    """Fill (9,) with the moduli of a stiffness along directions, ``normal`` those of strains."""
    for k in range(3):
        moduli[k] = normal[k]
        moduli[3 + k] = C.shear[k]
    moduli[6], moduli[7], moduli[8] = C.C33, C.C23, C.C13


@routine
def direction_rows(C_M, C_B, rows, law, history, options, conservative, E):
    """Return the rows and weights as :func:`add_diagonal_stiffness` takes those of components.

    Moduli of fibres count with the largest they may become: they jump within a step.
    """
    own = np.empty((7, 9, 21))
    readers = (
        C_M.along[0], C_M.along[1], C_M.along[2],
        C_M.between[0], C_M.between[1], C_M.between[2],
    )  # fmt: skip
    xi, eta = np.empty(9), np.empty(9)
    for k in range(6):
        r = readers[k]
        xi[k], eta[k] = abs(read_by(r, E.xi)), abs(read_by(r, E.eta))
        for t in range(7):
            for j in range(21):
                own[t, k, j] = r[0] * rows[t, 0, j] + r[1] * rows[t, 1, j] + r[2] * rows[t, 3, j]
    for k, i in ((6, 2), (7, 4), (8, 5)):
        xi[k], eta[k] = abs(E.xi[i]), abs(E.eta[i])
        own[:, k] = rows[:, i]
    membrane, bending, hourglass = np.empty(9), np.empty(9), np.empty(9)
    direction_moduli(C_M, C_M.largest, membrane)
    direction_moduli(C_B, C_B.normal, bending)
    C_hg = stabilising_tangent(conservative, law, E.centre, C_M, history)
    C_hg = hourglass_stiffness(C_hg, options.fibre_share)
    direction_moduli(C_hg, C_hg.normal, hourglass)
    weights = np.empty((7, 9))
    weights[0], weights[1] = membrane, options.zeta2 * bending
    weights[2] = options.zeta4 * bending
    weights[3], weights[4] = hourglass / 3.0, hourglass / 3.0
    weights[5], weights[6] = bending / 9.0, bending / 9.0
    # cross terms of B^0 and B^ζζ: not symmetric, their symmetric part counts
    cross = 0.5 * options.cross * (membrane + bending)
    along_xi, along_eta = np.zeros(9), np.zeros(9)
    if conservative is not None:
        slope = tangent_slope(law, E.centre, history)
        curvature = tangent_curvature(law, E.centre, history)
        for k in range(4):
            s = slope.C33 if k == 3 else slope.shear[k]
            c = curvature.C33 if k == 3 else curvature.shear[k]
            i = 3 + k
            weights[0, i] += abs(c) * (xi[i] * xi[i] + eta[i] * eta[i]) / 6.0
            along_xi[i], along_eta[i] = abs(s) * xi[i] / 3.0, abs(s) * eta[i] / 3.0
    return DirectionRows(own, weights, cross, along_xi, along_eta)


@routine
def add_direction_pairs(own, norms, parts):
    """Add what couples two terms."""
    rows = own.rows
    for i in range(9):
        add_pair(rows[0, i], rows[2, i], own.cross[i], norms, parts)
        add_pair(rows[0, i], rows[3, i], own.xi[i], norms, parts)
        add_pair(rows[0, i], rows[4, i], own.eta[i], norms, parts)


@routine
def add_direction_stiffness(
    C_M, C_B, rows, law, history, options, conservative, enhanced, E, norms, parts
):
    """Add bounds of the blocks of Σ d b bᵀ, for moduli along directions, to ``norms``."""
    own = direction_rows(C_M, C_B, rows, law, history, options, conservative, E)
    for t in range(7):
        for i in range(9):
            add_row(own.rows[t, i], own.weights[t, i], norms, parts)
    add_direction_pairs(own, norms, parts)


@routine
def add_nodal_direction_stiffness(
    C_M, C_B, rows, law, history, options, conservative, E, norms, parts, weight, is_triangle, nodal
):
    """Share out :func:`add_direction_stiffness` to the corners."""
    own = direction_rows(C_M, C_B, rows, law, history, options, conservative, E)
    corner = np.empty((8, 3))
    nodal[:] = 0.0
    for t in range(7):
        for i in range(9):
            share_out(own.rows[t, i], own.weights[t, i], weight, is_triangle, corner, nodal)
    add_direction_pairs(own, norms, parts)


add_stiffness = by_structure(
    add_diagonal_stiffness, add_orthotropic_stiffness, add_direction_stiffness, add_full_stiffness
)
# the other structures are those of solids, which have no such elements
share_out_stiffness = by_structure(
    add_nodal_stiffness, add_nodal_stiffness, add_nodal_direction_stiffness, add_nodal_stiffness
)


@routine
def add_product(left, C, weight, right, image, K):
    """Add weight · leftᵀ C right (21, 21) to K; ``image`` (6, 21) is scratch."""
    for i in range(6):
        for k in range(21):
            image[i, k] = 0.0
        for j in range(6):
            c = weight * C[i, j]
            if c != 0.0:
                for k in range(21):
                    image[i, k] += c * right[j, k]
    for i in range(6):
        for k in range(21):
            b = left[i, k]
            if b != 0.0:
                for m in range(21):
                    K[k, m] += b * image[i, m]


@routine
def add_stress_stiffness(sigma, norms):
    """Add |Σ_kl|, the norms of the blocks of the geometric stiffness Σ ⊗ 1.

    Compression on the diagonal only lowers the frequency and is left out.
    """
    s1, s2, s3, s4, s5, s6, s77 = sigma
    for k in range(7):
        norms[0, k] += max(s1[k], 0.0) if k == 0 else abs(s1[k])
    for k in range(6):
        norms[1, k + 1] += max(s2[k], 0.0) if k == 0 else abs(s2[k])
    for k in range(5):
        norms[2, k + 2] += max(s3[k], 0.0) if k == 0 else abs(s3[k])
    norms[3, 4] += abs(s4[0])
    norms[3, 5] += abs(s4[1])
    norms[4, 4] += max(s5[0], 0.0)
    norms[4, 5] += abs(s5[1])
    norms[4, 6] += abs(s5[2])
    norms[5, 5] += max(s6[0], 0.0)
    norms[5, 6] += abs(s6[1])
    norms[6, 6] += max(s77, 0.0)
    for k in range(7):
        for m in range(k):
            norms[k, m] = norms[m, k]


@routine
def add_normal_compaction(a1, a2, a3, gradients, S33, inverse_height, row, norms, parts):
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
    dual = (math.sqrt(dot(a2, a2)) / area, math.sqrt(dot(a1, a1)) / area)
    tilt = math.sqrt(max(dot(a3, a3) - t * t, 0.0))
    w = abs(S33) * inverse_height * inverse_height * t
    for k in range(2):
        norms[k, 2] += w * dual[k]
        norms[2, k] += w * dual[k]
        for m in range(2):
            norms[k, m] += w * dual[k] * dual[m] * (t + 2.0 * tilt)
    if S33 > 0.0:
        add_row(row, S33 / (t * inverse_height) ** 2, norms, parts)


@equation
def damping_of(resistance, rows):
    """Return a bound of the damping per mass density [Pa s/m²] of viscosities in the centre.

    Of one component it is the only eigenvalue that is not zero, as ω² is for a modulus.
    """
    if resistance is None:
        return 0.0
    return (
        damping_of_row(resistance[0], rows[0])
        + damping_of_row(resistance[1], rows[1])
        + damping_of_row(resistance[2], rows[2])
        + damping_of_row(resistance[3], rows[3])
        + damping_of_row(resistance[4], rows[4])
        + damping_of_row(resistance[5], rows[5])
    )


@equation
def damping_of_row(resistance, row):
    if resistance is None:
        return 0.0
    total = 0.0
    for k in range(21):
        total += row[k] * row[k]
    return resistance * total


@equation
def damping_of_bending(resistance, rows):
    """Return the same of two viscosities of the strains 11 and 22 linear in ζ."""
    if resistance is None:
        return 0.0
    return damping_of_row(resistance[0], rows[0]) + damping_of_row(resistance[1], rows[1])


@routine
def add_curvature(curvature, zeta_rows, row):
    """Add the gradient of :func:`curvature_compaction` to the row of E33."""
    for k in range(21):
        row[k] += curvature[0] * zeta_rows[0, k]
        row[k] += curvature[1] * zeta_rows[1, k]
        row[k] += curvature[2] * zeta_rows[3, k]


@routine
def add_change_of_bending(S, E, options, rows, norms, parts):
    """Turn the rows of the bending strains into those at the reference thickness.

    With Ê = E/λ^n, n = 1 or 2 and r = 1/λ², the rows are b/λ^n - n r Ê b33, and the second
    derivatives of Ê couple E33 with the bending and with itself: -n r (b b33ᵀ + b33 bᵀ)/λ^n and
    n (n + 2) r² Ê b33 b33ᵀ.
    """
    s, r = inverse_stretch(E.centre[2])
    row33, coupling = rows[0, 2], np.zeros(21)
    itself = 0.0
    itself += add_change_of_term(S.zeta, E.zeta, options.zeta2, 1.0, s, r, rows[1], row33, coupling)
    itself += add_change_of_term(
        S.zeta2, E.zeta2, options.zeta4, 2.0, r, r, rows[2], row33, coupling
    )
    itself += add_change_of_term(
        S.eta_zeta, E.eta_zeta, 1.0 / 9.0, 1.0, s, r, rows[5], row33, coupling
    )
    itself += add_change_of_term(
        S.xi_zeta, E.xi_zeta, 1.0 / 9.0, 1.0, s, r, rows[6], row33, coupling
    )
    add_pair(coupling, row33, 1.0, norms, parts)
    add_row(row33, itself, norms, parts)


@routine
def add_change_of_term(S, E, weight, n, scale, r, rows, row33, coupling):
    """As above for one term: add to ``coupling`` (21,), and return what E33 has with itself."""
    itself = 0.0
    for i in range(6):
        itself += weight * n * (n + 2.0) * r * r * S[i] * E[i]
        for k in range(21):
            b = scale * rows[i, k]
            coupling[k] -= weight * n * r * S[i] * b
            rows[i, k] = b - n * r * E[i] * row33[k]
    return max(itself, 0.0)


@routine
def spectral_radius_bound(norms, weight, image):
    """Return an upper bound of the spectral radius of a matrix with blocks of these ``norms``.

    max_k (N d)_k / d_k bounds it for any positive d (Collatz and Wielandt); d = 1 is Gershgorin's
    theorem, and every power iteration d <- N d lowers the bound. ``weight`` (7,) is left holding d.
    """
    weight[:] = 1.0
    bound = math.inf
    for _ in range(POWER_ITERATIONS):
        largest, total = 0.0, 0.0
        for k in range(7):
            image[k] = 0.0
            for m in range(7):
                image[k] += norms[k, m] * weight[m]
            largest = max(largest, image[k] / weight[k])
            total = max(total, image[k])
        bound = min(bound, largest)
        if not total > 0.0:
            return bound
        for k in range(7):
            # modes that take no part keep a small weight: d must be positive
            weight[k] = max(image[k] / total, SMALLEST_WEIGHT)
    return bound


def frequency_bounds(
    body: SolidShellData,
    positions: np.ndarray,
    history: np.ndarray,
    omega2: np.ndarray,
    controlling_mode: np.ndarray,
    nodal: NodalShares | None = None,
    damping: np.ndarray | None = None,
) -> None:
    """Write the bound of ω² [1/s²] of every element, and the mode (0 ... 6) that moves most.

    Parameters
    ----------
    body, positions, history : as for :func:`lcmchain.elements.solid_shell.kernel.internal_forces`.
    omega2 : (block_count * 16,), controlling_mode : (block_count * 16,) int64, written.
    nodal : takes what can be shared out to the nodes (``cut_frequency.py``), and leaves the rest.
    damping : (block_count * 16,) takes the damping rates c/m [1/s] of a law that resists rates.
    """
    element_frequency_bounds(
        positions,
        body.corner_node,
        body.element_data,
        body.transformation,
        body.transformation_change,
        body.density,
        full_history(body.options.director, body.corner_node, history),
        body.law,
        body.options,
        omega2,
        controlling_mode,
        nodal,
        damping,
    )


@kernel
def element_frequency_bounds(
    positions,
    corner_node,
    element_data,
    transformation,
    transformation_change,
    density,
    history,
    law,
    options,
    omega2,
    controlling_mode,
    nodal,
    damping,
):
    block_count = corner_node.size // (8 * LANES)
    history_size = history.size // block_count
    curvature_size = curvature_rows(options.director) * LANES
    for block in prange(block_count):
        nodes = corner_node[block * 8 * LANES : (block + 1) * 8 * LANES]
        data = constants_of_block(options, element_data, block)
        own = history[block * history_size : (block + 1) * history_size]
        shared, past = own[:curvature_size], own[curvature_size:]
        corner = np.empty(24 * LANES)
        a_array = np.empty((7, 3))
        covariant = np.empty((7, 6, 21))
        material = np.empty((7, 6, 21))
        norms = np.empty((7, 7))
        weight, image = np.empty(7), np.empty(7)
        parts = Parts(np.empty((2, 7)), np.empty((2, 7), dtype=np.int64))
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
            lane_history = load_history(law, past, lane, LANES)
            shared_curvature = load_curvature(options.director, shared, lane)
            Sbar, E, S33, normal, _, inverse_height = element_stress(
                a, data, lane, law, lane_history, shared_curvature, options
            )
            element = block * LANES + lane
            covariant_gradients(a_array, covariant)
            material[:] = 0.0
            for t in range(7):
                add_transformed(transformation[element], covariant[t], material[t])
            if options.curved is not None:
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
            if options.in_plane_shear != 1.0:
                factor = options.in_plane_shear
                T = transformation[element]
                read = np.linalg.inv(T)[3]
                scale_in_plane_shear(T, read, factor, material[3])
                scale_in_plane_shear(T, read, factor, material[4])

            norms[:] = 0.0
            add_stress_stiffness(stress_matrix(Sbar, Sbar.centre[2], 1.0, 1.0), norms)
            if options.director is None:
                add_normal_compaction(
                    a[0], a[1], a[2], normal[1:], S33, inverse_height, material[0, 2], norms, parts
                )
                add_curvature(shared_curvature, covariant[1], material[0, 2])
            C_M = membrane_response(law, E.centre, lane_history)[1]
            if options.reference_bending is not None:
                S = stresses(law, lane_history, options, options.enhanced, inverse_height, E)
                add_change_of_bending(S, E, options, material, norms, parts)
            if nodal is None:
                add_stiffness(
                    C_M,
                    bending_bound(law),
                    material,
                    law,
                    lane_history,
                    options,
                    options.conservative,
                    options.enhanced,
                    E,
                    norms,
                    parts,
                )
            else:
                share_out_stiffness(
                    C_M,
                    bending_bound(law),
                    material,
                    law,
                    lane_history,
                    options,
                    options.conservative,
                    E,
                    norms,
                    parts,
                    nodal.weight[element],
                    nodal.is_triangle[element],
                    nodal.stiffness[element],
                )
            if damping is not None:
                resistance = viscosity(law, E.centre, lane_history)
                rate = damping_of(resistance, material[0])
                rate += options.zeta2 * damping_of_bending(bending_viscosity(law), material[1])
                damping[element] = rate / density
            omega2[element] = spectral_radius_bound(norms, weight, image) / density
            controlling_mode[element] = np.argmax(weight)
