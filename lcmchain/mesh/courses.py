"""Courses of a blank: strips along fibre 1, side by side, each a piece of the sheet of its own.

A ply that is wider than its fabric is laid in strips. They are cut out of the blank along lines of
fibre 1 and share no nodes: nothing holds them together where they meet, nor apart. A strip is
meshed as a blank of its own, so that the elements beside a joint are whole.
"""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Annotated, Self

import numpy as np
import shapely
from pydantic import Field, model_validator

from lcmchain.errors import InputError
from lcmchain.quantities.entry_types import Length, LengthOrZero, Row, SceneModel, wrong

#: Most joints of a ply.
MOST_JOINTS = 199


class Courses(SceneModel):
    """Courses that a blank is laid in: where they meet."""

    joints: Annotated[
        tuple[Length, ...],
        Row('["-50 mm", "50 mm"]', minimum_count=1, maximum_count=MOST_JOINTS, entries="lengths"),
    ] = Field(
        description="Where courses meet, by growing distance along fibre 2 from the origin of "
        "size or outline."
    )
    gap: LengthOrZero = Field(  # type: ignore[assignment]
        default="0 mm",
        description="Width that is left open at each joint, half on either side; 0 is a butt "
        "joint.",
    )

    @model_validator(mode="after")
    def _check_joints(self) -> Self:
        for number, (lower, upper) in enumerate(pairwise(self.joints), start=1):
            if upper - lower <= self.gap:
                raise wrong(
                    f"is {1e3 * upper:.4g} mm, which leaves no course above the joint before it, "
                    f"at {1e3 * lower:.4g} mm; write the joints from the lowest to the highest",
                    field=f"joints[{number}]",
                )
        return self

    def shifted(self, way: float) -> Self:
        """Return the courses of a blank that lies further along fibre 2 [m]."""
        return self.model_copy(update={"joints": tuple(joint + way for joint in self.joints)})

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the courses, from the lowest to the highest."""
        return strip_names(len(self.joints) + 1)

    def strips(self, lowest: float, highest: float) -> list[tuple[float, float]]:
        """Return where each course begins and ends along fibre 2 [m].

        lowest, highest : ends of the blank along fibre 2 [m].
        """
        half = 0.5 * self.gap
        begins = [lowest, *(joint + half for joint in self.joints)]
        ends = [*(joint - half for joint in self.joints), highest]
        return list(zip(begins, ends, strict=True))


def strip_names(count: int) -> tuple[str, ...]:
    """Return the names of the courses of a blank, from the lowest to the highest."""
    return tuple(f"strip_{number}" for number in range(1, count + 1))


def strip_of(
    blank: shapely.Polygon, fibre_angle: float, strip: tuple[float, float]
) -> shapely.Geometry:
    """Return what of a blank lies between two distances along fibre 2 [m]."""
    cosine, sine = math.cos(fibre_angle), math.sin(fibre_angle)
    axes = np.array([[cosine, sine], [-sine, cosine]])
    along = np.array(blank.exterior.coords) @ axes[0]
    low, high = strip
    corners = [(u, v) for u in (along.min() - 1.0, along.max() + 1.0) for v in (low, high)]
    box = shapely.Polygon(np.array(corners)[[0, 2, 3, 1]] @ axes)
    return blank.intersection(box)


def outlines_of(rim: np.ndarray, fibre_angle: float, courses: Courses) -> list[np.ndarray]:
    """Return the corners (n, 2) [m] of every course of a blank, the lowest first.

    Parameters
    ----------
    rim : corners of the blank (n, 2) [m]. fibre_angle : from x to fibre 1 [rad].

    Raises
    ------
    InputError : a joint beside the blank, or a course that is not one piece.
    """
    across = rim @ np.array([-math.sin(fibre_angle), math.cos(fibre_angle)])
    low, high = float(across.min()), float(across.max())
    half = 0.5 * courses.gap
    for number, joint in enumerate(courses.joints):
        if not low < joint - half <= joint + half < high:
            raise InputError(
                f"lies at {1e3 * joint:.4g} mm along fibre 2, where the blank, from "
                f"{1e3 * low:.4g} to {1e3 * high:.4g} mm, leaves no course beside it; leave it "
                "out, or move it inside",
                key=f"blank.courses.joints[{number}]",
            )
    # An end exactly at the rim would cut it a second time, a rounding error beside its corners.
    beyond = high - low
    strips = courses.strips(low - beyond, high + beyond)
    outlines = []
    for name, strip in zip(courses.names, strips, strict=True):
        part = strip_of(shapely.Polygon(rim), fibre_angle, strip)
        if not isinstance(part, shapely.Polygon) or part.is_empty:
            raise InputError(
                f"cut the blank such that {name}, from {1e3 * max(strip[0], low):.4g} to "
                f"{1e3 * min(strip[1], high):.4g} mm along fibre 2, is not one piece; move the "
                "joints",
                key="blank.courses.joints",
            )
        ring = shapely.geometry.polygon.orient(part).exterior
        outlines.append(np.array(ring.coords[:-1]))
    return outlines
