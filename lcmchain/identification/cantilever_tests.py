"""Cantilever tests under own weight in the forms in which they are measured, brought to one."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from lcmchain.coupons.analytic import overhang_at_angle
from lcmchain.identification.data import Column, CouponData
from lcmchain.identification.deflection_curve import (
    StripStiffness,
    fit_deflection_curve,
    stiffness_along_strip,
)
from lcmchain.quantities.units import ANGLE, LENGTH

_ORIENTATION = Column("orientation", ANGLE)
COLUMNS = (
    (_ORIENTATION, Column("overhang", LENGTH)),
    (_ORIENTATION, Column("length", LENGTH), Column("angle", ANGLE)),
    (_ORIENTATION, Column("x", LENGTH, loading=1), Column("y", LENGTH)),
)
_FEWEST_CURVE_POINTS = 5


@dataclass(frozen=True)
class Cantilever:
    """Cantilever tests brought to one form: overhang and the chord angle reached.

    Attributes
    ----------
    orientation : from fibre 1 to the strip, folded to 0 ... 90° [rad], shape [test_count].
    overhang : [m], shape [test_count].
    angle : chord angle at that overhang [rad], shape [test_count].
    error : relative standard error of the overhang where a deflection curve tells it, else nan.
    curves : (x, y, fitted x, fitted y, orientation) of each deflection curve [m].
    along : stiffness along the strip of each deflection curve; empty without curves.
    lines : first line of each test in the file, shape [test_count].
    """

    orientation: np.ndarray
    overhang: np.ndarray
    angle: np.ndarray
    error: np.ndarray
    lines: np.ndarray
    curves: tuple = ()
    along: tuple[StripStiffness, ...] = ()


def cantilever_tests(data: CouponData, areal_weight: float, angle: float) -> Cantilever:
    """Bring overhangs, length-angle pairs or deflection curves to one form."""
    orientation = np.abs(data["orientation"]) % np.pi
    orientation = np.minimum(orientation, np.pi - orientation)
    if "overhang" in data:
        _require_positive(data, "overhang")
        unknown = np.full(len(orientation), np.nan)
        angles = np.full(len(orientation), angle)
        return Cantilever(orientation, data["overhang"], angles, unknown, data.lines)
    if "length" in data:
        _require_positive(data, "length")
        low, high = math.radians(1.0), math.radians(85.0)
        outside = np.flatnonzero((data["angle"] < low) | (data["angle"] > high))
        if len(outside):
            raise data.wrong("angle", outside[0], "must lie between 1 deg and 85 deg")
        unknown = np.full(len(orientation), np.nan)
        return Cantilever(orientation, data["length"], data["angle"], unknown, data.lines)
    return _tests_from_curves(data, orientation, areal_weight, angle)


def _tests_from_curves(data, orientation, areal_weight, angle) -> Cantilever:
    keys = np.round(np.degrees(orientation), 3) * 1e6 + data.specimen
    kept, overhang, error, lines, curves, along = [], [], [], [], [], []
    for key in np.unique(keys):
        rows = np.flatnonzero(keys == key)
        if len(rows) < _FEWEST_CURVE_POINTS:
            raise data.wrong(
                "x", rows[0], f"a deflection curve needs at least {_FEWEST_CURVE_POINTS} points"
            )
        x, y = data["x"][rows], data["y"][rows]
        drop = y if y[-1] > 0.0 else -y  # heights may be counted upwards
        if drop[-1] <= 0.0 or x[-1] <= 0.0:
            raise data.wrong("y", rows[-1], "the tip must lie below and in front of the clamp")
        stiffness, relative_error, fitted = fit_deflection_curve(x, drop, areal_weight)
        kept.append(orientation[rows[0]])
        overhang.append(float(overhang_at_angle(stiffness, areal_weight, angle)))
        error.append(relative_error / 3.0)  # the overhang goes with the cube root
        lines.append(data.lines[rows[0]])
        curves.append((x, drop, *fitted, orientation[rows[0]]))
        along.append(stiffness_along_strip(x, drop, stiffness, fitted))
    return Cantilever(
        np.array(kept), np.array(overhang), np.full(len(kept), angle), np.array(error),
        np.array(lines), tuple(curves), tuple(along),
    )  # fmt: skip


def _require_positive(data: CouponData, column: str) -> None:
    wrong = np.flatnonzero(data[column] <= 0.0)
    if len(wrong):
        raise data.wrong(column, wrong[0], "must be positive")
