"""Every effect of a compiled model, active or not, each with its reason.

``check`` and ``summary.json`` list what stands here and nothing else: an effect is told by its own
file, from the model.
"""

from __future__ import annotations

from typing import Any

from lcmchain.effects import (
    bending,
    bending_friction,
    compaction,
    compaction_relaxation,
    contact,
    contact_depth,
    damping,
    enhanced_strain,
    face_pressure,
    fibre_bending,
    fibre_modulus,
    friction,
    gravity,
    grippers,
    hourglass,
    mass_scaling,
    memory,
    pace,
    ply_contact,
    pore_pressure,
    shear_compaction,
    shear_friction,
    shear_locking,
    supports,
    thickness,
    tool_motion,
    transverse_shear,
    viscous_bending,
    viscous_shear,
)
from lcmchain.effects.effect import Effect, Switch

#: The files of the effects, in the order of reports.
EFFECTS = (
    thickness,
    compaction,
    shear_compaction,
    bending,
    transverse_shear,
    fibre_bending,
    hourglass,
    enhanced_strain,
    memory,
    shear_locking,
    viscous_shear,
    shear_friction,
    bending_friction,
    viscous_bending,
    compaction_relaxation,
    pore_pressure,
    face_pressure,
    contact,
    contact_depth,
    friction,
    ply_contact,
    tool_motion,
    supports,
    grippers,
    pace,
    gravity,
    damping,
    mass_scaling,
    fibre_modulus,
)


def effects_of(model: Any) -> list[Effect]:
    """Return the effects of a :class:`lcmchain.model.Model`."""
    return [effect._replace(key=key_of(file)) for file in EFFECTS for effect in file.active(model)]


def key_of(file: Any) -> str:
    """Return the entry of ``[effects]`` of an effect's file, its name; empty without a switch."""
    return file.__name__.rsplit(".", 1)[1] if hasattr(file, "SWITCH") else ""


def switches() -> dict[str, Switch]:
    """Return the switches by their entry of ``[effects]``, in the order of reports."""
    return {key_of(file): file.SWITCH for file in EFFECTS if hasattr(file, "SWITCH")}
