"""The effects that a scene calls for, each with the reason."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lcmchain.fields.dataset import NO_THICKNESS
from lcmchain.scene import (
    FabricMaterial,
    IsotropicMaterial,
    MembraneShellElement,
    OrthotropicMaterial,
    Scene,
    StiffnessMaterial,
)
from lcmchain.tools.motion import STANDARD_GRAVITY, GuidedMotion, StrokeMotion, TableMotion


@dataclass(frozen=True)
class Effect:
    """A piece of physics, whether the scene calls for it, and why."""

    name: str
    active: bool
    reason: str


def scene_effects(scene: Scene) -> list[Effect]:
    """List the effects that a scene calls for and those it does without, each with the reason."""
    process = scene.process
    if isinstance(scene.element, MembraneShellElement):
        effects = _membrane_shell_effects()
    else:
        effects = _solid_shell_effects(scene)

    def add(name: str, active: bool, reason: str) -> None:
        effects.append(Effect(name, active, reason))

    if not scene.tools:
        add("contact", False, "the scene has no tool")
    for tool in scene.tools:
        add(f"contact with {tool.name}", True, f"{tool.shape.type.replace('_', ' ')}")
        rough = tool.friction > 0.0
        add(f"friction on {tool.name}", rough, f"coefficient {tool.friction:g}")
        if isinstance(tool.motion, GuidedMotion):
            add(f"guided tool {tool.name}", True, _guided_reason(tool.motion))
        elif isinstance(tool.motion, (StrokeMotion, TableMotion)):
            add(f"prescribed motion of {tool.name}", True, _prescribed_reason(tool.motion))
    add(
        "contact damping",
        bool(scene.tools) and scene.contact.damping_ratio > 0.0,
        f"contact.damping_ratio = {scene.contact.damping_ratio:g}",
    )
    add(
        "gravity",
        process.gravity,
        "9.81 m/s2 along -z on the blank" if process.gravity else "process.gravity = false",
    )
    add("mass damping", process.mass_damping > 0.0, f"{process.mass_damping:g} 1/s")
    if not scene.mapping:
        add("mapping", False, "no [[mapping]] entry")
    for target in scene.mapping:
        add(f"mapping to {target.name}", True, f"{target.kind} mesh {target.mesh}, {target.method}")
    law = scene.permeability.law if scene.permeability else "no [permeability] entry"
    add("permeability", scene.permeability is not None, law)
    return effects


def _membrane_shell_effects() -> list[Effect]:
    return [
        Effect("thickness", False, NO_THICKNESS),
        Effect("compaction", False, "the mid-surface has no thickness direction"),
        Effect("bending", True, "C^B, superimposed on the membrane; rotation-free"),
        Effect("transverse shear", False, "the normal of a triangle stays normal"),
        Effect("hourglass control", False, "constant strain triangles have no zero-energy mode"),
        Effect("enhanced strain", False, "no thickness direction"),
    ]


def _solid_shell_effects(scene: Scene) -> list[Effect]:
    material, element = scene.material, scene.element
    if isinstance(material, FabricMaterial):
        measure = {"normal": "normal thickness", "director": "length of the director"}
        law = f"C33 = c0 exp(c1 |E33|^c2), measured by the {measure[element.compaction_strain]}"
        compaction = Effect("compaction", True, law)
        bending = "C^B is independent of the membrane"
    else:
        law = f"the {material.law} law has a constant stiffness C33"
        compaction = Effect("compaction", False, law)
        bending = _bending_reason(material)
    row = "with" if element.in_plane_shear_hourglass else "without"
    hourglass = f"one in-plane integration point; {element.hourglass}, {row} the in-plane shear row"
    coupled = couples_thickness(scene)
    return [
        compaction,
        Effect("bending", True, bending),
        Effect("transverse shear", True, "assumed natural strains, C13 and C23"),
        Effect("hourglass control", True, hourglass),
        Effect(
            "enhanced strain",
            coupled,
            f"normal and in-plane strains {'couple' if coupled else 'do not couple'}",
        ),
    ]


def couples_thickness(scene: Scene) -> bool:
    """Tell whether the material couples the normal strain 33 with the in-plane strains."""
    material = scene.material
    if isinstance(material, IsotropicMaterial):
        return material.poisson_ratio != 0.0
    if isinstance(material, OrthotropicMaterial):
        return material.nu13 != 0.0 or material.nu23 != 0.0
    if isinstance(material, StiffnessMaterial):
        matrices = np.array([material.membrane, material.bending])
        return bool(np.any(matrices[:, 2, [0, 1, 3]]))
    return False


def _bending_reason(material) -> str:
    if isinstance(material, StiffnessMaterial):
        return "C^B given by material.bending"
    if isinstance(material, OrthotropicMaterial) and material.bending_factor != 1.0:
        return f"C^B = {material.bending_factor:g} C^M"
    return "C^B = C^M"


def _guided_reason(motion: GuidedMotion) -> str:
    load = guided_load(motion)
    return f"{motion.mass:g} kg under {load:.4g} N along its direction"


def guided_load(motion: GuidedMotion) -> float:
    """Force along the direction of travel from weight and given force [N]."""
    weight = -STANDARD_GRAVITY * motion.mass * motion.direction[2] if motion.gravity else 0.0
    return motion.force + weight


def _prescribed_reason(motion: StrokeMotion | TableMotion) -> str:
    if isinstance(motion, StrokeMotion):
        duration = 1e3 * (motion.end - motion.start)
        return f"{motion.profile} stroke of {1e3 * motion.distance:g} mm in {duration:g} ms"
    return f"table of {len(motion.times)} times, {1e3 * motion.travel[-1]:g} mm at the end"
