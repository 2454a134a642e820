"""What a scene may say but probably does not mean."""

from __future__ import annotations

from lcmchain.fields.dataset import NO_THICKNESS
from lcmchain.scene import FabricMaterial, MembraneShellElement, Scene


def scene_warnings(scene: Scene) -> list[str]:
    """Say what is allowed but probably not meant."""
    found = [NO_THICKNESS] if isinstance(scene.element, MembraneShellElement) else []
    material, process = scene.material, scene.process
    if isinstance(material, FabricMaterial):
        if material.fibre_volume_fraction > 0.9:
            found.append(
                f"the fibre volume fraction of the unloaded fabric is "
                f"{material.fibre_volume_fraction:.2f}, more than fibres can be packed to"
            )
        director = getattr(scene.element, "compaction_strain", None) == "director"
        if director and scene.tools:
            found.append(
                'element.compaction_strain = "director" (as published) lets elements fold over on '
                'small radii under pressure; "normal" does not'
            )
    if not any(tool.motion.moves for tool in scene.tools) and not process.gravity:
        found.append("nothing moves: no tool is driven and process.gravity is false")
    for tool in scene.tools:
        found += tool.motion.remarks(tool.name, process.time)
        found += tool.shape.remarks(tool.name, scene.blank.edge_length)
    return found
