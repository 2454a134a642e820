"""Whether a piece of physics is in a compiled model, and why; and whether a scene may switch it."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any, NamedTuple


class Effect(NamedTuple):
    """A piece of physics, whether it is in the model, and why.

    key : entry of ``[effects]`` that it belongs to, empty for one that no scene can switch.
    """

    name: str
    active: bool
    reason: str
    key: str = ""


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
    called: Callable[[Any], bool | None]
    off: Callable[[Any], dict[str, Any]]
    on: Callable[[Any], dict[str, Any]]
    unless: str = ""


def refused(reason: str) -> Callable[[Any], dict[str, Any]]:
    """Return the answer of a switch that no scene may turn that way."""

    def refuse(scene: Any) -> dict[str, Any]:
        raise Refusal(reason)

    refuse.reason = reason  # type: ignore[attr-defined]
    return refuse


def of_table(table: str, **entries: Any) -> Callable[[Any], dict[str, Any]]:
    """Return the answer of a switch that sets entries of a table."""

    def change(scene: Any) -> dict[str, Any]:
        return {table: getattr(scene, table).model_copy(update=entries)}

    return change


def stated_by_materials(attribute: str) -> Callable[[Any], bool]:
    """Return what tells whether the material of any ply states an effect.

    attribute : of a material's table, whether it does.
    """
    return lambda scene: any(getattr(own, attribute) for own in scene.stack.materials.values())


def out_of_materials(attribute: str, without: str) -> Callable[[Any], dict[str, Any]]:
    """Return the answer of a switch that takes an effect out of the materials of all plies.

    attribute : of a material's table, whether it states it. without : its method that takes it out.
    """

    def off(scene: Any) -> dict[str, Any]:
        def changed(material: Any) -> Any:
            states = material is not None and getattr(material, attribute)
            return getattr(material, without)() if states else material

        changes = {"material": changed(scene.material)}
        if scene.materials:
            changes["materials"] = {key: changed(own) for key, own in scene.materials.items()}
        return changes

    return off


def of_elements(change: Callable[[Any], Any]) -> Callable[[Any], dict[str, Any]]:
    """Return the answer of a switch that changes the elements of every ply.

    change : returns the changed table of one element, or raises :class:`Refusal`.
    """

    def changed(scene: Any) -> dict[str, Any]:
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
    name: str, model: Any, in_words: Callable[[Any], str | None], nothing: str
) -> Effect:
    """Return an effect of the laws of all bodies.

    Parameters
    ----------
    model : a :class:`lcmchain.model.Model`. in_words : says what a material has of it, None for
        nothing. nothing : the reason where none has it.
    """
    told = dict.fromkeys(filter(None, (in_words(body.material) for body in model.bodies)))
    return Effect(name, bool(told), " and ".join(told) or nothing)


def of_the_elements(name: str) -> Callable[[Any], list[Effect]]:
    """Return the function ``active(model)`` of an effect that the elements themselves compute.

    Bodies of which the same is told stand together; their names are told where they are not all.

    What it tells is read from the constants that the kernels of each body are compiled for;
    ``model`` is a :class:`lcmchain.model.Model`.
    """

    def active(model: Any) -> list[Effect]:
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
