"""Q1STs solid-shell element for textiles: its equations, one small function each.

Source: Schäfer, Mitsch, Kärger, "3D solid-shell element for macroscopic composite forming
simulation enabling thickness prediction"; equation numbers in round brackets are the paper's.

Everything is written in the seven mode vectors a1 ... a7 of the element, the coefficients of

    x = a0 + ξ a1 + η a2 + ζ a3 + ξη a4 + ηζ a5 + ξζ a6 + ξηζ a7.

Every Taylor coefficient of the covariant Green-Lagrange strain, ANS included, is a sum of products
a_k·a_l minus its value in the reference. Therefore the forces on the mode vectors are
p_k = Σ_l Σ_kl a_l with one symmetric matrix Σ of generalised stresses (:func:`stress_matrix`), and
no 6x24 operator matrix is built.

Symbols: E, S are Voigt tuples (11, 22, 33, 12, 23, 13) with engineering shear strain; a bar
(``Ebar``, ``Sbar``) marks covariant components. ``K`` = (∂ξ_i/∂X_a) maps to material axes. A node
has the signs (ξ, η, ζ) of VTK's hexahedron: 0(---) 1(+--) 2(++-) 3(-+-) and 4 ... 7 above.
"""

from __future__ import annotations

from typing import NamedTuple

from lcmchain.elements.vectors import combination2, cross, dot, plus, scaled
from lcmchain.jit import equation

THIRD = 1.0 / 3.0
NINTH = 1.0 / 9.0
EIGHTH = (0.125,) * 7


class Taylor(NamedTuple):
    """Taylor coefficients of a strain about the element centre, Eq. (10), without ξη."""

    centre: tuple  # E^0
    zeta: tuple  # E^ζ
    zeta2: tuple  # E^ζζ
    xi: tuple  # E^ξ
    eta: tuple  # E^η
    eta_zeta: tuple  # E^ηζ
    xi_zeta: tuple  # E^ξζ


# --- kinematics ----------------------------------------------------------------------------------


@equation
def face_differences(x0, x1, x2, x3):
    """Return 4 times the ξ-, η- and ξη-coefficient of one face, and 2 (x3 - x0)."""
    lower, upper, side = x1 - x0, x2 - x3, x3 - x0
    twist = upper - lower
    return lower + upper, 2.0 * side + twist, twist, 2.0 * side


@equation
def eightfold_modes(x0, x1, x2, x3, x4, x5, x6, x7):
    """Return one Cartesian component of 8 a1 ... 8 a7 from the nodes' (Hadamard transform, Eq. 5).

    Of differences alone: a position far from the origin costs no digits.
    """
    b_xi, b_eta, b_xi_eta, b_side = face_differences(x0, x1, x2, x3)
    t_xi, t_eta, t_xi_eta, t_side = face_differences(x4, x5, x6, x7)
    xi_zeta = t_xi - b_xi
    return (
        t_xi + b_xi,
        t_eta + b_eta,
        4.0 * (x4 - x0) + (xi_zeta + (t_side - b_side)),
        t_xi_eta + b_xi_eta,
        t_eta - b_eta,
        xi_zeta,
        t_xi_eta - b_xi_eta,
    )


@equation
def mode_components(x0, x1, x2, x3, x4, x5, x6, x7):
    """Return one Cartesian component of a1 ... a7 from the nodes'."""
    return scaled7(EIGHTH, eightfold_modes(x0, x1, x2, x3, x4, x5, x6, x7))


@equation
def scaled7(s, p):
    return (
        s[0] * p[0],
        s[1] * p[1],
        s[2] * p[2],
        s[3] * p[3],
        s[4] * p[4],
        s[5] * p[5],
        s[6] * p[6],
    )


@equation
def face_forces(mean, xi, eta, xi_eta):
    """Return the forces on the four nodes of a face from those on its coefficients."""
    along, across, turned, twisted = mean - eta, mean + eta, xi - xi_eta, xi + xi_eta
    return along - turned, along + turned, across + twisted, across - twisted


@equation
def node_components(p1, p2, p3, p4, p5, p6, p7):
    """Return one component of the nodal forces: the transpose of :func:`eightfold_modes`."""
    b = face_forces(-p3, p1 - p6, p2 - p5, p4 - p7)
    t = face_forces(p3, p1 + p6, p2 + p5, p4 + p7)
    return (b[0], b[1], b[2], b[3], t[0], t[1], t[2], t[3])


@equation
def covariant_products(a, xx, yy):
    """Return the Taylor coefficients of g_i·g_j-products after ANS, Eqs. (6)-(8) and (10).

    Covariant strains are these minus the same products of the reference element. The transverse
    normal is collocated at (±1, ±1, 0), the transverse shears at (±1, 0, ±1) and (0, ±1, ±1).
    Components that vanish identically are left out: the order is that of the tuples below.

    ``xx``, ``yy`` are the squares of ξ and η at these places: 1, unless a1 ... a7 are coefficients
    in other coordinates.
    """
    a1, a2, a3, a4, a5, a6, a7 = a
    tilt23 = dot(a3, a5) + xx * dot(a6, a7)
    tilt13 = dot(a3, a6) + yy * dot(a5, a7)
    return Taylor(
        centre=(
            0.5 * dot(a1, a1),
            0.5 * dot(a2, a2),
            0.5 * (dot(a3, a3) + yy * dot(a5, a5) + xx * (dot(a6, a6) + yy * dot(a7, a7))),
            dot(a1, a2),
            dot(a2, a3) + xx * dot(a4, a6),
            dot(a1, a3) + yy * dot(a4, a5),
        ),
        zeta=(  # 11 22 12 23 13
            dot(a1, a6),
            dot(a2, a5),
            dot(a1, a5) + dot(a2, a6),
            tilt23,
            tilt13,
        ),
        zeta2=(0.5 * dot(a6, a6), 0.5 * dot(a5, a5), dot(a5, a6)),  # 11 22 12
        xi=(  # 22 33 12 23
            dot(a2, a4),
            tilt13,
            dot(a1, a4),
            dot(a2, a6) + dot(a3, a4),
        ),
        eta=(  # 11 33 12 13
            dot(a1, a4),
            tilt23,
            dot(a2, a4),
            dot(a1, a5) + dot(a3, a4),
        ),
        eta_zeta=(  # 11 12 13
            dot(a1, a7) + dot(a4, a6),
            dot(a2, a7) + dot(a4, a5),
            dot(a3, a7) + dot(a5, a6),
        ),
        xi_zeta=(  # 22 12 23
            dot(a2, a7) + dot(a4, a5),
            dot(a1, a7) + dot(a4, a6),
            dot(a3, a7) + dot(a5, a6),
        ),
    )


@equation
def stress_matrix(Sbar, n33, xx, yy):
    """Return Σ_kl (k ≤ l, the entries that do not vanish) from covariant stress resultants.

    ``Sbar`` holds, in the layout of :func:`covariant_products`, the derivatives of the energy with
    respect to the covariant strain coefficients. Then p_k = Σ_l Σ_kl a_l, the internal forces
    of Eqs. (15) and (16) on the mode vectors. ``n33`` is that of the centre, ``None`` where it
    vanishes.
    """
    n11, n22, _, n12, n23, n13 = Sbar.centre
    z11, z22, z12, z23, z13 = Sbar.zeta
    q11, q22, q12 = Sbar.zeta2
    x22, x33, x12, x23 = Sbar.xi
    e11, e33, e12, e13 = Sbar.eta
    ez11, ez12, ez13 = Sbar.eta_zeta
    xz22, xz12, xz23 = Sbar.xi_zeta
    twist1, twist2, twist3 = ez11 + xz12, ez12 + xz22, ez13 + xz23
    tilt23, tilt13 = z23 + e33, z13 + x33
    return (
        (n11, n12, n13, x12 + e11, z12 + e13, z11, twist1),
        (n22, n23, x22 + e12, z22, z12 + x23, twist2),
        (n33, x23 + e13, tilt23, tilt13, twist3),
        (yy * n13 + twist2, xx * n23 + twist1),  # 45 46; 44 = 47 = 0
        (with_part(q22, yy, n33), q12 + twist3, yy * tilt13),  # 55 56 57
        (with_part(q11, xx, n33), xx * tilt23),  # 66 67
        part(xx * yy, n33),  # 77
    )


@equation
def part(factor, value):
    """Return a product; ``None`` of ``None``."""
    if value is None:
        return None
    return factor * value


@equation
def with_part(total, factor, value):
    """Return a sum and a product; ``value`` is ``None`` where there is none."""
    if value is None:
        return total
    return total + factor * value


@equation
def mode_force_components(sigma, a1, a2, a3, a4, a5, a6, a7):
    """Return one component of p_k = Σ_l Σ_kl a_l."""
    s1, s2, s3, s4, s5, s6, s77 = sigma
    s11, s12, s13, s14, s15, s16, s17 = s1
    s22, s23, s24, s25, s26, s27 = s2
    s33, s34, s35, s36, s37 = s3
    s45, s46 = s4
    s55, s56, s57 = s5
    s66, s67 = s6
    return (
        s11 * a1 + s12 * a2 + s13 * a3 + s14 * a4 + s15 * a5 + s16 * a6 + s17 * a7,
        s12 * a1 + s22 * a2 + s23 * a3 + s24 * a4 + s25 * a5 + s26 * a6 + s27 * a7,
        with_part(s13 * a1 + s23 * a2 + s34 * a4 + s35 * a5 + s36 * a6 + s37 * a7, a3, s33),
        s14 * a1 + s24 * a2 + s34 * a3 + s45 * a5 + s46 * a6,
        s15 * a1 + s25 * a2 + s35 * a3 + s45 * a4 + s55 * a5 + s56 * a6 + s57 * a7,
        s16 * a1 + s26 * a2 + s36 * a3 + s46 * a4 + s56 * a5 + s66 * a6 + s67 * a7,
        with_part(s17 * a1 + s27 * a2 + s37 * a3 + s57 * a5 + s67 * a6, a7, s77),
    )


# --- compaction by the normal thickness ----------------------------------------------------------


@equation
def normal_compaction(a1, a2, a3, inverse_height):
    """Return E33 = ½((a3·n)²/h² − 1) and its gradients with respect to a1, a2, a3.

    n is the unit normal of a1 × a2 and h the reference value of a3·n. The published E33 measures
    the director's length instead and lets it tilt under pressure (manual: departures).
    """
    c = cross(a1, a2)
    r = 1.0 / dot(c, c)
    D = dot(a3, c)
    w = inverse_height * inverse_height * D * r
    q = combination2(w, a3, -w * D * r, c)
    E33 = 0.5 * (w * D - 1.0)
    return E33, cross(a2, q), cross(q, a1), scaled(w, c)


@equation
def curvature_compaction(curvature, zeta):
    """Return the part of E33 that a3·n misses where the element is curved (``curvature.py``).

    ``zeta`` holds the covariant products a1·a6, a2·a5, a1·a5 + a2·a6 first.
    """
    return curvature[0] * zeta[0] + curvature[1] * zeta[1] + curvature[2] * zeta[2] - curvature[3]


# --- covariant <-> material axes, flat reference (K constant over the element) --------------------


class FlatFrame(NamedTuple):
    """Change of axes of an element whose reference is a parallelogram of constant thickness.

    ``P`` (3x3) maps the covariant (11, 22, 12), ``Q`` (2x2) the covariant (23, 13), and
    ``inverse_height`` = ∂ζ/∂X3 squared the covariant 33.
    """

    P: tuple
    Q: tuple
    inverse_height: float


@equation
def plane(P, e11, e22, g12):
    """Return material (E11, E22, 2E12) of covariant ones."""
    return (
        P[0] * e11 + P[1] * e22 + P[2] * g12,
        P[3] * e11 + P[4] * e22 + P[5] * g12,
        P[6] * e11 + P[7] * e22 + P[8] * g12,
    )


@equation
def plane_transposed(P, s11, s22, s12):
    """Return covariant stress resultants (11, 22, 12) of material ones."""
    return (
        P[0] * s11 + P[3] * s22 + P[6] * s12,
        P[1] * s11 + P[4] * s22 + P[7] * s12,
        P[2] * s11 + P[5] * s22 + P[8] * s12,
    )


@equation
def transverse(Q, g23, g13):
    """Return material (2E23, 2E13) of covariant ones."""
    return Q[0] * g23 + Q[1] * g13, Q[2] * g23 + Q[3] * g13


@equation
def transverse_transposed(Q, s23, s13):
    return Q[0] * s23 + Q[2] * s13, Q[1] * s23 + Q[3] * s13


@equation
def flat_material_strain(frame, Ebar):
    """Return Ê = T Ē, term by term, for a constant T."""
    P, Q, h33 = frame.P, frame.Q, frame.inverse_height * frame.inverse_height
    c, z, q, x, e, ez, xz = Ebar
    p0 = plane(P, c[0], c[1], c[3])
    t0 = transverse(Q, c[4], c[5])
    pz = plane(P, z[0], z[1], z[2])
    tz = transverse(Q, z[3], z[4])
    pq = plane(P, q[0], q[1], q[2])
    # 11 and 13 have no ξ-, ηη.. part: the products with zero are written out of the sums
    px = (
        P[1] * x[0] + P[2] * x[2],
        P[4] * x[0] + P[5] * x[2],
        P[7] * x[0] + P[8] * x[2],
    )
    pe = (
        P[0] * e[0] + P[2] * e[2],
        P[3] * e[0] + P[5] * e[2],
        P[6] * e[0] + P[8] * e[2],
    )
    pez = (
        P[0] * ez[0] + P[2] * ez[1],
        P[3] * ez[0] + P[5] * ez[1],
        P[6] * ez[0] + P[8] * ez[1],
    )
    pxz = (
        P[1] * xz[0] + P[2] * xz[1],
        P[4] * xz[0] + P[5] * xz[1],
        P[7] * xz[0] + P[8] * xz[1],
    )
    return Taylor(
        centre=(p0[0], p0[1], h33 * c[2], p0[2], t0[0], t0[1]),
        zeta=(pz[0], pz[1], 0.0, pz[2], tz[0], tz[1]),
        zeta2=(pq[0], pq[1], 0.0, pq[2], 0.0, 0.0),
        xi=(px[0], px[1], h33 * x[1], px[2], Q[0] * x[3], Q[2] * x[3]),
        eta=(pe[0], pe[1], h33 * e[1], pe[2], Q[1] * e[3], Q[3] * e[3]),
        eta_zeta=(pez[0], pez[1], 0.0, pez[2], Q[1] * ez[2], Q[3] * ez[2]),
        xi_zeta=(pxz[0], pxz[1], 0.0, pxz[2], Q[0] * xz[2], Q[2] * xz[2]),
    )


@equation
def flat_covariant_stress(frame, S):
    """Return the covariant resultants Tᵀ S, the transpose of :func:`flat_material_strain`."""
    P, Q, h33 = frame.P, frame.Q, frame.inverse_height * frame.inverse_height
    c, z, q, x, e, ez, xz = S
    p0 = plane_transposed(P, c[0], c[1], c[3])
    t0 = transverse_transposed(Q, c[4], c[5])
    pz = plane_transposed(P, z[0], z[1], z[3])
    tz = transverse_transposed(Q, z[4], z[5])
    pq = plane_transposed(P, q[0], q[1], q[3])
    return Taylor(
        centre=(p0[0], p0[1], h33 * c[2], p0[2], t0[0], t0[1]),
        zeta=(pz[0], pz[1], pz[2], tz[0], tz[1]),
        zeta2=(pq[0], pq[1], pq[2]),
        xi=(
            P[1] * x[0] + P[4] * x[1] + P[7] * x[3],
            h33 * x[2],
            P[2] * x[0] + P[5] * x[1] + P[8] * x[3],
            Q[0] * x[4] + Q[2] * x[5],
        ),
        eta=(
            P[0] * e[0] + P[3] * e[1] + P[6] * e[3],
            h33 * e[2],
            P[2] * e[0] + P[5] * e[1] + P[8] * e[3],
            Q[1] * e[4] + Q[3] * e[5],
        ),
        eta_zeta=(
            P[0] * ez[0] + P[3] * ez[1] + P[6] * ez[3],
            P[2] * ez[0] + P[5] * ez[1] + P[8] * ez[3],
            Q[1] * ez[4] + Q[3] * ez[5],
        ),
        xi_zeta=(
            P[1] * xz[0] + P[4] * xz[1] + P[7] * xz[3],
            P[2] * xz[0] + P[5] * xz[1] + P[8] * xz[3],
            Q[0] * xz[4] + Q[2] * xz[5],
        ),
    )


# --- covariant <-> material axes, curved or skewed reference (K to first order) -------------------


class CurvedFrame(NamedTuple):
    """K = (∂ξ_i/∂X_a) at the centre and its derivatives along ξ, η, ζ, each a 3x3 of tuples."""

    K: tuple
    K_xi: tuple
    K_eta: tuple
    K_zeta: tuple


@equation
def product_with_symmetric(E, K):
    """Return E K for a Voigt strain E (engineering shear) and a 3x3 K."""
    e12, e23, e13 = 0.5 * E[3], 0.5 * E[4], 0.5 * E[5]
    k1, k2, k3 = K
    return (
        plus(E[0], k1, combination2(e12, k2, e13, k3)),
        plus(e12, k1, combination2(E[1], k2, e23, k3)),
        plus(e13, k1, combination2(e23, k2, E[2], k3)),
    )


@equation
def transposed_product(K, M):
    """Return Kᵀ M as rows."""
    k1, k2, k3 = K
    m1, m2, m3 = M
    return (
        plus(k1[0], m1, combination2(k2[0], m2, k3[0], m3)),
        plus(k1[1], m1, combination2(k2[1], m2, k3[1], m3)),
        plus(k1[2], m1, combination2(k2[2], m2, k3[2], m3)),
    )


@equation
def rotated(K, E):
    """Return Ê = T Ē as Ê_ab = K_ia Ē_ij K_jb (Voigt in, Voigt out)."""
    R = transposed_product(K, product_with_symmetric(E, K))
    return (R[0][0], R[1][1], R[2][2], 2.0 * R[0][1], 2.0 * R[1][2], 2.0 * R[0][2])


@equation
def rotated_change(K, dK, E):
    """Return T' Ē, the first-order change of T along the direction in which K changes by dK."""
    R = transposed_product(dK, product_with_symmetric(E, K))
    return (
        2.0 * R[0][0],
        2.0 * R[1][1],
        2.0 * R[2][2],
        2.0 * (R[0][1] + R[1][0]),
        2.0 * (R[1][2] + R[2][1]),
        2.0 * (R[0][2] + R[2][0]),
    )


@equation
def symmetric_rows(S):
    return ((S[0], S[3], S[5]), (S[3], S[1], S[4]), (S[5], S[4], S[2]))


@equation
def rotated_back(K, S):
    """Return Tᵀ S as K_ia S_ab K_jb: the transpose of :func:`rotated`."""
    s1, s2, s3 = symmetric_rows(S)
    k1, k2, k3 = K
    m1 = (dot(s1, k1), dot(s2, k1), dot(s3, k1))
    m2 = (dot(s1, k2), dot(s2, k2), dot(s3, k2))
    m3 = (dot(s1, k3), dot(s2, k3), dot(s3, k3))
    return (dot(k1, m1), dot(k2, m2), dot(k3, m3), dot(k1, m2), dot(k2, m3), dot(k1, m3))


@equation
def rotated_back_change(K, dK, S):
    """Return T'ᵀ S: the transpose of :func:`rotated_change`."""
    s1, s2, s3 = symmetric_rows(S)
    k1, k2, k3 = K
    d1, d2, d3 = dK
    m1 = (dot(s1, k1), dot(s2, k1), dot(s3, k1))
    m2 = (dot(s1, k2), dot(s2, k2), dot(s3, k2))
    m3 = (dot(s1, k3), dot(s2, k3), dot(s3, k3))
    return (
        2.0 * dot(d1, m1),
        2.0 * dot(d2, m2),
        2.0 * dot(d3, m3),
        dot(d1, m2) + dot(d2, m1),
        dot(d2, m3) + dot(d3, m2),
        dot(d1, m3) + dot(d3, m1),
    )


@equation
def sum6(a, b):
    return (a[0] + b[0], a[1] + b[1], a[2] + b[2], a[3] + b[3], a[4] + b[4], a[5] + b[5])


@equation
def scaled6(s, a):
    return (s * a[0], s * a[1], s * a[2], s * a[3], s * a[4], s * a[5])


@equation
def curved_material_strain(frame, Ebar):
    """Return Ê of Eq. (10) with T ≈ T⁰ + ξT^ξ + ηT^η + ζT^ζ, terms of second order in T dropped."""
    K, K_xi, K_eta, K_zeta = frame
    c, z, q, x, e, ez, xz = Ebar
    z6 = (z[0], z[1], 0.0, z[2], z[3], z[4])
    q6 = (q[0], q[1], 0.0, q[2], 0.0, 0.0)
    x6 = (0.0, x[0], x[1], x[2], x[3], 0.0)
    e6 = (e[0], 0.0, e[1], e[2], 0.0, e[3])
    ez6 = (ez[0], 0.0, 0.0, ez[1], 0.0, ez[2])
    xz6 = (0.0, xz[0], 0.0, xz[1], xz[2], 0.0)
    return Taylor(
        centre=rotated(K, c),
        zeta=sum6(rotated(K, z6), rotated_change(K, K_zeta, c)),
        zeta2=sum6(rotated(K, q6), rotated_change(K, K_zeta, z6)),
        xi=sum6(rotated(K, x6), rotated_change(K, K_xi, c)),
        eta=sum6(rotated(K, e6), rotated_change(K, K_eta, c)),
        eta_zeta=sum6(
            rotated(K, ez6),
            sum6(rotated_change(K, K_eta, z6), rotated_change(K, K_zeta, e6)),
        ),
        xi_zeta=sum6(
            rotated(K, xz6),
            sum6(rotated_change(K, K_xi, z6), rotated_change(K, K_zeta, x6)),
        ),
    )


@equation
def curved_covariant_stress(frame, S):
    """Return the covariant resultants: the transpose of :func:`curved_material_strain`."""
    K, K_xi, K_eta, K_zeta = frame
    c, z, q, x, e, ez, xz = S
    c6 = sum6(
        sum6(rotated_back(K, c), rotated_back_change(K, K_zeta, z)),
        sum6(rotated_back_change(K, K_xi, x), rotated_back_change(K, K_eta, e)),
    )
    z6 = sum6(
        sum6(rotated_back(K, z), rotated_back_change(K, K_zeta, q)),
        sum6(rotated_back_change(K, K_eta, ez), rotated_back_change(K, K_xi, xz)),
    )
    q6 = rotated_back(K, q)
    x6 = sum6(rotated_back(K, x), rotated_back_change(K, K_zeta, xz))
    e6 = sum6(rotated_back(K, e), rotated_back_change(K, K_zeta, ez))
    ez6 = rotated_back(K, ez)
    xz6 = rotated_back(K, xz)
    return Taylor(
        centre=c6,
        zeta=(z6[0], z6[1], z6[3], z6[4], z6[5]),
        zeta2=(q6[0], q6[1], q6[3]),
        xi=(x6[1], x6[2], x6[3], x6[4]),
        eta=(e6[0], e6[2], e6[3], e6[5]),
        eta_zeta=(ez6[0], ez6[3], ez6[5]),
        xi_zeta=(xz6[1], xz6[3], xz6[4]),
    )


@equation
def unit_in_plane_shear(K):
    """Return the material strain of a covariant 2E12 = 1 at the centre, and the row that reads it.

    The row gives 2E12 of a material strain; a1 and a2 have no part along the normal, so that only
    the in-plane block of K has to be inverted.
    """
    k1, k2, _ = K
    shear = k1[0] * k2[1] + k1[1] * k2[0]
    strain = (
        k1[0] * k2[0],
        k1[1] * k2[1],
        k1[2] * k2[2],
        shear,
        k1[1] * k2[2] + k1[2] * k2[1],
        k1[0] * k2[2] + k1[2] * k2[0],
    )
    r = 1.0 / (k1[0] * k2[1] - k1[1] * k2[0])
    r2 = r * r
    row = (-2.0 * r2 * k1[1] * k2[1], -2.0 * r2 * k1[0] * k2[0], r2 * shear)
    return strain, row


@equation
def scaled_in_plane_shear(unit, factor, E):
    """Weight the in-plane shear of a material strain by ``factor`` in the covariant axes."""
    strain, row = unit
    s = (factor - 1.0) * (row[0] * E[0] + row[1] * E[1] + row[2] * E[3])
    return sum6(E, scaled6(s, strain))


@equation
def scaled_in_plane_shear_stress(unit, factor, S):
    """Return the transpose of :func:`scaled_in_plane_shear` for a stress."""
    t, row = unit
    s = t[0] * S[0] + t[1] * S[1] + t[2] * S[2] + t[3] * S[3] + t[4] * S[4] + t[5] * S[5]
    s = (factor - 1.0) * s
    return (S[0] + s * row[0], S[1] + s * row[1], S[2], S[3] + s * row[2], S[4], S[5])


# --- reference along the fibres -------------------------------------------------------------------


class Lengths(NamedTuple):
    """What a rectangle along the material axes needs to be computed in its material coordinates.

    With X, Y, Z in place of ξ, η, ζ the mode vectors are K11 a1, K22 a2, a3/h, K11 K22 a4 and so
    on. Covariant strains are material ones then, T is the identity, and the element's lengths are
    in the places and moments of X, Y, Z alone.

    xx, yy : X², Y² at the edges. modes : of the eightfold modes. forces : modes times 8 J⁰.
    curvature : of the products in :func:`curvature_compaction`. moments : see :class:`Moments`;
    those over the thickness without the factors of the integration points.
    """

    xx: float
    yy: float
    modes: tuple
    forces: tuple
    curvature: tuple
    moments: tuple


# --- stress resultants ---------------------------------------------------------------------------


class Moments(NamedTuple):
    """Means over the volume that weight the Taylor terms in Eqs. (15) and (16)."""

    zeta: float  # <ζ²>
    zeta2: float  # <ζ⁴>
    xi: float  # <ξ²>
    eta: float  # <η²>
    eta_zeta: float  # <η²ζ²>
    xi_zeta: float  # <ξ²ζ²>
    cross: float  # of the terms that couple E^0 and E^ζζ


@equation
def condensed_enhanced_strain(bending_stress33, tangent33):
    """Return ζ-linear enhanced strain B_e α_e (33) from one update of Eq. (17).

    R_α = 0 is linear in α_e: the stress along ζ is linearised with the tangent at the centre, so
    that the single explicit update of the paper is exact from any start and α_e is no history.
    """
    return -bending_stress33 / tangent33


@equation
def thickness_resultants(coupled, moments, S_centre, S_zeta, S_zeta2):
    """Return the means over ζ of S*, ζS*, ζ²S* that Eq. (15) multiplies with B^0, B^ζ, B^ζζ.

    ``coupled`` is ``None`` where the terms that couple E^0 and E^ζζ are dropped.
    """
    zeta = scaled6(moments.zeta, S_zeta)
    zeta2 = scaled6(moments.zeta2, S_zeta2)
    if coupled is None:
        return S_centre, zeta, zeta2
    return (
        sum6(S_centre, scaled6(moments.cross, S_zeta2)),
        zeta,
        sum6(scaled6(moments.cross, S_centre), zeta2),
    )
