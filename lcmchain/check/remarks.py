"""What a scene may say but probably does not mean."""

from __future__ import annotations

from lcmchain.fields.dataset import NO_THICKNESS
from lcmchain.scene import Scene
from lcmchain.scene.fabrics import preset_remarks


def scene_warnings(scene: Scene) -> list[str]:
    """Say what is allowed but probably not meant."""
    found = [] if scene.element.has_thickness else [NO_THICKNESS]
    found += scene.element.remarks
    if scene.source.left_out:
        found.append(
            f"left out, as this model knows nothing of them: {', '.join(scene.source.left_out)}"
        )
    found += [switched.warning for switched in scene.switched]
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
    for tool in scene.tools:
        found += tool.motion.remarks(tool.name, process.time)
        found += tool.shape.remarks(tool.name, scene.blank.edge_length)
    return found
