"""What a study varies, as a setting, and what any source of runs answers: scene file or coupon."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

from lcmchain.errors import InputError
from lcmchain.scene import Scene
from lcmchain.study.outcome import Outcome


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


#: Called with (completed, total, text).
Progress = Callable[[float, float, str], None]


class Job(Protocol):
    """One run of a study: its scene, what decides its numbers, and how it is made."""

    @property
    def scene(self) -> Scene:
        """The scene, with all that a study leaves out of its output left out."""

    @property
    def fingerprint(self) -> str:
        """Hash of all that decides the numbers of the run."""

    def run(self, threads: int | None, tell: Progress | None = None) -> Outcome:
        """Run, and return what a study keeps.

        Raises
        ------
        SimulationError : a guard stopped the run.
        InputError : no model can be made of the scene, as of a mesh too coarse for it.
        """


class Source(Protocol):
    """What a study varies, with what a worker on another machine needs to build it."""

    @property
    def path(self) -> str:
        """Where it comes from, for messages."""

    def scene(self, overrides: tuple[str, ...] = (), model: str | None = None) -> Scene:
        """Return the scene with further overrides, on a rung of its own where one is named.

        Raises
        ------
        InputError : an entry is wrong.
        """

    def job(self, variant: Variant) -> Job:
        """Return the run of a variant.

        Raises
        ------
        InputError : the variant does not fit the scene; names the variant.
        """

    def effect_parts(self) -> dict[str, float]:
        """Return the parts of a step's time that effects take, where they can be measured."""
