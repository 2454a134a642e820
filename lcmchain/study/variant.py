"""A setting of a study: what it changes of a scene."""

from __future__ import annotations

from dataclasses import dataclass


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
