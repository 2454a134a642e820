"""What a study varies: a scene file, or a coupon test. Both answer the same few questions."""

from __future__ import annotations

import difflib
from collections.abc import Callable
from pathlib import Path
from typing import Protocol

from lcmchain.coupons.pulled import PULLED
from lcmchain.errors import InputError
from lcmchain.scene import Scene
from lcmchain.study.outcome import Outcome
from lcmchain.study.variant import Variant

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


def read_source(name: Path | str, overrides: tuple[str, ...] = ()) -> Source:
    """Return the scene of a file, or the coupon test of that name, to be varied by a study.

    Raises
    ------
    InputError : there is neither such a file nor such a coupon, or an override is wrong.
    """
    from lcmchain.study.coupon_text import CouponText
    from lcmchain.study.scene_text import SceneText

    path = Path(name)
    coupon = str(name).replace("_", "-")
    source: Source
    if coupon in PULLED and not path.exists():
        source = CouponText(coupon, overrides)
    elif path.exists() or path.suffix:
        source = SceneText.from_file(path, overrides)
    else:
        near = difflib.get_close_matches(coupon, PULLED, 1, 0.5)
        raise InputError(
            f'"{name}" is neither a scene file nor a coupon that can be studied, which are '
            f"{' and '.join(PULLED)}" + (f'; did you mean "{near[0]}"?' if near else "")
        )
    source.scene()  # wrong input is told before a folder is made
    return source
