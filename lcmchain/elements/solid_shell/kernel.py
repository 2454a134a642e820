"""Loop over elements: gather node positions, evaluate the element's equations, store the forces.

Blocks of 16 elements lie in flat arrays ``[(block * rows + row) * 16 + lane]``; one loop over the
lanes around straight-line code is what the compiler turns into packed instructions. Effects that
the scene does not call for are arguments that are ``None``; their code is pruned when compiling.
"""

from __future__ import annotations

from typing import Any, Literal, NamedTuple

import numpy as np
from numba import prange
from numba.extending import overload

from lcmchain.dispatch import implements
from lcmchain.elements.blocks import LANES, RUN_COLUMNS, SharedBlocks, load_vectors
from lcmchain.elements.family import internal_forces
from lcmchain.elements.solid_shell.bending import (
    at_reference_thickness,
    at_reference_thickness_stress,
)
from lcmchain.elements.solid_shell.equations import (
    EIGHTH,
    NINTH,
    THIRD,
    CurvedFrame,
    FlatFrame,
    Lengths,
    Moments,
    Taylor,
    condensed_enhanced_strain,
    covariant_products,
    curvature_compaction,
    curved_covariant_stress,
    curved_material_strain,
    eightfold_modes,
    flat_covariant_stress,
    flat_material_strain,
    mode_force_components,
    node_components,
    normal_compaction,
    scaled6,
    scaled7,
    scaled_in_plane_shear,
    scaled_in_plane_shear_stress,
    stress_matrix,
    sum6,
    thickness_resultants,
    unit_in_plane_shear,
)
from lcmchain.jit import INLINED, equation, kernel, routine
from lcmchain.materials.law import (
    Law,
    Step,
    bending_stiffness,
    bending_stress,
    evolved_bending,
    evolved_history,
    history_count,
    hourglass_tangent,
    load_past,
    membrane_response,
    store_history,
    tangent_coupling,
    tangent_slope,
    with_bending_losses,
)
from lcmchain.materials.stiffness import AlongFibres, by_structure, product, read_by

CORNER_ROWS = 24
# First rows of an element's history, where compaction is measured by the normal thickness.
CURVATURE_ROWS = 4
ALIGNED_ROWS = 25
FLAT_ROWS = 19
CURVED_ROWS = 66
# Where the constants of a block begin that the general kernel has to take.
GENERAL = -1


class Options(NamedTuple):
    """What the element's kernels are compiled for, and the numbers of its choices.

    aligned, flat, curved : ``True`` or ``None``, one of them ``True``: kind of the reference
        geometry that the constants describe: rectangles along the fibres, parallelograms, any.
    director, conservative, enhanced, reference_bending, coupled : ``True`` or ``None``: the effect
        is on or pruned; ``coupled`` says whether ``cross`` is not 0.
    zeta2, zeta4 : means of ζ² and ζ⁴ over the thickness by the integration points of Eq. (15): 1/3
        and 1/5 for three or more Gauss points and for the exact integral, 1/3 and 1/9 for two.
    cross : weight of the terms that couple E^0 and E^ζζ: <ζ²> as printed in Eqs. (15) and (19), 0
        to drop them.
    in_plane_shear : 1, or 0 to drop the in-plane shear of the ξ- and η-terms in covariant axes.
    fibre_share : of the fibre stiffness in the in-plane hourglass terms, 1 as in Eq. (18).
    """

    aligned: Literal[True] | None
    flat: Literal[True] | None
    curved: Literal[True] | None
    director: Literal[True] | None
    conservative: Literal[True] | None
    enhanced: Literal[True] | None
    reference_bending: Literal[True] | None
    coupled: Literal[True] | None
    zeta2: float
    zeta4: float
    cross: float
    in_plane_shear: float
    fibre_share: float


class SolidShellData(NamedTuple):
    """Constants of a body of solid-shells as its kernels read them.

    law : see :mod:`lcmchain.materials.law`. options : :class:`Options`.
    corner_node : (block_count * 8 * 16,) int32, nodes of the corners.
    corner_run : where those of a corner in a block follow each other (``elements/blocks.py``).
    element_data : reference geometry, FLAT_ROWS or CURVED_ROWS rows (see ``geometry.py``).
    quick_data, quick_options : constants (ALIGNED_ROWS or FLAT_ROWS rows) and choices for the
        forces of those blocks whose elements are all of a kind with a quicker kernel: rectangles
        along the fibres, or, where others are curved, parallelograms; ``None`` without such blocks.
    general : ``True`` where blocks are left to the kernel of ``options``, else ``None``.
    transformation : (block_count * 16, 6, 6) T⁰; transformation_change : (..., 3, 6, 6) T^ξ, T^η,
        T^ζ, read only for curved references.
    density : [kg/m³]; nodal masses are one eighth of the element's.
    neighbour : (4, block_count * 16) int32, elements across the edges, -1 where there is none.
    reference_curvature : (block_count * 16,), see ``curvature.py``; 0 for a flat reference.
    """

    law: Law
    options: Options
    corner_node: np.ndarray
    corner_run: np.ndarray
    element_data: SharedBlocks
    quick_data: Any
    quick_options: Options | None
    general: Literal[True] | None
    transformation: np.ndarray
    transformation_change: np.ndarray
    density: float
    neighbour: np.ndarray
    reference_curvature: np.ndarray


@equation
def replace33(E, E33):
    return (E[0], E[1], E33, E[3], E[4], E[5])


@equation
def scaled_shear_rows(E, factor):
    """Weight the in-plane shear row of the covariant ξ- and η-terms (0 drops it), flat reference.

    Where the reference is not flat these rows alone say nothing: in a constant strain they cancel
    what the change of T makes of E^0 (:func:`scaled_shear`).
    """
    x, e = E.xi, E.eta
    return Taylor(
        E.centre,
        E.zeta,
        E.zeta2,
        (x[0], x[1], factor * x[2], x[3]),
        (e[0], e[1], factor * e[2], e[3]),
        E.eta_zeta,
        E.xi_zeta,
    )


@equation
def scaled_shear(unit, factor, E):
    """Weight the in-plane shear of the ξ- and η-terms in the covariant axes of the centre."""
    xi = scaled_in_plane_shear(unit, factor, E.xi)
    eta = scaled_in_plane_shear(unit, factor, E.eta)
    return Taylor(E.centre, E.zeta, E.zeta2, xi, eta, E.eta_zeta, E.xi_zeta)


@equation
def scaled_shear_stress(unit, factor, S):
    """Return the transpose of :func:`scaled_shear` for stress resultants."""
    xi = scaled_in_plane_shear_stress(unit, factor, S.xi)
    eta = scaled_in_plane_shear_stress(unit, factor, S.eta)
    return Taylor(S.centre, S.zeta, S.zeta2, xi, eta, S.eta_zeta, S.xi_zeta)


@equation
def difference(E, R):
    """Return the covariant strain coefficients: products minus those of the reference."""
    c, z, q, x, e, ez, xz = E
    rc, rz, rq, rx, re, rez, rxz = R
    return Taylor(
        (c[0] - rc[0], c[1] - rc[1], c[2] - rc[2], c[3] - rc[3], c[4] - rc[4], c[5] - rc[5]),
        (z[0] - rz[0], z[1] - rz[1], z[2] - rz[2], z[3] - rz[3], z[4] - rz[4]),
        (q[0] - rq[0], q[1] - rq[1], q[2] - rq[2]),
        (x[0] - rx[0], x[1] - rx[1], x[2] - rx[2], x[3] - rx[3]),
        (e[0] - re[0], e[1] - re[1], e[2] - re[2], e[3] - re[3]),
        (ez[0] - rez[0], ez[1] - rez[1], ez[2] - rez[2]),
        (xz[0] - rxz[0], xz[1] - rxz[1], xz[2] - rxz[2]),
    )


@equation
def difference_flat(E, R):
    """As :func:`difference` where the reference is a flat parallelogram: only E^0 has a part."""
    c = E.centre
    return Taylor(
        (c[0] - R[0], c[1] - R[1], c[2] - R[2], c[3] - R[3], c[4], c[5]),
        E.zeta,
        E.zeta2,
        E.xi,
        E.eta,
        E.eta_zeta,
        E.xi_zeta,
    )


@equation
def with_slope_stress(total, share, moments, slope, x, e):
    """Add the part of one component; ``slope`` is None where the tangent does not change."""
    if slope is None:
        return total
    return total + share * (0.5 * slope * (moments.xi * (x * x) + moments.eta * (e * e)))


@equation
def diagonal_hourglass_stress(slope, c, moments, fibre_share, x, e):
    """Add to the centre stress that from the change of the hourglass energy with the tangent.

    The hourglass energy (V/6)(E^ξ:C(E⁰):E^ξ + E^η:C(E⁰):E^η) of Eq. (16) depends on E⁰ through the
    tangent of Eq. (18). The paper leaves that derivative out; then the element has no potential and
    feeds energy to a sheet that is compacted and warped at once (manual: departures).
    """
    return (
        with_slope_stress(c[0], fibre_share, moments, slope[0], x[0], e[0]),
        with_slope_stress(c[1], fibre_share, moments, slope[1], x[1], e[1]),
        with_slope_stress(c[2], 1.0, moments, slope[2], x[2], e[2]),
        with_slope_stress(c[3], 1.0, moments, slope[3], x[3], e[3]),
        with_slope_stress(c[4], 1.0, moments, slope[4], x[4], e[4]),
        with_slope_stress(c[5], 1.0, moments, slope[5], x[5], e[5]),
    )


@equation
def squares_of(reader, moments, x, e):
    """Return ½ (<ξ²> x² + <η²> e²) of what a reader takes from E^ξ and E^η."""
    at_xi, at_eta = read_by(reader, x), read_by(reader, e)
    return 0.5 * (moments.xi * (at_xi * at_xi) + moments.eta * (at_eta * at_eta))


@equation
def along_fibres_hourglass_stress(slope, c, moments, fibre_share, x, e):
    """Add the same where each modulus of a shear depends on that shear, and C33 on E33."""
    b, k = slope.between, slope.shear
    s = (
        k[0] * squares_of(b[0], moments, x, e),
        k[1] * squares_of(b[1], moments, x, e),
        k[2] * squares_of(b[2], moments, x, e),
    )
    return (
        c[0] + (b[0][0] * s[0] + b[1][0] * s[1] + b[2][0] * s[2]),
        c[1] + (b[0][1] * s[0] + b[1][1] * s[1] + b[2][1] * s[2]),
        with_slope_stress(c[2], 1.0, moments, slope.C33, x[2], e[2]),
        c[3] + (b[0][2] * s[0] + b[1][2] * s[1] + b[2][2] * s[2]),
        c[4],
        c[5],
    )


with_hourglass_tangent_stress = by_structure(
    diagonal_hourglass_stress,
    diagonal_hourglass_stress,
    along_fibres_hourglass_stress,
    diagonal_hourglass_stress,
)


@equation
def with_coupling_stress(c, moments, coupling, x, e):
    """Add to the shear of the centre that from the change of the stabilising C33 with it."""
    if coupling is None:
        return c
    change = 0.5 * coupling.slope * (moments.xi * (x * x) + moments.eta * (e * e))
    return (c[0], c[1], c[2], c[3] + change, c[4], c[5])


@equation
def stabilising_tangent(conservative, law, E, C_M, history):
    """Return the tangent of Eq. (18); where its slope makes stress too, one without kinks."""
    if conservative is None:
        return C_M
    return hourglass_tangent(law, E, C_M, history)


@equation
def diagonal_hourglass_stiffness(C, fibre_share):
    """Return C^hg of the ξ- and η-terms, Eq. (18), from the stabilising tangent C.

    E11^η and E22^ξ are the bending of an element's fibres within the plane. Where strips of fibre
    slide over each other, it is that of the strips, less than that of a solid of fibre as wide as
    the element by the square of the widths (``body.strip_share``).
    """
    f = fibre_share
    return (f * C[0], f * C[1], C[2], C[3], C[4], C[5])


@equation
def coupled_hourglass_stiffness(C, fibre_share):
    """Return C: a coupled stiffness has no fibres apart (``build`` refuses a share of them)."""
    return C


@equation
def along_fibres_hourglass_stiffness(C, fibre_share):
    """Return C with the share of its fibres, as :func:`diagonal_hourglass_stiffness`."""
    f, less = C.fibre, fibre_share - 1.0
    normal = (
        C.normal[0] * (1.0 + less * f[0]),
        C.normal[1] * (1.0 + less * f[1]),
        C.normal[2] * (1.0 + less * f[2]),
    )
    return AlongFibres(normal, C.largest, C.shear, C.C33, C.C23, C.C13, C.fibre, C.along, C.between)


@equation
def diagonal_relief(C_M, S_zeta):
    """Return the ζ-linear stress without component 33: the only one the enhanced strain moves."""
    return replace33(S_zeta, 0.0)


@equation
def orthotropic_relief(C_M, S_zeta):
    """Return the ζ-linear stress with that of the enhanced strain: no S33 is left, Eq. (17)."""
    strain33 = condensed_enhanced_strain(S_zeta[2], C_M.C33)
    S11, S22 = S_zeta[0] + strain33 * C_M.C13, S_zeta[1] + strain33 * C_M.C23
    return (S11, S22, 0.0, S_zeta[3], S_zeta[4], S_zeta[5])


@equation
def full_relief(C_M, S_zeta):
    """Return the ζ-linear stress with that of the enhanced strain, Eq. (17)."""
    return sum6(S_zeta, scaled6(condensed_enhanced_strain(S_zeta[2], C_M[2][2]), C_M[2]))


hourglass_stiffness = by_structure(
    diagonal_hourglass_stiffness,
    coupled_hourglass_stiffness,
    along_fibres_hourglass_stiffness,
    coupled_hourglass_stiffness,
)
relieved = by_structure(diagonal_relief, orthotropic_relief, diagonal_relief, full_relief)


class Stresses(NamedTuple):
    """Stress of each Taylor term before Eqs. (15) and (16) weight it, and the tangents."""

    centre: tuple
    zeta: tuple
    zeta2: tuple
    xi: tuple
    eta: tuple
    eta_zeta: tuple
    xi_zeta: tuple
    C_M: tuple
    C_B: tuple


@equation
def stresses(law, history, options, enhanced, inverse_height, E):
    """Return the stresses of the strains E: the law's at the centre, C^B along ζ, Eq. (19)."""
    S_centre, C_M = membrane_response(law, E.centre, history)
    C_B = bending_stiffness(law)
    C_hg = stabilising_tangent(options.conservative, law, E.centre, C_M, history)
    C_hg = hourglass_stiffness(C_hg, options.fibre_share)
    S_zeta = bending_stress(law, C_B, E.zeta, inverse_height)
    S_zeta = with_bending_losses(law, S_zeta, E.zeta, inverse_height, history)
    if enhanced is not None:
        S_zeta = relieved(C_M, S_zeta)
    return Stresses(
        S_centre,
        S_zeta,
        product(C_B, E.zeta2),
        product(C_hg, E.xi),
        product(C_hg, E.eta),
        product(C_B, E.eta_zeta),
        product(C_B, E.xi_zeta),
        C_M,
        C_B,
    )


@equation
def natural_moments(options):
    """Return the moments of the natural coordinates ξ, η, ζ."""
    return Moments(options.zeta2, options.zeta4, THIRD, THIRD, NINTH, NINTH, options.cross)


@equation
def resultants(law, history, options, conservative, enhanced, coupled, moments, inverse_height, E):
    """Return stress resultants of Eqs. (15) and (16) per unit volume 8 J⁰."""
    S = stresses(law, history, options, enhanced, inverse_height, E)
    c, z, q = thickness_resultants(coupled, moments, S.centre, S.zeta, S.zeta2)
    if conservative is not None:
        slope = tangent_slope(law, E.centre, history)
        c = with_hourglass_tangent_stress(slope, c, moments, options.fibre_share, E.xi, E.eta)
        coupling = tangent_coupling(law, E.centre, history)
        c = with_coupling_stress(c, moments, coupling, E.xi[2], E.eta[2])
    return Taylor(
        c,
        z,
        q,
        scaled6(moments.xi, S.xi),
        scaled6(moments.eta, S.eta),
        scaled6(moments.eta_zeta, S.eta_zeta),
        scaled6(moments.xi_zeta, S.xi_zeta),
    )


@equation
def load6(data, i):
    L = LANES
    return (
        data[i],
        data[i + L],
        data[i + 2 * L],
        data[i + 3 * L],
        data[i + 4 * L],
        data[i + 5 * L],
    )


@equation
def load3(data, i):
    return (data[i], data[i + LANES], data[i + 2 * LANES])


@equation
def load3x3(data, i):
    L = LANES
    return (load3(data, i), load3(data, i + 3 * L), load3(data, i + 6 * L))


@equation
def load7(data, i):
    a, b, c, d, e, f = load6(data, i)
    return a, b, c, d, e, f, data[i + 6 * LANES]


@equation
def element_lengths(data, i):
    """Return what an aligned element is computed with (ALIGNED_ROWS rows)."""
    L = LANES
    return Lengths(
        data[i],
        data[i + L],
        load7(data, i + 2 * L),
        load7(data, i + 9 * L),
        load3(data, i + 16 * L),
        load6(data, i + 19 * L),
    )


@equation
def material_moments(options, moments):
    """Return the moments of the material coordinates of an aligned element."""
    zz, zzzz, xi, eta, eta_zeta, xi_zeta = moments
    return Moments(
        options.zeta2 * zz, options.zeta4 * zzzz, xi, eta, eta_zeta, xi_zeta, options.cross * zz
    )


@equation
def unit_products(E):
    """Return the strains of an aligned element: its reference has the products 1, 1, 1, 0, 0, 0."""
    c = E.centre
    return Taylor(
        (c[0] - 0.5, c[1] - 0.5, c[2] - 0.5, c[3], c[4], c[5]),
        (E.zeta[0], E.zeta[1], 0.0, E.zeta[2], E.zeta[3], E.zeta[4]),
        (E.zeta2[0], E.zeta2[1], 0.0, E.zeta2[2], 0.0, 0.0),
        (0.0, E.xi[0], E.xi[1], E.xi[2], E.xi[3], 0.0),
        (E.eta[0], 0.0, E.eta[1], E.eta[2], 0.0, E.eta[3]),
        (E.eta_zeta[0], 0.0, 0.0, E.eta_zeta[1], 0.0, E.eta_zeta[2]),
        (0.0, E.xi_zeta[0], 0.0, E.xi_zeta[1], E.xi_zeta[2], 0.0),
    )


@equation
def in_order_of_products(S):
    """Return the transpose of :func:`unit_products`: the resultants in its layout."""
    return Taylor(
        S.centre,
        (S.zeta[0], S.zeta[1], S.zeta[3], S.zeta[4], S.zeta[5]),
        (S.zeta2[0], S.zeta2[1], S.zeta2[3]),
        (S.xi[1], S.xi[2], S.xi[3], S.xi[4]),
        (S.eta[0], S.eta[2], S.eta[3], S.eta[5]),
        (S.eta_zeta[0], S.eta_zeta[3], S.eta_zeta[5]),
        (S.xi_zeta[1], S.xi_zeta[3], S.xi_zeta[4]),
    )


@equation
def flat_frame(data, i):
    """Return frame, volume 8 J⁰ and reference products of a flat element (FLAT_ROWS rows)."""
    L = LANES
    p, r, q = load3x3(data, i)
    P = (p[0], p[1], p[2], r[0], r[1], r[2], q[0], q[1], q[2])
    Q = (data[i + 9 * L], data[i + 10 * L], data[i + 11 * L], data[i + 12 * L])
    reference = (data[i + 15 * L], data[i + 16 * L], data[i + 17 * L], data[i + 18 * L])
    return FlatFrame(P, Q, data[i + 13 * L]), data[i + 14 * L], reference


@equation
def curved_frame(data, i):
    """Return frame, 1/h, volume 8 J⁰, reference products of a curved element (CURVED_ROWS rows)."""
    L = LANES
    frame = CurvedFrame(
        load3x3(data, i),
        load3x3(data, i + 9 * L),
        load3x3(data, i + 18 * L),
        load3x3(data, i + 27 * L),
    )
    z, q = i + 44 * L, i + 49 * L
    x, e, ez, xz = i + 52 * L, i + 56 * L, i + 60 * L, i + 63 * L
    reference = Taylor(
        load6(data, i + 38 * L),
        (data[z], data[z + L], data[z + 2 * L], data[z + 3 * L], data[z + 4 * L]),
        load3(data, q),
        (data[x], data[x + L], data[x + 2 * L], data[x + 3 * L]),
        (data[e], data[e + L], data[e + 2 * L], data[e + 3 * L]),
        load3(data, ez),
        load3(data, xz),
    )
    return frame, data[i + 36 * L], data[i + 37 * L], reference


@equation
def load_component(x, i):
    """Return one component of the mode vectors from the eight corner values at stride 3 rows."""
    return scaled7(EIGHTH, load_eightfold(x, i))


@equation
def load_eightfold(x, i):
    """Return one component of eight times the mode vectors."""
    s = 3 * LANES
    return eightfold_modes(
        x[i],
        x[i + s],
        x[i + 2 * s],
        x[i + 3 * s],
        x[i + 4 * s],
        x[i + 5 * s],
        x[i + 6 * s],
        x[i + 7 * s],
    )


@equation
def store_component(f, i, p):
    """Store one component of the eight corner forces from that on eight times the mode vectors."""
    s = 3 * LANES
    n = node_components(p[0], p[1], p[2], p[3], p[4], p[5], p[6])
    f[i] = n[0]
    f[i + s] = n[1]
    f[i + 2 * s] = n[2]
    f[i + 3 * s] = n[3]
    f[i + 4 * s] = n[4]
    f[i + 5 * s] = n[5]
    f[i + 6 * s] = n[6]
    f[i + 7 * s] = n[7]


@equation
def with_normal(director, p, g, s, k):
    """Add component k of s times the gradients of the normal compaction to those on a1, a2, a3."""
    if director is not None:
        return p
    return (p[0] + s * g[1][k], p[1] + s * g[2][k], p[2] + s * g[3][k], p[3], p[4], p[5], p[6])


@equation
def with_centre33(T, value):
    """Return the Taylor terms with component 33 of the centre replaced."""
    return Taylor(replace33(T.centre, value), T.zeta, T.zeta2, T.xi, T.eta, T.eta_zeta, T.xi_zeta)


@equation
def mode_vectors(mx, my, mz):
    """Return a1 ... a7 from their Cartesian components."""
    return (
        (mx[0], my[0], mz[0]),
        (mx[1], my[1], mz[1]),
        (mx[2], my[2], mz[2]),
        (mx[3], my[3], mz[3]),
        (mx[4], my[4], mz[4]),
        (mx[5], my[5], mz[5]),
        (mx[6], my[6], mz[6]),
    )


@equation
def load_curvature(director, data, i):
    """Return what the lane takes of its neighbours' curvature (``curvature.py``)."""
    if director is not None:
        return (0.0, 0.0, 0.0, 0.0)
    return (data[i], data[i + LANES], data[i + 2 * LANES], data[i + 3 * LANES])


@equation
def add_curvature_stress(curvature, S33, S):
    """Return covariant resultants with the derivatives of :func:`curvature_compaction`."""
    z = S.zeta
    zeta = (
        z[0] + curvature[0] * S33,
        z[1] + curvature[1] * S33,
        z[2] + curvature[2] * S33,
        z[3],
        z[4],
    )
    return Taylor(S.centre, zeta, S.zeta2, S.xi, S.eta, S.eta_zeta, S.xi_zeta)


@equation
def element_stress(a, data, i, law, history, curvature, options):
    """Return covariant stress resultants per volume, strains, S33, and the normal compaction.

    The compaction by the normal thickness is no product of mode vectors: its stress resultant S33
    is returned beside the others, followed by (E33, gradients), the volume 8 J⁰ and 1/h.

    ``a`` are the mode vectors; of an aligned element those in material coordinates
    (:class:`lcmchain.elements.solid_shell.equations.Lengths`), in which the strains and resultants
    are given too; its volume and 1/h are 1.
    """
    # as arguments of their own, options that are None prune the code of what is not called for
    o = options
    return chosen_element_stress(
        a,
        data,
        i,
        law,
        history,
        curvature,
        o,
        o.aligned,
        o.flat,
        o.curved,
        o.director,
        o.conservative,
        o.enhanced,
        o.reference_bending,
        o.coupled,
    )


@equation
def chosen_element_stress(
    a,
    data,
    i,
    law,
    history,
    curvature,
    options,
    aligned,
    flat,
    curved,
    director,
    conservative,
    enhanced,
    reference_bending,
    coupled,
):
    xx, yy = places_at_edges(aligned, data, i)
    moments = moments_of(aligned, options, data, i)
    products = covariant_products(a, xx, yy)
    if aligned is not None:
        inverse_height, volume = 1.0, 1.0
        curvature = scaled_curvature(curvature, element_lengths(data, i).curvature)
        E = unit_products(scaled_shear_rows(products, options.in_plane_shear))
    if curved is not None:
        curved_axes, inverse_height, volume, reference = curved_frame(data, i)
        E = curved_material_strain(curved_axes, difference(products, reference))
        unit = unit_in_plane_shear(curved_axes.K)
        E = scaled_shear(unit, options.in_plane_shear, E)
    if flat is not None:
        flat_axes, volume, flat_reference = flat_frame(data, i)
        inverse_height = flat_axes.inverse_height
        Ebar = scaled_shear_rows(difference_flat(products, flat_reference), options.in_plane_shear)
        E = flat_material_strain(flat_axes, Ebar)

    normal = normal_compaction(a[0], a[1], a[2], inverse_height)
    if director is None:
        E = with_centre33(E, normal[0] + curvature_compaction(curvature, products.zeta))
    if reference_bending is not None:
        E = at_reference_thickness(E)
    S = resultants(
        law, history, options, conservative, enhanced, coupled, moments, inverse_height, E
    )
    if reference_bending is not None:
        S = at_reference_thickness_stress(E, S)
    S33 = 0.0
    if director is None:
        S33 = S.centre[2]
        S = with_centre33(S, 0.0)

    if curved is not None:
        S = scaled_shear_stress(unit, options.in_plane_shear, S)
        Sbar = curved_covariant_stress(curved_axes, S)
    if flat is not None:
        Sbar = scaled_shear_rows(flat_covariant_stress(flat_axes, S), options.in_plane_shear)
    if aligned is not None:
        Sbar = scaled_shear_rows(in_order_of_products(S), options.in_plane_shear)
    if director is None:
        Sbar = add_curvature_stress(curvature, S33, Sbar)
    return Sbar, E, S33, normal, volume, inverse_height


@equation
def places_at_edges(aligned, data, i):
    """Return the squares of the first two coordinates at the edges."""
    if aligned is None:
        return 1.0, 1.0
    return data[i], data[i + LANES]


@equation
def moments_of(aligned, options, data, i):
    if aligned is None:
        return natural_moments(options)
    return material_moments(options, element_lengths(data, i).moments)


@equation
def scaled_curvature(curvature, factors):
    return (
        factors[0] * curvature[0],
        factors[1] * curvature[1],
        factors[2] * curvature[2],
        curvature[3],
    )


@equation
def centre33(director, curved, Sbar):
    """Return the resultant on the covariant 33 of the centre, ``None`` where it vanishes."""
    if director is None:
        if curved is None:
            return None
    return Sbar.centre[2]


@equation
def mode_scales(aligned, data, i):
    """Return what eight times the mode vectors are multiplied with."""
    if aligned is None:
        return EIGHTH
    return element_lengths(data, i).modes


@equation
def force_scales(aligned, data, i, volume):
    """Return what the forces per volume are multiplied with: :func:`mode_scales` times 8 J⁰."""
    if aligned is None:
        v = 0.125 * volume
        return (v, v, v, v, v, v, v)
    return element_lengths(data, i).forces


def memory_of_block(law: Law, own: np.ndarray, past: np.ndarray) -> np.ndarray:
    """Return the array that holds the memory of a law, for the lanes of a block.

    ``own`` : the history of the block. ``past`` : the view of it that begins behind what elements
    share. LLVM takes stores to this view for ones to what is read, and makes no vectors of the loop
    over the lanes: a law with memory gets the whole, where the place is a number.
    """
    return own if history_count(law) else past


@overload(memory_of_block, jit_options=INLINED, strict=False)
def _choose_memory(law, own, past):
    if history_count(law.instance_class):
        return lambda law, own, past: own
    return lambda law, own, past: past


def place_in_memory(law: Law, director: Literal[True] | None, lane: int) -> int:
    """Return where the memory of a lane begins in what :func:`memory_of_block` returns."""
    return lane + curvature_rows(director) * LANES if history_count(law) else lane


@overload(place_in_memory, jit_options=INLINED, strict=False)
def _choose_place(law, director, lane):
    if history_count(law.instance_class):
        return lambda law, director, lane: lane + curvature_rows(director) * LANES
    return lambda law, director, lane: lane


@equation
def element_in_lane(i, corner, data, law, history, shared, options, step):
    """Replace the corner positions at ``corner[i + row*16]`` by the internal corner forces.

    The history of the lane goes on to the end of the step (:class:`lcmchain.materials.law.Step`).
    """
    scales = mode_scales(options.aligned, data, i)
    mx = scaled7(scales, load_eightfold(corner, i))
    my = scaled7(scales, load_eightfold(corner, i + LANES))
    mz = scaled7(scales, load_eightfold(corner, i + 2 * LANES))
    first = place_in_memory(law, options.director, i)
    past = load_past(law, history, first, LANES, step)
    curvature = load_curvature(options.director, shared, i)
    Sbar, E, S33, normal, volume, inverse_height = element_stress(
        mode_vectors(mx, my, mz), data, i, law, past, curvature, options
    )
    xx, yy = places_at_edges(options.aligned, data, i)
    sigma = stress_matrix(Sbar, centre33(options.director, options.curved, Sbar), xx, yy)
    now = evolved_history(law, E.centre, past) + evolved_bending(law, E.zeta, inverse_height, past)
    store_history(law, now, history, first, LANES)
    px = mode_force_components(sigma, mx[0], mx[1], mx[2], mx[3], mx[4], mx[5], mx[6])
    py = mode_force_components(sigma, my[0], my[1], my[2], my[3], my[4], my[5], my[6])
    pz = mode_force_components(sigma, mz[0], mz[1], mz[2], mz[3], mz[4], mz[5], mz[6])
    px = with_normal(options.director, px, normal, S33, 0)
    py = with_normal(options.director, py, normal, S33, 1)
    pz = with_normal(options.director, pz, normal, S33, 2)
    scales = force_scales(options.aligned, data, i, volume)
    store_component(corner, i, scaled7(scales, px))
    store_component(corner, i + LANES, scaled7(scales, py))
    store_component(corner, i + 2 * LANES, scaled7(scales, pz))


@implements(internal_forces, SolidShellData)
def solid_shell_forces(body, positions, corner_force, history):
    """Write the internal forces of all elements of a body, and move its history on.

    Parameters
    ----------
    body : :class:`SolidShellData`.
    positions : (3, node_count) [m].
    corner_force : (block_count * 24 * 16,) or longer [N], row ``3*corner + component``, written.
    history : (block_count * rows * 16,): :data:`CURVATURE_ROWS` unless compaction is measured by
        the director, then those of a law with memory. Empty: neither neighbours nor memory.
    """
    element_forces(
        positions,
        body.corner_node,
        body.corner_run,
        body.element_data,
        corner_force,
        full_history(body.options.director, body.corner_node, history),
        body.law,
        body.options,
        body.quick_data,
        body.quick_options,
        body.general,
        0.0,
        0.0,
    )


@routine
def curvature_rows(director):
    return CURVATURE_ROWS if director is None else 0


@equation
def constants_of_block(options, element_data, block):
    """Return the reference geometry of the elements of a block."""
    first = element_data.start[block]
    return element_data.values[first : first + reference_rows(options) * LANES]


@routine
def reference_rows(options):
    """Return how many rows of constants the elements have."""
    if options.aligned is not None:
        return ALIGNED_ROWS
    return FLAT_ROWS if options.curved is None else CURVED_ROWS


@routine
def full_history(director, corner_node, history):
    """Return the history, zeros for one that is empty."""
    if history.size == 0:
        return np.zeros(corner_node.size // 8 * curvature_rows(director))
    return history


@kernel
def element_forces(
    positions,
    corner_node,
    corner_run,
    element_data,
    corner_force,
    history,
    law,
    options,
    quick_data,
    quick_options,
    general,
    size,
    time,
):
    """Write the internal forces of all elements at the end of a step of a size, at a time [s].

    The size is 0 where a law is asked in no step.
    """
    for block in prange(corner_node.size // (8 * LANES)):
        forces_of_block(
            positions,
            corner_node,
            corner_run,
            element_data,
            corner_force,
            history,
            law,
            options,
            quick_data,
            quick_options,
            general,
            block,
            block,
            Step(size, time),
        )


@equation
def load_corners(positions, corner_node, corner_run, block, corner):
    """Write the positions of the corners of a block (8 * 3 * LANES,): corner, direction, lane."""
    nodes = corner_node[block * 8 * LANES : (block + 1) * 8 * LANES]
    runs = corner_run[block * 8 * RUN_COLUMNS : (block + 1) * 8 * RUN_COLUMNS]
    step = positions.shape[1]
    for c in range(8):
        load_vectors(positions, step, nodes, c * LANES, runs, c, corner, 3 * c * LANES)


@equation
def forces_of_block(
    positions,
    corner_node,
    corner_run,
    element_data,
    corner_force,
    history,
    law,
    options,
    quick_data,
    quick_options,
    general,
    block,
    place,
    step,
):
    """Write the internal forces of the elements of one block to a place in the corner forces.

    step : :class:`lcmchain.materials.law.Step` that led to the positions.
    """
    history_size = history.size // (corner_node.size // (8 * LANES))
    curvature_size = curvature_rows(options.director) * LANES
    # views per block: indices made of a lane and literals are provably not negative, which
    # spares the wrap-around test that would keep the lane loop scalar
    corner = corner_force[place * CORNER_ROWS * LANES : (place + 1) * CORNER_ROWS * LANES]
    own = history[block * history_size : (block + 1) * history_size]
    shared, past = own[:curvature_size], own[curvature_size:]
    memory = memory_of_block(law, own, past)
    load_corners(positions, corner_node, corner_run, block, corner)
    is_general = True
    if quick_data is not None:
        is_general = quick_data.start[block] == GENERAL
        if not is_general:
            data = constants_of_block(quick_options, quick_data, block)
            for lane in range(LANES):
                element_in_lane(lane, corner, data, law, memory, shared, quick_options, step)
    if general is not None:
        if is_general:
            data = constants_of_block(options, element_data, block)
            for lane in range(LANES):
                element_in_lane(lane, corner, data, law, memory, shared, options, step)
