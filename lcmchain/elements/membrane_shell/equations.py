"""Superimposed membrane and rotation-free shell triangle: the 2D approach, one function each.

The conventional approach that Schäfer, Mitsch and Kärger compare with (sections 3.2.1, 3.3, 4)
superimposes membrane triangles (M3D3) and shell triangles (S3R), which decouples bending from the
membrane. Here both parts share the mid-surface nodes and their translations:

- Membrane: constant strain triangle, Green-Lagrange strains in the reference fibre axes,
  S11 = C11 E11, S22 = C22 E22 and S12 from the shear polynomial of the solid-shell, Eq. (21).
- Shell: the curvature of the quadratic surface through the six nodes of the triangle and its
  neighbours (``patch.py``), h_ab its second derivatives along the reference fibres,
  κ_ab = h_ab·n with the unit normal n of the triangle itself, and the energy per area
  t³/24 (C11^B κ11² + C22^B κ22² + C12^B (2κ12)²), Eq. (25).

Rotation-free instead of S3R with rotations because the paper's solver needs a rotational inertia,
and a step size that goes with it, for degrees of freedom that carry a bending stiffness 1e-3 of the
membrane's; here all nodes have the translations, masses, contact and stable step of the
solid-shell's. The normal stays normal: there is no transverse shear, which stiffens tight bends of
a fabric (manual: membrane-shell), and κ = h·n counts sin θ/l for a turn θ over the length l.

It has no thickness direction: neither thickness nor what follows from it is predicted.

Symbols: a1, a2 = deformed fibre directions (columns of the deformation gradient), N = a1 × a2,
r = 1/N·N, u_k = x_k - x_0 for the other five nodes of the patch.
"""

from __future__ import annotations

from lcmchain.elements.vectors import combination2, cross, dot, plus, scaled
from lcmchain.jit import equation
from lcmchain.materials.law import plane_bending_stiffness, plane_response


@equation
def membrane_strain(a1, a2):
    """Return Green-Lagrange (E11, E22, 2E12) in the reference fibre axes."""
    return 0.5 * (dot(a1, a1) - 1.0), 0.5 * (dot(a2, a2) - 1.0), dot(a1, a2)


@equation
def second_derivative(w, u1, u2, u3, u4, u5):
    """Return h = Σ w_k u_k of one row of weights."""
    return plus(w[0], u1, plus(w[1], u2, plus(w[2], u3, combination2(w[3], u4, w[4], u5))))


@equation
def unit_moment(stiffness, h, N, r):
    """Return M/|N| of the moment M = D κ, κ = h·n, so that M n = (M/|N|) N without a root."""
    return stiffness * dot(h, N) * r


@equation
def surface_christoffel(h, a1, a2, N, r):
    """Return (h·a^1, h·a^2) with the dual base of a1, a2: h = Γ^b a_b + κ n."""
    return dot(h, cross(a2, N)) * r, dot(h, cross(N, a1)) * r


@equation
def membrane_resultants(volume, S11, S22, S12, a1, a2):
    """Return the gradients of the membrane energy with respect to a1 and a2."""
    return (
        combination2(volume * S11, a1, volume * S12, a2),
        combination2(volume * S12, a1, volume * S22, a2),
    )


@equation
def moment_vector(m, h11, h22, h12):
    """Return Σ m_ab h_ab."""
    return plus(m[0], h11, combination2(m[1], h22, m[2], h12))


@equation
def normal_weight(m, weights, k):
    """Return Σ m_ab d_ab,k of one node."""
    return m[0] * weights[0][k] + m[1] * weights[1][k] + m[2] * weights[2][k]


@equation
def patch_forces(u, gradient, weights, area, law, thickness):
    """Return the internal forces on nodes 1 ... 5 of a patch; node 0 takes minus their sum.

    They are the exact derivative of the energy: the derivative of κ_ab = h_ab·n is
    δκ_ab = n·(Σ_k d_ab,k δu_k - Γ^c_ab δa_c), as δn = -a^c (n·δa_c).

    Parameters
    ----------
    u : u1 ... u5. gradient : derivatives (1, 2) of the shape functions of nodes 1 and 2.
    weights : rows d_11, d_22, 2 d_12 of nodes 1 ... 5. area [m²], thickness [m].
    law : see :mod:`lcmchain.materials.law`.
    """
    u1, u2, u3, u4, u5 = u
    g1, g2 = gradient
    a1 = combination2(g1[0], u1, g2[0], u2)
    a2 = combination2(g1[1], u1, g2[1], u2)
    N = cross(a1, a2)
    r = 1.0 / dot(N, N)

    E11, E22, g12 = membrane_strain(a1, a2)
    S, _ = plane_response(law, E11, E22, g12)
    volume = area * thickness
    p1, p2 = membrane_resultants(volume, S[0], S[1], S[2], a1, a2)

    h11 = second_derivative(weights[0], u1, u2, u3, u4, u5)
    h22 = second_derivative(weights[1], u1, u2, u3, u4, u5)
    h12 = second_derivative(weights[2], u1, u2, u3, u4, u5)
    c = volume * thickness * thickness / 12.0
    B = plane_bending_stiffness(law)
    m = (
        unit_moment(c * B[0], h11, N, r),
        unit_moment(c * B[1], h22, N, r),
        unit_moment(c * B[2], h12, N, r),
    )
    G1, G2 = surface_christoffel(moment_vector(m, h11, h22, h12), a1, a2, N, r)
    q1, q2 = plus(-G1, N, p1), plus(-G2, N, p2)
    return (
        plus(normal_weight(m, weights, 0), N, combination2(g1[0], q1, g1[1], q2)),
        plus(normal_weight(m, weights, 1), N, combination2(g2[0], q1, g2[1], q2)),
        scaled(normal_weight(m, weights, 2), N),
        scaled(normal_weight(m, weights, 3), N),
        scaled(normal_weight(m, weights, 4), N),
    )
