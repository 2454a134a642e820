"""The list of all effects: what of them a model has, and ``[effects]``, which switches them.

A model is asked for every effect (:func:`effects_of`), and each is told by its own file, active or
not, with its reason. ``check`` and ``summary.json`` list what stands here and nothing else.

In the table ``[effects]`` of a scene ``auto`` leaves an effect to scene and material. ``off`` takes
it out of a scene that calls for it, before anything is built, so that its code is not compiled in
either. ``on`` puts it into one that does not, where it is known with which numbers. What cannot be
is refused with the reason (:class:`lcmchain.effects.effect.Switch`, one in each effect's file).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from types import ModuleType
from typing import Annotated, Any, Literal, NamedTuple

from pydantic import Field, create_model

from lcmchain.effects import (
    contact,
    contact_depth,
    face_pressure,
    fibre_bending,
    friction,
    gravity,
    grippers,
    ply_contact,
    pore_pressure,
    supports,
)
from lcmchain.effects.effect import Effect, EffectModel, EffectScene, Refusal, Switch
from lcmchain.effects.process import damping, fibre_modulus, mass_scaling, pace, tool_motion
from lcmchain.effects.sheet import (
    bending,
    bending_friction,
    compaction,
    compaction_relaxation,
    enhanced_strain,
    hourglass,
    memory,
    shear_compaction,
    shear_friction,
    shear_locking,
    thickness,
    transverse_shear,
    viscous_bending,
    viscous_shear,
)
from lcmchain.quantities.entry_types import AbsentMeans, SceneModel

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


def effects_of(model: EffectModel) -> list[Effect]:
    """Return the effects of a :class:`lcmchain.model.Model`."""
    return [effect._replace(key=key_of(file)) for file in EFFECTS for effect in file.active(model)]


def key_of(file: ModuleType) -> str:
    """Return the entry of ``[effects]`` of an effect's file, its name; empty without a switch."""
    return file.__name__.rsplit(".", 1)[1] if hasattr(file, "SWITCH") else ""


def switches() -> dict[str, Switch]:
    """Return the switches by their entry of ``[effects]``, in the order of reports."""
    return {key_of(file): file.SWITCH for file in EFFECTS if hasattr(file, "SWITCH")}


Setting = Annotated[Literal["auto", "on", "off"], AbsentMeans("")]

#: The table ``[effects]``.
EffectSettings: type[SceneModel] = create_model(  # type: ignore[call-overload]
    "EffectSettings",
    __base__=SceneModel,
    __doc__="Effects that are switched on or off, whatever the scene calls for.",
    **{
        key: (Setting, Field(default="auto", description=f"Off leaves out {switch.without}."))
        for key, switch in switches().items()
    },
)


class Switched(NamedTuple):
    """An effect that a scene has switched against what it calls for: its key and its setting."""

    key: str
    setting: str

    @property
    def switch(self) -> Switch:
        """What the entry does."""
        return switches()[self.key]

    @property
    def warning(self) -> str:
        """What is to be known of the result."""
        if self.setting == "on":
            return f'effects.{self.key} = "on" adds what no other entry of the scene calls for'
        return (
            f'effects.{self.key} = "off" leaves out what the scene calls for '
            f"({self.switch.entry}): {self.switch.without}"
        )


class Switchable(NamedTuple):
    """An effect that could be switched: its entry, whether the scene has it, and why."""

    name: str
    state: Literal["on", "off"]
    why: str


def settings_of(scene: EffectScene) -> dict[str, str]:
    """Return the settings of a scene other than "auto", by entry of ``[effects]``."""
    given = {key: getattr(scene.effects, key) for key in switches()}
    return {key: setting for key, setting in given.items() if setting != "auto"}


def changes(scene: EffectScene, key: str, setting: str) -> dict[str, Any] | None:
    """Return the entries of a scene that change; None where it is already as asked for.

    Raises
    ------
    Refusal : the effect cannot be switched so in this scene; says why and what to do.
    """
    switch = switches()[key]
    called = switch.called(scene)
    if called is not None and called == (setting == "on"):
        return None
    return switch.off(scene) if setting == "off" else switch.on(scene)


def with_effect(scene: EffectScene, key: str, setting: str) -> Any:
    """Return a copy of a scene with an effect switched "on" or "off".

    Raises
    ------
    Refusal : the effect cannot be switched so in this scene.
    """
    changed = changes(scene, key, setting) or {}
    changed["effects"] = scene.effects.model_copy(update={key: setting})
    return scene.model_copy(update=changed)


def switchable_effects(scene: EffectScene) -> list[Switchable]:
    """Return the effects that the other setting would change, for a study of what each costs.

    Those that a scene has already switched stay as they are set.

    Parameters
    ----------
    scene : a validated scene.
    """
    if not scene.element.has_forces:
        return []  # a net of fibres is laid without any of them
    return list(_switchable(scene, settings_of(scene)))


def _switchable(scene: EffectScene, settled: Mapping[str, str]) -> Iterator[Switchable]:
    for key, switch in switches().items():
        if key in settled:
            continue
        called = switch.called(scene)
        if called is None:
            continue
        try:
            changes(scene, key, "off" if called else "on")
        except Refusal:
            continue
        why = switch.entry if called else f"not called for by {switch.entry}"
        yield Switchable(key, "on" if called else "off", why)
