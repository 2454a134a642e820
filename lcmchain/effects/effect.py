"""Whether a piece of physics is in a compiled model, and why; and whether a scene may switch it.

Scene and model lie above the effects: :class:`EffectScene` and :class:`EffectModel` are what
effects read of them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple, Protocol, Self

import numpy as np

from lcmchain.elements.families import SheetElement
from lcmchain.elements.family import Body
from lcmchain.materials.law import Material
from lcmchain.materials.table import MaterialTable
from lcmchain.quantities.entry_types import SceneModel
from lcmchain.tools.table import ToolTable
from lcmchain.tools.tool import Tool


class Effect(NamedTuple):
    """A piece of physics, whether it is in the model, and why.

    key : entry of ``[effects]`` that it belongs to, empty for one that no scene can switch.
    """

    name: str
    active: bool
    reason: str
    key: str = ""


class EffectPly(Protocol):
    """What effects read of a ply of a scene."""

    @property
    def material(self) -> MaterialTable: ...
    @property
    def element(self) -> SheetElement: ...


class EffectStack(Protocol):
    """The plies of a scene, and the tables that they are made of by their scene entry."""

    def __iter__(self) -> Iterator[EffectPly]: ...
    @property
    def materials(self) -> Mapping[str, MaterialTable]: ...
    @property
    def elements(self) -> Mapping[str, SheetElement]: ...


class EffectScene(Protocol):
    """What effects read of a scene, and how they make one with other entries."""

    @property
    def stack(self) -> EffectStack: ...
    @property
    def process(self) -> Any: ...
    @property
    def element(self) -> SheetElement: ...
    @property
    def plies(self) -> Sequence[Any]: ...
    @property
    def material(self) -> MaterialTable | None: ...
    @property
    def materials(self) -> Mapping[str, MaterialTable]: ...
    @property
    def contact(self) -> Any: ...
    @property
    def tools(self) -> Sequence[Tool]: ...
    @property
    def pressure(self) -> Sequence[SceneModel]: ...
    @property
    def wet_forming(self) -> object: ...
    @property
    def effects(self) -> SceneModel: ...
    def model_copy(self, *, update: dict[str, Any]) -> Self: ...


class EffectEnvironment(Protocol):
    """Scalars of contact, damping and gravity, as :class:`lcmchain.model.Environment`."""

    @property
    def contact_damping_ratio(self) -> float: ...
    @property
    def depth_time(self) -> float | None: ...
    @property
    def mass_damping(self) -> float: ...
    @property
    def gravity(self) -> float | np.ndarray: ...


class EffectModel(Protocol):
    """What effects read of a compiled model, :class:`lcmchain.model.Model`.

    ``fibre_bending``, ``pore``, ``face_pressure``, ``ply_contact``, ``grips``, ``supports`` and
    ``pace`` are tables of single effects, of the type that the effect's own file knows.
    """

    @property
    def bodies(self) -> Sequence[Body]: ...
    @property
    def sheet_mass(self) -> np.ndarray: ...
    @property
    def nodes(self) -> Any: ...
    @property
    def tools(self) -> ToolTable: ...
    @property
    def tool_names(self) -> Sequence[str]: ...
    @property
    def environment(self) -> EffectEnvironment: ...
    @property
    def averaging(self) -> float | None: ...
    @property
    def process_time(self) -> float: ...
    @property
    def support_names(self) -> Sequence[str]: ...
    @property
    def fibre_bending(self) -> Any: ...
    @property
    def pore(self) -> Any: ...
    @property
    def face_pressure(self) -> Any: ...
    @property
    def ply_contact(self) -> Any: ...
    @property
    def grips(self) -> Any: ...
    @property
    def supports(self) -> Any: ...
    @property
    def pace(self) -> Any: ...


#: An answer of a switch: the entries of a scene that change, by their names.
Answer = Callable[[EffectScene], dict[str, Any]]


def range_in_words(values: Iterable[float]) -> str:
    """Return the least and the largest of some numbers in words, one where they are the same."""
    numbers = list(values)
    return " to ".join(f"{value:.3g}" for value in dict.fromkeys((min(numbers), max(numbers))))


class Refusal(ValueError):
    """Why an effect cannot be switched as asked, in words that follow "is ..., but"."""


class Switch(NamedTuple):
    """What the entry of an effect in ``[effects]`` does to a scene.

    entry : scene entries that call for the effect.
    without : what a result leaves out, or why it needs the effect, in words.
    called : tells whether a scene calls for it; None where only its mesh can tell.
    off, on : return the entries of the scene that change, by their names; raise :class:`Refusal`.
        ``off`` is asked where the scene calls for the effect, ``on`` where it does not.
    unless : what makes ``off`` refuse, in words, where it does not always.
    """

    entry: str
    without: str
    called: Callable[[EffectScene], bool | None]
    off: Answer
    on: Answer
    unless: str = ""


def refused(reason: str) -> Answer:
    """Return the answer of a switch that no scene may turn that way."""

    def refuse(scene: EffectScene) -> dict[str, Any]:
        raise Refusal(reason)

    refuse.reason = reason  # type: ignore[attr-defined]
    return refuse


def of_table(table: str, **entries: object) -> Answer:
    """Return the answer of a switch that sets entries of a table."""

    def change(scene: EffectScene) -> dict[str, Any]:
        return {table: getattr(scene, table).model_copy(update=entries)}

    return change


def stated_by_materials(attribute: str) -> Callable[[EffectScene], bool]:
    """Return the function that tells whether the material of any ply states an effect.

    attribute : of a material's table, whether it does.
    """
    return lambda scene: any(
        getattr(material, attribute) for material in scene.stack.materials.values()
    )


def out_of_materials(attribute: str, without: str) -> Answer:
    """Return the answer of a switch that takes an effect out of the materials of all plies.

    attribute : of a material's table, whether it states it. without : its method that takes it out.
    """

    def off(scene: EffectScene) -> dict[str, Any]:
        def changed(material: MaterialTable | None) -> MaterialTable | None:
            states = material is not None and getattr(material, attribute)
            return getattr(material, without)() if states else material

        changes: dict[str, Any] = {"material": changed(scene.material)}
        if scene.materials:
            changes["materials"] = {
                key: changed(material) for key, material in scene.materials.items()
            }
        return changes

    return off


def switch_of_materials(
    attribute: str, taken_out_by: str, *, entry: str, without: str, why_not_on: str
) -> Switch:
    """Return the switch of an effect that materials state, and that no switch can invent.

    attribute, taken_out_by : as for :func:`out_of_materials`. why_not_on : why it is not turned on.
    """
    return Switch(
        entry=entry,
        without=without,
        called=stated_by_materials(attribute),
        off=out_of_materials(attribute, taken_out_by),
        on=refused(why_not_on),
    )


def of_elements(change: Callable[[SheetElement], SheetElement]) -> Answer:
    """Return the answer of a switch that changes the elements of every ply.

    change : returns the changed table of one element, or raises :class:`Refusal`.
    """

    def changed(scene: EffectScene) -> dict[str, Any]:
        changes: dict[str, Any] = {}
        if "element" in scene.stack.elements:
            changes["element"] = change(scene.element)
        if scene.plies:
            changes["plies"] = tuple(
                ply
                if ply.element is None
                else ply.model_copy(update={"element": change(ply.element)})
                for ply in scene.plies
            )
        return changes

    return changed


def of_materials(
    name: str, model: EffectModel, in_words: Callable[[Material], str | None], nothing: str
) -> Effect:
    """Return an effect of the laws of all bodies.

    Parameters
    ----------
    in_words : says what a material has of it, None for nothing. nothing : the reason where none
        has it.
    """
    told = dict.fromkeys(filter(None, (in_words(body.material) for body in model.bodies)))
    return Effect(name, bool(told), " and ".join(told) or nothing)


def of_the_laws(
    name: str, in_words: Callable[[Material], str | None], nothing: str
) -> Callable[[EffectModel], list[Effect]]:
    """Return the function ``active(model)`` of an effect of laws (:func:`of_materials`)."""
    return lambda model: [of_materials(name, model, in_words, nothing)]


def of_the_elements(name: str) -> Callable[[EffectModel], list[Effect]]:
    """Return the function ``active(model)`` of an effect that the elements themselves compute.

    It is read from the constants that the kernels of each body are compiled for. Bodies with the
    same answer share an effect, which names them where they are not all.
    """

    def active(model: EffectModel) -> list[Effect]:
        alike: dict[tuple[bool, str], list[str]] = {}
        for body in model.bodies:
            effects = body.effects()
            if name in effects:
                alike.setdefault(effects[name], []).append(body.name)
        return [
            Effect(
                name if len(names) == len(model.bodies) else f"{name} of {', '.join(names)}",
                *told,
            )
            for told, names in alike.items()
        ]

    return active
