"""Twins of classes of laws: all that a class answers, and one thing more.

What a fabric may know beside the published law (locking, a constant C33, thickening by shear,
bending by curves, a shear that depends on its rate) is a class of its own, with the parameters that
it takes: where a scene states none of it, kernels hold none of it.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

from lcmchain.dispatch import implements, inherit


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
    for told in ("remembers", "knows_step", "relaxing_count", "rate_factor_at"):
        if hasattr(law_class, told):
            setattr(twin, told, getattr(law_class, told))
    inherit(twin, law_class)
    for function, answer in answers.items():
        implements(function, twin)(answer)
    return twin
