"""What a scene may say but probably does not mean."""

from __future__ import annotations

import math

from lcmchain.fields.table import NO_THICKNESS
from lcmchain.quantities.rounded import two_digits
from lcmchain.scene import Scene, left_out_of
from lcmchain.scene.fabrics import preset_remarks


def scene_warnings(scene: Scene) -> list[str]:
    """Say what is allowed but probably not meant."""
    found = [] if scene.element.has_thickness else [NO_THICKNESS]
    found += scene.element.remarks
    left_out = left_out_of(scene)
    if left_out:
        found.append(f"left out, as this model knows nothing of them: {', '.join(left_out)}")
    found += [
        switched.warning for switched in scene.switched if f"effects.{switched.key}" not in left_out
    ]
    found += scene.material.remarks() + preset_remarks(scene.material)
    director = getattr(scene.element, "compaction_strain", None) == "director"
    if director and scene.tools and scene.material.has_fibres:
        found.append(
            'element.compaction_strain = "director" (as published) lets elements fold over on '
            'small radii under pressure; "normal" does not'
        )
    if not scene.element.has_forces:
        return found  # neither motion nor resolution of a tool is simulated
    process = scene.process
    moved = process.gravity or bool(scene.pressure)
    if not moved and not any(tool.motion.moves for tool in scene.tools):
        found.append(
            "nothing moves: no tool is driven, there is no [[pressure]], and process.gravity is "
            "false"
        )
    found += _drag_of_added_mass(scene)
    for tool in scene.tools:
        found += tool.motion.remarks(tool.name, process.time)
        found += tool.shape.remarks(tool.name, scene.blank.edge_length)
    return found


def _drag_of_added_mass(scene: Scene) -> list[str]:
    """Say that mass damping, a rate per inertia, drags the added mass along."""
    process = scene.process
    factor = 1.0 if process.mass_scaling is None else process.mass_scaling.factor
    if factor == 1.0 or process.mass_damping == 0.0:
        return []
    calmer = two_digits(process.mass_damping / math.sqrt(factor))
    return [
        f"process.mass_damping drags the sheet {factor:g} times as hard with "
        f'process.mass_scaling.factor = {factor:g}; "{calmer} 1/s" damps its vibrations as much as '
        "without added mass"
    ]
