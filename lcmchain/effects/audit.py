"""Every effect of a compiled model, active or not, each with its reason.

``check`` and ``summary.json`` list what stands here and nothing else: an effect is told by its own
file, from the model.
"""

from __future__ import annotations

from typing import Any

from lcmchain.effects import (
    bending,
    compaction,
    contact,
    damping,
    enhanced_strain,
    face_pressure,
    fibre_bending,
    fibre_modulus,
    friction,
    gravity,
    hourglass,
    mass_scaling,
    memory,
    pore_pressure,
    supports,
    thickness,
    tool_motion,
    transverse_shear,
)
from lcmchain.effects.effect import Effect

#: The files of the effects, in the order of reports.
EFFECTS = (
    thickness,
    compaction,
    bending,
    transverse_shear,
    fibre_bending,
    hourglass,
    enhanced_strain,
    memory,
    pore_pressure,
    face_pressure,
    contact,
    friction,
    tool_motion,
    supports,
    gravity,
    damping,
    mass_scaling,
    fibre_modulus,
)


def effects_of(model: Any) -> list[Effect]:
    """Return the effects of a :class:`lcmchain.model.Model`."""
    return [effect for file in EFFECTS for effect in file.active(model)]
