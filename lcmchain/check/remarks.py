"""What a scene may say but probably does not mean."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from lcmchain.effects.sheet import viscous_shear
from lcmchain.quantities.fields import NO_THICKNESS
from lcmchain.quantities.readable import two_digits
from lcmchain.scene import Scene, left_out_of
from lcmchain.scene.infiltration.boundaries import Bag
from lcmchain.scene.presets import preset_remarks
from lcmchain.scene.stack import PlySettings, Stack
from lcmchain.tools.tool import Tool


def scene_warnings(scene: Scene) -> list[str]:
    """Say what is allowed but probably not meant."""
    stack = scene.stack
    warnings = [] if stack.has_thickness else [NO_THICKNESS]
    for element in stack.elements.values():
        warnings += [remark for remark in element.remarks if remark not in warnings]
    warnings += _unused_materials(scene) + _films(scene) + _inflated_bags(scene)
    left_out = left_out_of(scene)
    if left_out:
        warnings.append(f"left out, as this model knows nothing of them: {', '.join(left_out)}")
    warnings += [
        switched.warning for switched in scene.switched if f"effects.{switched.key}" not in left_out
    ]
    for material in stack.materials.values():
        warnings += material.remarks() + preset_remarks(material)
    director = any(
        getattr(ply.element, "compaction_strain", None) == "director" and ply.material.has_fibres
        for ply in stack
    )
    if director and scene.tools:
        warnings.append(
            'element.compaction_strain = "director" (as published) lets elements fold over on '
            'small radii under pressure; "normal" does not'
        )
    if not scene.element.has_forces:
        return warnings  # neither motion nor resolution of a tool is simulated
    process = scene.process
    moved = process.gravity or bool(scene.pressure)
    moved |= any(gripper.pulls or gripper.leads for gripper in scene.grippers)
    if not moved and not any(tool.motion.moves for tool in scene.tools):
        warnings.append(
            "nothing moves: no tool is driven, no gripper pulls or leads, there is no "
            "[[pressure]], and process.gravity is false"
        )
    warnings += _drag_of_added_mass(scene) + viscous_shear.remarks(scene)
    for tool in scene.tools:
        warnings += tool.motion.remarks(tool.name, process.time)
        warnings += _of_shape(tool, stack)
    return list(dict.fromkeys(warnings))


def _of_shape(tool: Tool, stack: Stack) -> list[str]:
    """Say what a tool's shape asks of the elements of every ply, those of one edge together."""
    of_edge: dict[float, list[PlySettings]] = {}
    for ply in stack:
        of_edge.setdefault(ply.blank.edge_length, []).append(ply)
    if len(of_edge) == 1:
        return tool.shape.remarks(tool.name, stack.shortest_edge)
    texts = []
    for edge_length, plies in of_edge.items():
        names = " and ".join(ply.name for ply in plies)
        whose = f" of the {'ply' if len(plies) == 1 else 'plies'} {names}"
        for text in tool.shape.remarks(tool.name, edge_length, whose):
            texts.append(plies[0].in_own_words(text) if len(plies) == 1 else text)
    return texts


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


def _films(scene: Scene) -> list[str]:
    """Say which plies of rubber would stay in the part."""
    return [
        f"{ply.key} is of rubber and stays in the part, whose fibre volume fraction is then not "
        "known; give film = true for one that is taken off after forming"
        for ply in scene.stack
        if len(scene.stack) > 1 and not ply.material.has_directions and not ply.film
    ]


def _inflated_bags(scene: Scene) -> list[str]:
    """Say where resin enters at a higher pressure than that of the bag over it.

    The textile then bears nothing, and the bag would lift off: it has no stiffness of its own.
    """
    texts = []
    for name, (case, _) in scene.infiltrations.items():
        bag = case.closure
        if not isinstance(bag, Bag):
            continue
        for gate in case.gates:
            given = gate.pressure
            if given is None and gate.pressure_limit is not None:
                given = (gate.pressure_limit,)
            if given is None:
                continue
            own_times = gate.times if gate.pressure is not None else None
            times = sorted({0.0, case.time, *(own_times or ()), *(bag.times or ())})
            over = _over_time(times, given, own_times) - _over_time(times, bag.pressure, bag.times)
            worst = int(np.argmax(over))
            if over[worst] > 0.0:
                texts.append(
                    f'infiltration of {name}: the gate "{gate.name}" is {1e-5 * over[worst]:.3g} '
                    f"bar above the bag at {times[worst]:.4g} s: the textile there bears nothing, "
                    "and the bag inflates over it, which nothing holds back; lower the pressure "
                    "of the gate, or raise that of the bag"
                )
    return texts


def _over_time(
    times: Sequence[float], values: Sequence[float], given: Sequence[float] | None
) -> np.ndarray:
    """Return values of a table at times, which is constant without times of its own."""
    if given is None:
        return np.full(len(times), values[0])
    return np.interp(times, given, values)


def _drag_of_added_mass(scene: Scene) -> list[str]:
    """Say that mass damping, a rate per inertia, drags the added mass along."""
    process = scene.process
    factor = 1.0 if process.mass_scaling is None else process.mass_scaling.factor
    # what was found goes with the vibrations of the sheet as heavy as it is
    if factor == 1.0 or process.mass_damping == 0.0 or scene.damping_is_found:
        return []
    calmer = two_digits(process.mass_damping / math.sqrt(factor))
    return [
        f"process.mass_damping drags the sheet {factor:g} times as hard with "
        f'process.mass_scaling.factor = {factor:g}; "{calmer} 1/s" damps its vibrations as much as '
        "without added mass"
    ]
