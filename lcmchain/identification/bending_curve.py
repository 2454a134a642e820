"""Moment over curvature of strips that bend under their own weight, from their deflection curves.

Along a strip the moment of the weight beyond each place is known from its shape, and the curvature
from a curve of piecewise linear curvature through its points
(:func:`lcmchain.identification.deflection_curve.stiffness_along_strip`). A strip that hangs far
runs through all curvatures from its tip to its clamp. From these points a curve is brought, by
least squares, to give the measured shapes (:mod:`lcmchain.coupons.analytic.bending_curve`).
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.optimize import least_squares

from lcmchain.coupons.analytic import (
    CANTILEVER_ANGLE,
    MomentCurve,
    curve_elastica,
    curve_elastica_with_tip_slope,
)
from lcmchain.errors import InputError
from lcmchain.identification.bending import ALONG_FIBRE, bending_constants
from lcmchain.identification.cantilever_tests import Cantilever, cantilever_tests
from lcmchain.identification.data import CouponData
from lcmchain.identification.deflection_curve import length_of_line, signed_distance
from lcmchain.identification.result import Band, Identification, Panel, Points, accepted

# Curvatures of the points over the largest one that the strips show.
SHARES = np.array([0.02, 0.05, 0.12, 0.3, 1.0])
# The moment grows with such powers of the curvature in the curves with which the search begins:
# from one that is too soft, or not soft enough, it ends in a valley beside.
POWERS = (0.1, 0.5)
# Part of its length by which a strip may hang beside its shape.
CLOSE_SHAPE = 0.01


def identify_bending_curve(
    data: CouponData,
    *,
    areal_weight: float,
    angle: float = CANTILEVER_ANGLE,
    accept: bool = False,
    **rest: Any,
) -> Identification:
    """Identify curves of both fibre directions beside constants of the whole strips.

    Parameters are those of :func:`lcmchain.identification.bending.identify_bending`; ``data`` must
    be deflection curves. That one stiffness does not describe them is no objection to a curve.

    Raises
    ------
    InputError : the data are no deflection curves, or show no curve.
    FitRefusedError : a strip of a curve hangs otherwise than it was measured, and ``accept`` is not
        given.
    """
    tests = cantilever_tests(data, areal_weight, angle)
    if not tests.curves:
        raise InputError(
            "has no deflection curves, from which a curve is found; give columns x and y",
            file=data.file,
        )
    constants = bending_constants(tests, data.file, areal_weight=areal_weight, **rest)
    entries = dict(constants.scene_entries)
    objections: list[str] = []
    panels = list(constants.panels)
    for number, direction in ((1, 0.0), (2, 0.5 * math.pi)):
        own = np.flatnonzero(np.abs(tests.orientation - direction) < ALONG_FIBRE)
        points = _points(tests, own, data.file)
        curve = _curve(tests, own, points, areal_weight)
        objections += _misses(tests, own, curve, areal_weight)
        entries[f"curve_{number}"] = _entry(curve)
        panels.append(_panel(number, points, curve))
    result = replace(
        constants,
        method=f"{constants.method}; curves from the curvature along deflection curves",
        scene_entries=entries,
        panels=tuple(panels),
        objections=tuple(objections),
        holds="the points between which the strips were measured" if objections else "",
    )
    return accepted(result, data.file, accept)


def _points(tests: Cantilever, strips: np.ndarray, file: str) -> np.ndarray:
    """Return curvature [1/m] and moment [N] of all known places of strips, (2, n), rising."""
    curvature = np.concatenate([tests.along[i].curvature for i in strips])
    moment = curvature * np.concatenate([tests.along[i].stiffness for i in strips])
    known = np.isfinite(moment) & (curvature > 0.0) & (moment > 0.0)
    if np.count_nonzero(known) < 2:
        raise InputError("shows too few curvatures for a curve; measure more points", file=file)
    order = np.argsort(curvature[known])
    return np.stack([curvature[known][order], moment[known][order]])


def _curve(tests: Cantilever, strips: np.ndarray, points: np.ndarray, weight: float) -> MomentCurve:
    """Return the softening curve whose strips hang as they were measured.

    Its slopes are those of least squares of the distances of all points from the shapes; the
    slopes of the strips at rest of their tips are found with them.
    """
    largest, moment = points[:, -1]
    curvature = largest * SHARES
    measured = [np.stack(tests.curves[strip][:2]) for strip in strips]
    lengths = [length_of_line(*line) for line in measured]
    tips = [math.atan2(*(line[:, -1] - line[:, -2])[::-1]) for line in measured]

    def curve_of(theta: np.ndarray) -> MomentCurve:
        slopes = np.exp(theta[0] - np.append(0.0, np.cumsum(theta[1 : SHARES.size])))
        return MomentCurve(curvature, np.cumsum(slopes * np.diff(curvature, prepend=0.0)))

    def residuals(theta: np.ndarray) -> np.ndarray:
        curve, found = curve_of(theta), []
        for line, length, tip in zip(measured, lengths, theta[SHARES.size :], strict=True):
            shape = curve_elastica_with_tip_slope(curve, weight, tip)
            own = (shape.load_parameter * curve.start_slope / weight) ** (1.0 / 3.0)
            away = signed_distance(line, own * np.stack([shape.x, shape.y]))
            found.append(np.append(away, own - length) / length)
        return np.concatenate(found)

    low = np.concatenate([[-np.inf], np.zeros(SHARES.size - 1), np.full(len(tips), 1e-3)])
    high = np.concatenate([np.full(SHARES.size, np.inf), np.full(len(tips), 1.56)])
    solutions = []
    for power in POWERS:
        at = moment * SHARES**power
        slope = np.diff(at, prepend=0.0) / np.diff(curvature, prepend=0.0)
        falls = np.maximum(-np.diff(np.log(slope)), 1e-2)
        start = np.concatenate([[math.log(slope[0])], falls, np.clip(tips, 0.02, 1.5)])
        # shapes are integrated to 1e-9: smaller steps would be those of its errors
        solutions.append(
            least_squares(residuals, start, bounds=(low, high), x_scale="jac", diff_step=1e-4)
        )
    return curve_of(min(solutions, key=lambda found: found.cost).x)


def _misses(tests: Cantilever, strips: np.ndarray, curve: MomentCurve, weight: float) -> list[str]:
    """Say of which strips the shape by the curve is not the measured one."""
    found = []
    for strip in strips:
        x, y = tests.curves[strip][:2]
        length = length_of_line(x, y)
        shape = curve_elastica(curve, weight, length)
        away = signed_distance(np.stack([x, y]), length * np.stack([shape.x, shape.y]))
        off = float(np.abs(away).max()) / length
        if off > CLOSE_SHAPE:
            found.append(
                f"the strip from line {tests.lines[strip]} on hangs up to {1e3 * off * length:.3g} "
                "mm beside the shape by its curve"
            )
    return found


def _entry(curve: MomentCurve) -> str:
    # so many digits that rounding makes no slope steeper than the first
    k, M = (" ".join(f"{value:.9g}" for value in np.asarray(part)) for part in curve)
    return f'{{ curvature = "{k} 1/m", moment = "{M} N" }}'


def _panel(number: int, points: np.ndarray, curve: MomentCurve) -> Panel:
    k, M = (np.append(0.0, part) for part in curve)
    measured: Any = Points(points[0], points[1], "along the strips")
    return Panel(
        f"curvature along fibre {number} [1/m]", "moment per width [N]", (measured,),
        (Band(k, M, f"curve_{number}"),),
    )  # fmt: skip
