"""Twins of classes of laws: all that a class answers, and one thing more.

What a fabric may know beside the published law (:mod:`lcmchain.materials.features`) is a class of
its own, with the parameters that it takes: kernels of a scene that states none of it hold none of
it.

Some twins have names of their own and are globals of the module of their law (``name_twins`` in
``fabric.py``). Of the other kinds there are too many to make them all, since each may be made of
any other: they are made when their name is asked for (:func:`made_on_demand`). A process that takes
a compiled kernel from disk asks for them by that name, in the module :data:`HOME`, which imports
all laws first.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping
from typing import Any, NamedTuple, TypeVar

from lcmchain.dispatch import Dispatched, implements, inherit

#: The module that offers the twins that are made on demand: it knows all laws of the package.
HOME = "lcmchain.materials.laws"

#: What a twin takes over from its class as it is, beside its parameters: what it remembers, and how
#: many elements of each kind it has.
TOLD = (
    "remembers",
    "knows_step",
    "relaxing_count",
    "maxwell_count",
    "bending_memory",
    "bending_elements",
    "bending_resists_rates",
)

#: A law, or its twin, which has all that the law has.
LawOrTwin = TypeVar("LawOrTwin", bound=tuple[Any, ...])

Maker = Callable[[re.Match[str], type], type]

# Classes of laws of which twins can be made on demand, by their names, and the twins so far.
_bases: dict[str, type] = {}
_twins: dict[str, type] = {}
# All twins, by their class and prefix.
_prefixed: dict[tuple[type, str], Any] = {}
# What makes twins, by the pattern of their names.
_makers: dict[re.Pattern[str], Maker] = {}


def twin_of(
    law_class: type,
    prefix: str,
    *,
    about: str,
    entries: Iterable[tuple[str, type]] = (),
    answers: Mapping[Dispatched, Callable[..., Any]],
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
    for told in TOLD:
        if hasattr(law_class, told):
            setattr(twin, told, getattr(law_class, told))
    inherit(twin, law_class)
    for function, answer in answers.items():
        implements(function, twin)(answer)
    _prefixed[law_class, prefix] = twin
    return twin


def prefixed(law: object, prefix: str) -> Any:
    """Return the twin of the class of a law that was made with a prefix."""
    return _prefixed[type(law), prefix]


def let_have_twins(*law_classes: type) -> None:
    """Let twins of classes of laws be made on demand."""
    _bases.update({law_class.__name__: law_class for law_class in law_classes})


def made_on_demand(pattern: str) -> Callable[[Maker], Maker]:
    """Register what makes twins on demand.

    Parameters
    ----------
    pattern : of their names, with the group ``base`` for that of their class. The decorated
        function takes the match and the class, and returns the twin.
    """

    def register(make: Maker) -> Maker:
        _makers[re.compile(pattern)] = make
        return make

    return register


def twin_named(name: str) -> Any:
    """Return a class of laws that twins can be made of, or a twin on demand, by its name.

    Raises
    ------
    AttributeError : no class has this name.
    """
    if name in _bases:
        return _bases[name]
    if name not in _twins:
        matches = [(make, match) for p, make in _makers.items() if (match := p.fullmatch(name))]
        if not matches:
            raise AttributeError(f"{name} is no law of which there are twins")
        ((make, match),) = matches
        twin = make(match, twin_named(match["base"]))
        twin.__module__ = HOME
        _twins[name] = twin
    return _twins[name]
