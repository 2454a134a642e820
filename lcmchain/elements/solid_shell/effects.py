"""Which effects the kernels of a body of solid-shells are compiled for, and why, in words."""

from __future__ import annotations

import numpy as np

from lcmchain.elements.solid_shell.kernel import GENERAL, Options, SolidShellData
from lcmchain.materials.features.relaxation import relaxation_of
from lcmchain.materials.features.shear_compaction import coupling_of
from lcmchain.materials.features.shear_friction import shear_friction_of
from lcmchain.materials.features.viscous_shear import viscous_of
from lcmchain.materials.law import Material, Remembered, bending_losses_of, remembered


def solid_shell_effects(material: Material, data: SolidShellData) -> dict[str, tuple[bool, str]]:
    """Return (active, reason) by the name of the effect."""
    past, options = _memory(material), data.options
    return {
        "thickness": (True, "both faces of the sheet have nodes"),
        "compaction": _compaction(material, options),
        "shear-compaction coupling": _shear_compaction(material),
        "bending": (True, _bending(material, options)),
        "transverse shear": (True, "assumed natural strains, C13 and C23"),
        "hourglass control": (True, _hourglass(material, options)),
        "enhanced strain": _enhanced_strain(material, data),
        "memory": (bool(past), _names(past) or "the law remembers nothing"),
    }


def _memory(material: Material) -> tuple[Remembered, ...]:
    """Return what the law remembers, but for what effects of its own tell of."""
    losses = bending_losses_of(material)
    apart = (viscous_of(material), relaxation_of(material), shear_friction_of(material), losses)
    told = [own for part in apart if part is not None for own in part.memory]
    return tuple(own for own in remembered(material.law) if own not in told)


def _names(past: tuple[Remembered, ...]) -> str:
    return ", ".join(entry.name.replace("_", " ") for entry in past)


def _compaction(material: Material, options: Options) -> tuple[bool, str]:
    if not material.compacts:
        return False, "the law has a constant stiffness C33"
    measure = "normal thickness" if options.director is None else "length of the director"
    return True, f"C33 grows with the compaction, measured by the {measure}"


def _shear_compaction(material: Material) -> tuple[bool, str]:
    coupling = coupling_of(material)
    if coupling is None:
        return False, "the law of compaction does not know the shear"
    return True, coupling.in_words()


def _bending(material: Material, options: Options) -> str:
    reason = _bending_stiffness(material)
    if options.reference_bending is not None:
        reason += ", at the reference thickness"
    return reason


def _bending_stiffness(material: Material) -> str:
    C_B = material.bending_matrix()
    C_M = material.stress_and_tangent(np.zeros(6))[1]
    factor = C_B[0, 0] / C_M[0, 0]
    if not material.constant_tangent or not np.allclose(C_B, factor * C_M, rtol=1e-12):
        return "C^B is independent of the membrane"
    return "C^B = C^M" if factor == 1.0 else f"C^B = {factor:g} C^M"


def _hourglass(material: Material, options: Options) -> str:
    published = options.conservative is None and not material.constant_tangent
    row = "with" if options.in_plane_shear == 1.0 else "without"
    kind = "published" if published else "conservative"
    reason = f"one in-plane integration point; {kind}, {row} the in-plane shear row"
    if options.fibre_share != 1.0:
        reason += (
            f", fibres bend within the plane with {options.fibre_share:.2g} of their stiffness"
        )
    return reason


def _enhanced_strain(material: Material, data: SolidShellData) -> tuple[bool, str]:
    if material.couples_thickness:
        reason = "normal and other strains couple"
    elif data.options.curved is None:
        reason = "normal and other strains do not couple, and the sheet is flat"
    elif data.quick_data is not None:
        share = np.mean(data.quick_data.start == GENERAL)
        reason = f"{share:.0%} of the blocks have elements cut, curved or skewed at the start"
    else:
        reason = "the sheet is curved or skewed at the start"
    return data.options.enhanced is not None, reason
