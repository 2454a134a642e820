"""Twins of classes of laws: all that a class answers, and one thing more.

What a fabric may know beside the published law (locking, a constant C33, thickening by shear,
bending by curves, a shear that depends on its rate, friction) is a class of its own, with the
parameters that it takes: where a scene states none of it, kernels hold none of this.

Of some kinds of twins there are too many to make them all, since each may be made of any other:
they are made when their name is asked for (:func:`made_on_demand`).
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping
from typing import Any, NamedTuple

from lcmchain.dispatch import implements, inherit

# Classes of laws of which twins can be made on demand, by their names, and the twins so far.
_bases: dict[str, Any] = {}
_twins: dict[str, Any] = {}
# What makes twins, by the pattern of their names.
_makers: dict[re.Pattern[str], Callable[[re.Match[str], Any], Any]] = {}


def twin_of(
    law_class: Any,
    prefix: str,
    *,
    about: str,
    entries: Iterable[tuple[str, Any]] = (),
    answers: Mapping[Any, Any],
) -> Any:
    """Return the twin of a class of laws; it answers all that the class answers so far.

    It must be a global of the class's own module, under its own name: compiled kernels on disk
    look it up there.

    Parameters
    ----------
    prefix : of the twin's name. about : its parameters in words, behind those of the class.
    entries : name and type of its further parameters.
    answers : its own compiled function for each function of a protocol.
    """
    fields = [*law_class.__annotations__.items(), *entries]
    twin: Any = NamedTuple(f"{prefix}{law_class.__name__}", fields)  # type: ignore[misc]
    twin.__doc__ = f"Parameters of :class:`{law_class.__name__}`{about}"
    twin.__module__ = law_class.__module__
    # what a class tells of itself beside its parameters: memory, and where parts of it stand
    for told in TOLD:
        if hasattr(law_class, told):
            setattr(twin, told, getattr(law_class, told))
    inherit(twin, law_class)
    for function, answer in answers.items():
        implements(function, twin)(answer)
    return twin


#: What a twin takes over from its class as it is.
TOLD = (
    "remembers",
    "knows_step",
    "relaxing_count",
    "rate_factor_at",
    "viscous_place",
    "maxwell_count",
    "shear_friction_place",
    "bending_place",
    "bending_memory",
    "bending_elements",
    "bending_resists_rates",
)


def let_have_twins(*law_classes: Any) -> None:
    """Let twins of classes of laws be made on demand."""
    _bases.update({law_class.__name__: law_class for law_class in law_classes})


def made_on_demand(pattern: str) -> Callable[[Any], Any]:
    """Register what makes twins on demand.

    Parameters
    ----------
    pattern : of their names, with the group ``base`` for that of their class. The decorated
        function takes the match and the class, and returns the twin; its module must look up names
        by :func:`twin_named` in its ``__getattr__``.
    """

    def register(make: Any) -> Any:
        _makers[re.compile(pattern)] = make
        return make

    return register


def twin_named(name: str) -> Any:
    """Return a class of laws that twins can be made of, or a twin on demand, by its name.

    Raises
    ------
    AttributeError : no class has this name.
    """
    found = [(make, match) for p, make in _makers.items() if (match := p.fullmatch(name))]
    if not found and name not in _bases:
        raise AttributeError(f"{name} is no law of which there are twins")
    if found and name not in _twins:
        from lcmchain.materials import laws  # noqa: F401, the classes that twins are made of

        ((make, match),) = found
        twin = make(match, twin_named(match["base"]))
        twin.__module__ = make.__module__
        _twins[name] = twin
    return _twins[name] if found else _bases[name]
