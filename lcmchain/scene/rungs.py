"""The model ladder: one scene on any rung, from a laid net to the solid-shell."""

from __future__ import annotations

import hashlib
from dataclasses import replace
from typing import Any, Final

from pydantic import ValidationError

from lcmchain.effects.switches import settings_of
from lcmchain.elements.families import KinematicElement, SheetElement
from lcmchain.elements.membrane_shell.table import MembraneShellElement
from lcmchain.elements.solid_shell.table import Element
from lcmchain.errors import InputError
from lcmchain.scene.output import NO_FILM
from lcmchain.scene.reading.explain import problems_of
from lcmchain.scene.reading.read import OVERRIDE, input_error
from lcmchain.scene.scene import Scene, SceneSource

#: Every rung with its element, the cheapest first.
RUNGS: Final[dict[str, Any]] = {
    "kinematic": KinematicElement(),
    "membrane": MembraneShellElement(bending=False),
    "membrane-shell": MembraneShellElement(),
    "solid-shell": Element(),
}
#: The same as entries of a scene file.
ENTRIES: Final = {
    "kinematic": '"kinematic"',
    "membrane": '{type = "membrane-shell", bending = false}',
    "membrane-shell": '"membrane-shell"',
    "solid-shell": '"solid-shell"',
}


def rung_of(scene: Scene) -> str:
    """Return the rung that a scene stands on; several where plies have elements of their own."""
    return " and ".join(dict.fromkeys(map(_rung_of_element, scene.stack.elements.values())))


def _rung_of_element(element: SheetElement) -> str:
    if element.type == "membrane-shell" and not element.bending:
        return "membrane"
    return element.type


def on_rung(scene: Scene, model: str) -> Scene:
    """Return a scene on another rung of the model ladder.

    Entries that the rung knows nothing of are dropped, and named by ``source.left_out``: options of
    the other element; what needs a thickness that is not predicted (permeability, infiltration,
    structural analysis, fields of a film); loads, weight and ``[effects]``, where there are no
    forces.

    Parameters
    ----------
    scene : on any rung; it stays as it is.
    model : ``"kinematic"``, ``"membrane"``, ``"membrane-shell"`` or ``"solid-shell"``.

    Raises
    ------
    InputError : there is no such rung, or the law of the material does not serve it.
    """
    if model not in RUNGS:
        raise InputError(f'is "{model}", but there are {", ".join(RUNGS)}', key="--model")
    if rung_of(scene) == model:
        return scene
    # the switches of [effects] act on what is written, and on the new rung once more
    written = scene.model_copy(update=scene.before_switches | scene.as_written)
    changes, left_out, overrides = _changes(written, model)
    values = {name: getattr(written, name) for name in type(scene).model_fields} | changes
    try:
        moved = Scene.model_validate(values)
    except ValidationError as error:
        raise input_error(problems_of(error, {}), scene.source.path) from None
    moved._source = _source(scene, model, left_out, overrides)
    return moved


def left_out_of(scene: Scene) -> list[str]:
    """Return the keys of a scene that its model knows nothing of.

    They are what was dropped on the way to its rung, and what a scene that names a net of fibres
    itself says of weight.
    """
    keys = list(scene.source.left_out)
    if not scene.element.has_forces:
        if scene.before_switches.get("process", scene.process).gravity:
            keys.append("process.gravity")
        keys += [f"effects.{item.key}" for item in scene.switched if item.setting == "on"]
    return keys


def _changes(scene: Scene, model: str) -> tuple[dict[str, Any], list[str], list[str]]:
    """Return the entries that change, the keys of what is dropped, and the changes as overrides."""
    element = scene.element if _rung_of_element(scene.element) == model else RUNGS[model]
    changes: dict[str, Any] = {"element": element}
    left_out = []
    if scene.element.type != element.type:
        left_out = [f"element.{name}" for name in sorted(scene.element.model_fields_set - {"type"})]
    overrides = [f"element={ENTRIES[model]}"]
    with_elements = [index for index, ply in enumerate(scene.plies) if ply.element is not None]
    if with_elements:
        changes["plies"] = tuple(ply.model_copy(update={"element": None}) for ply in scene.plies)
        left_out += [f"plies.{scene.plies[index].name}.element" for index in with_elements]
        overrides += [f"plies[{index}].element={ENTRIES[model]}" for index in with_elements]
    unknown = []
    if not element.has_thickness:
        unknown = [name for name in ("permeability", "infiltration") if getattr(scene, name)]
    elif not element.has_forces and scene.wet_forming is not None:
        unknown = ["infiltration"]
    for name in unknown:
        changes[name] = None
        overrides.append(f"{name}=none")
    if scene.pressure and not (element.has_thickness and element.has_forces):
        changes["pressure"] = ()
        unknown.append("pressure")
        overrides.append("pressure=[]")
    if scene.grippers and not element.has_forces:
        changes["grippers"] = ()
        changes["stages"] = _without_led(scene)
        unknown.append("grippers")
        overrides.append("grippers=[]")
    if not element.has_forces:
        unknown += _without_weight_and_switches(scene, changes, overrides)
    if not element.has_thickness:
        targets, stages = _without_stages(scene)
        changes["mapping"] = targets
        unknown += stages
    if scene.output.animation != NO_FILM and _unknown_field(scene, element):
        changes["output"] = scene.output.model_copy(update={"animation": NO_FILM})
        unknown.append("output.animation")
        overrides.append("output.animation=none")
    return changes, left_out + unknown, overrides


def _without_led(scene: Scene) -> tuple[Any, ...]:
    """Return the stages without the motions of grippers."""
    led = {gripper.name for gripper in scene.grippers}
    return tuple(
        stage.model_copy(
            update={"motions": {n: m for n, m in stage.motions.items() if n not in led}}
        )
        for stage in scene.stages
    )


def _without_weight_and_switches(
    scene: Scene, changes: dict[str, Any], overrides: list[str]
) -> list[str]:
    """Take weight and ``[effects]`` out, of which a net knows nothing; return their keys."""
    dropped = []
    if scene.process.gravity:
        changes["process"] = scene.process.model_copy(update={"gravity": False})
        overrides.append("process.gravity=false")
        dropped.append("process.gravity")
    settings = settings_of(scene)
    if settings:
        changes["effects"] = type(scene.effects)()
        overrides += [f'effects.{key}="auto"' for key in settings]
        dropped += [f"effects.{key}" for key in settings]
    return dropped


def _without_stages(scene: Scene) -> tuple[tuple[Any, ...], list[str]]:
    """Return the meshes to map onto without the stages that need a thickness, and their keys."""
    targets, dropped = [], []
    for target in scene.mapping:
        stages = [s for s in ("structure", "infiltration") if getattr(target, s) is not None]
        dropped += [f"mapping.{target.name}.{stage}" for stage in stages]
        targets.append(target.model_copy(update=dict.fromkeys(stages)))
    return tuple(targets), dropped


def _unknown_field(scene: Scene, element: SheetElement) -> bool:
    """Tell whether a film shows a field that the elements do not predict."""
    field = scene.output.animation_field
    if field == "wrinkle_height":
        return not element.has_forces
    return field != "shear_angle" and not element.has_thickness


def _source(scene: Scene, model: str, left_out: list[str], overrides: list[str]) -> SceneSource:
    """Return where the scene came from, with what has changed as overrides of its text."""
    source = scene.source
    text = source.text
    if text:
        text = text.rstrip("\n") + f"\n\n# --model {model}:\n"
        text += "".join(f"{OVERRIDE}{item}\n" for item in overrides)

    def kept(entries: list[tuple[str, str]]) -> list[tuple[str, str]]:
        dropped = ("element", *left_out)
        return [
            (key, value)
            for key, value in entries
            if not any(key == name or key.startswith(f"{name}.") for name in dropped)
        ]

    return replace(
        source,
        text=text,
        sha256=hashlib.sha256(text.encode()).hexdigest() if text else source.sha256,
        given=[*kept(source.given), ("element", f"{ENTRIES[model]} (--model {model})")],
        defaulted=kept(source.defaulted),
        files=kept(source.files),
        left_out=tuple(left_out),
    )
