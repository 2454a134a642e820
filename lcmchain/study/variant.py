"""A setting of a study: what it changes of a scene."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from lcmchain.errors import InputError


@dataclass(frozen=True)
class Variant:
    """One setting.

    Parameters
    ----------
    name : short, unique in a study.
    axis : what is varied, such as ``edge length``.
    overrides : ``key=value`` texts, as for :func:`lcmchain.scene.read_scene`.
    value : of what is varied, in SI, for orders and charts; None where it is no number.
    model : rung of the model ladder; None is that of the scene.
    """

    name: str
    axis: str
    overrides: tuple[str, ...] = ()
    value: float | None = None
    model: str | None = None


def require_free(overrides: Sequence[str], of_study: Sequence[str]) -> None:
    """Refuse to vary an entry that the study itself sets in every run: it would vary nothing.

    Parameters
    ----------
    overrides : of a variant. of_study : those that the study puts behind them.

    Raises
    ------
    InputError : names the entry.
    """
    taken = [text.partition("=")[0] for text in of_study]
    for key in (text.partition("=")[0].strip() for text in overrides):
        if any(key == entry or key.startswith((f"{entry}.", f"{entry}[")) for entry in taken):
            raise InputError("cannot be varied: the study sets it in every run", key=key)
