"""Whether the shear of a sheet may stiffen so much that its wave comes to govern the step."""

from __future__ import annotations

from typing import Any

import numpy as np

from lcmchain.elements.family import Condition

# Part of the governing ω² from which on the shear wave is followed in every chunk of steps: within
# a chunk the tangent of a law that locks may grow several times.
SHEAR_SHARE = 0.1


def shear_may_stiffen(body: Any, condition: Condition, omega2: float) -> bool:
    """Tell whether the shear wave of a law that locks has come near ``omega2`` [1/s²].

    The area of a sheet with inextensible fibres shrinks by cos γ; its shear strain is sin γ.
    """
    if not body.material.locks:
        return False
    strain = np.zeros(6)
    strain[3] = np.sqrt(max(1.0 - float(condition.area_stretch.min()) ** 2, 0.0))
    tangent = body.material.stress_and_tangent(strain)[1][3, 3]
    # a shear wave bends both pairs of sides: twice the 4 c²/l² of a wave along one
    density = body.material.density * body.least_mass_factor
    present = 8.0 * tangent / (density * body.shortest_length**2)
    return bool(present > SHEAR_SHARE * omega2)
