"""A law of compaction whose strain is a map of thickness and shear, ε(E33, g), and its chain rule.

With W33(ε), S = dW33/dε and C = dS/dε, stress and tangent follow by the chain rule,

    S33 = S ε_E,  S12 += S ε_g,  C33 = C ε_E² + S ε_EE,  C12 += C ε_g² + S ε_gg.

The tangent that stabilises the element (Eq. 18) is C m² in place of C33, with the stretch m(g) of
the map: as large, without the second derivatives of ε. The same functions serve kernels and, as
plain Python, arrays.
"""

from __future__ import annotations

from lcmchain.dispatch import implements
from lcmchain.jit import equation
from lcmchain.materials.law import TangentCoupling
from lcmchain.materials.shear_compaction import (
    StrainMap,
    curvature_at_shear,
    pressed,
    shear_tangents,
    slope_at_shear,
    stabilising_at_shear,
)


@implements(pressed, StrainMap)
@equation
def mapped_pressure(m, S33, C33, S12, C12):
    """Return S33, C33, S12 and C12 with what S and C at ε make of the shear stress."""
    return (
        m.E * S33,
        m.E * m.E * C33 + m.EE * S33,
        S12 + m.g * S33,
        C12 + m.gg * S33 + m.g * m.g * C33,
    )


@implements(stabilising_at_shear, StrainMap)
@equation
def mapped_stabilising(m, own33, C33):
    """Return the stabilising C33."""
    return m.m * m.m * C33


@implements(slope_at_shear, StrainMap)
@equation
def mapped_slope(m, slope33):
    """Return the derivative of the stabilising C33 with E33."""
    return m.m * m.m * m.E * slope33


@implements(curvature_at_shear, StrainMap)
@equation
def mapped_curvature(m, slope33, curvature33):
    """Return the second derivative of the stabilising C33 with E33."""
    return m.m * m.m * (m.E * m.E * curvature33 + m.EE * slope33)


@implements(shear_tangents, StrainMap)
@equation
def mapped_coupling(m, S33, C33, slope33, curvature33):
    """Return dS33/dg, and dC33/dg, d²C33/dE33dg and d²C33/dg² of the stabilising C33."""
    square, change = m.m * m.m, 2.0 * m.m * m.m_g  # of m² with g
    bent = 2.0 * (m.m_g * m.m_g + m.m * m.m_gg)
    return TangentCoupling(
        m.E * m.g * C33 + m.Eg * S33,
        square * m.g * slope33 + change * C33,
        square * (m.E * m.g * curvature33 + m.Eg * slope33) + change * m.E * slope33,
        square * (m.g * m.g * curvature33 + m.gg * slope33)
        + 2.0 * change * m.g * slope33
        + bent * C33,
    )
