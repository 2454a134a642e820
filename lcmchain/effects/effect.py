"""Whether a piece of physics is in a compiled model, and why."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple


class Effect(NamedTuple):
    """A piece of physics, whether it is in the model, and why."""

    name: str
    active: bool
    reason: str


def of_the_elements(name: str) -> Callable[[Any], list[Effect]]:
    """Return the function ``active(model)`` of an effect that the elements themselves compute.

    What it tells is read from the constants that the kernels of each body are compiled for;
    ``model`` is a :class:`lcmchain.model.Model`.
    """

    def active(model: Any) -> list[Effect]:
        several = len(model.bodies) > 1
        found = []
        for body in model.bodies:
            effects = body.effects()
            if name in effects:
                title = f"{name} of {body.name}" if several else name
                found.append(Effect(title, *effects[name]))
        return found

    return active
