"""What a scene may say but probably does not mean."""

from __future__ import annotations

import math

from lcmchain.effects import viscous_shear
from lcmchain.fields.table import NO_THICKNESS
from lcmchain.quantities.rounded import two_digits
from lcmchain.scene import Scene, left_out_of
from lcmchain.scene.fabrics import preset_remarks
from lcmchain.scene.plies import PlySettings, Stack
from lcmchain.tools.tool import Tool


def scene_warnings(scene: Scene) -> list[str]:
    """Say what is allowed but probably not meant."""
    stack = scene.stack
    found = [] if stack.has_thickness else [NO_THICKNESS]
    for element in stack.elements.values():
        found += [remark for remark in element.remarks if remark not in found]
    found += _unused_materials(scene)
    left_out = left_out_of(scene)
    if left_out:
        found.append(f"left out, as this model knows nothing of them: {', '.join(left_out)}")
    found += [
        switched.warning for switched in scene.switched if f"effects.{switched.key}" not in left_out
    ]
    for material in stack.materials.values():
        found += material.remarks() + preset_remarks(material)
    director = any(
        getattr(ply.element, "compaction_strain", None) == "director" and ply.material.has_fibres
        for ply in stack
    )
    if director and scene.tools:
        found.append(
            'element.compaction_strain = "director" (as published) lets elements fold over on '
            'small radii under pressure; "normal" does not'
        )
    if not scene.element.has_forces:
        return found  # neither motion nor resolution of a tool is simulated
    process = scene.process
    moved = process.gravity or bool(scene.pressure)
    moved |= any(gripper.pulls or gripper.leads for gripper in scene.grippers)
    if not moved and not any(tool.motion.moves for tool in scene.tools):
        found.append(
            "nothing moves: no tool is driven, no gripper pulls or leads, there is no "
            "[[pressure]], and process.gravity is false"
        )
    found += _drag_of_added_mass(scene) + viscous_shear.remarks(scene)
    for tool in scene.tools:
        found += tool.motion.remarks(tool.name, process.time)
        found += _of_shape(tool, stack)
    return list(dict.fromkeys(found))


def _of_shape(tool: Tool, stack: Stack) -> list[str]:
    """Say what a tool's shape asks of the elements of every ply, those of one edge together."""
    of_edge: dict[float, list[PlySettings]] = {}
    for ply in stack:
        of_edge.setdefault(ply.blank.edge_length, []).append(ply)
    if len(of_edge) == 1:
        return tool.shape.remarks(tool.name, stack.shortest_edge)
    found = []
    for edge_length, plies in of_edge.items():
        names = " and ".join(ply.name for ply in plies)
        whose = f" of the {'ply' if len(plies) == 1 else 'plies'} {names}"
        for text in tool.shape.remarks(tool.name, edge_length, whose):
            found.append(plies[0].in_own_words(text) if len(plies) == 1 else text)
    return found


def _unused_materials(scene: Scene) -> list[str]:
    """Say which materials stand in the scene, but in no ply."""
    used = scene.stack.materials
    given = [f"materials.{name}" for name in scene.materials]
    if scene.material is not None:
        given.insert(0, "material")
    return [
        f"{key} is the material of no ply; plies name one by their entry material"
        for key in given
        if key not in used
    ]


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
