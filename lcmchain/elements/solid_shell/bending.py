"""Bending stiffness at the reference thickness: an option beside the published strains.

The strain linear in ζ, E11^ζ = a1·a6, grows with the director: an element that is compacted to the
thickness stretch λ bends with λ² of its stiffness. Here the strains linear in ζ (ζ, ηζ, ξζ) are
divided by λ and those quadratic in it (ζζ) by λ², λ² = 1 + 2 E33 of the centre. The energy of
bending then depends on the curvature alone, and the forces are its exact derivative: the strains of
bending pass to the centre strain E33 what a change of the thickness takes, so that S33 has no part
of the bending any more. In the reference λ is 1, and strains that are zero stay so.
"""

from __future__ import annotations

import math

from lcmchain.elements.solid_shell.equations import Taylor, scaled6
from lcmchain.jit import equation


@equation
def inverse_stretch(E33):
    """Return 1/λ and 1/λ² of the thickness stretch."""
    r = 1.0 / (1.0 + 2.0 * E33)
    return math.sqrt(r), r


@equation
def at_reference_thickness(E):
    """Return the strains with those of the bending divided by their powers of λ."""
    s, r = inverse_stretch(E.centre[2])
    return Taylor(
        E.centre,
        scaled6(s, E.zeta),
        scaled6(r, E.zeta2),
        E.xi,
        E.eta,
        scaled6(s, E.eta_zeta),
        scaled6(s, E.xi_zeta),
    )


@equation
def work6(S, E):
    return S[0] * E[0] + S[1] * E[1] + S[2] * E[2] + S[3] * E[3] + S[4] * E[4] + S[5] * E[5]


@equation
def at_reference_thickness_stress(E, S):
    """Return the transpose of the derivative of :func:`at_reference_thickness`, for resultants S.

    ``E`` are the strains that it returned.
    """
    s, r = inverse_stretch(E.centre[2])
    linear = work6(S.zeta, E.zeta) + work6(S.eta_zeta, E.eta_zeta) + work6(S.xi_zeta, E.xi_zeta)
    c = S.centre
    c33 = c[2] - r * (linear + 2.0 * work6(S.zeta2, E.zeta2))
    return Taylor(
        (c[0], c[1], c33, c[3], c[4], c[5]),
        scaled6(s, S.zeta),
        scaled6(r, S.zeta2),
        S.xi,
        S.eta,
        scaled6(s, S.eta_zeta),
        scaled6(s, S.xi_zeta),
    )
