"""Fibre volume fraction of elements: the guard against more fibre than space.

With inextensible fibres det F = λ cos γ: compaction (thickness stretch λ) and shear (angle γ) pack
the fibres alike, and the compaction law knows nothing of the shear.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

import numpy as np

from lcmchain.elements.family import Body, Condition, Unsound
from lcmchain.materials.law import Material
from lcmchain.mesh.sheet_mesh import shear_angles

#: Where an element holds nothing but fibres.
SOLID_FIBRE = 1.0

CAUSE_OF_SHEAR = (
    "it is sheared further than the fabric bears, which the shear law does not know; state where "
    "it locks (material.membrane.locking_angle), or use larger radii, less restraint of the sheet, "
    "or a smaller blank.edge_length"
)


# A number for a number, an array for an array [m].
Thickness = TypeVar("Thickness", float, np.ndarray)


def initial_fibre_volume_fraction(material: Material, thickness: Thickness) -> Thickness:
    """Return areal mass / (fibre density · thickness [m]); of a material with a fibre density."""
    assert material.fibre_density is not None
    return material.areal_mass / (material.fibre_density * thickness)


def overfilled(
    body: Body,
    positions: np.ndarray,
    condition: Condition,
    cause_of_thinning: Callable[[int], str],
    noun: str = "element",
) -> Unsound | None:
    """Return the element that holds most fibre if that is more than it has space for.

    Parameters
    ----------
    positions : (3, node_count) of the whole model [m].
    cause_of_thinning : asked for the cause where compaction contributes more than shear.
    noun : what the family calls its elements.
    """
    fraction = body.fibre_volume_fraction(condition)
    if fraction is None or fraction.max() <= SOLID_FIBRE:
        return None
    worst = int(np.argmax(fraction))
    thickness, area = condition.thickness_stretch[worst], condition.area_stretch[worst]
    own = positions[:, body.first_node : body.first_node + body.mesh.node_count].T
    angle = abs(np.degrees(shear_angles(body.mesh, own)[worst]))
    if body.mesh.has_thickness:
        thickness_text = f"thickness {thickness:.3f} of the initial one"
    else:
        thickness_text = "at the initial thickness"
    text = (
        f"{noun} {worst} is collapsed: its fibre volume fraction is {fraction[worst]:.3f}, more "
        f"fibre than space ({thickness_text}, area {area:.3f} of the initial one, shear angle "
        f"{angle:.1f} deg)"
    )
    return Unsound(worst, text, cause_of_thinning(worst) if thickness < area else CAUSE_OF_SHEAR)
