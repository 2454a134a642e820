"""Cantilever test: a strip bends under its own weight until its tip touches an inclined plane.

Source: Schäfer, Mitsch, Kärger, section 3.3; ISO 9073-7. The strip is solved quasi-statically
(``lcmchain.statics``), its overhang is varied until the line from clamp to tip falls by 41.5°. The
reference is the heavy elastica with D = C^B t³/12 (:func:`lcmchain.coupons.analytic.elastica`). At
orientations between the fibres a strip is neither free to twist nor held from it: its overhang lies
between those of the two limits.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from lcmchain.coupons.analytic import (
    CANTILEVER_ANGLE,
    MomentCurve,
    elastica,
    load_parameter_at_chord_angle,
    overhang_at_angle,
    overhang_by_curve,
    strip_stiffness,
)
from lcmchain.coupons.result import Comparison, CouponResult, finish, two_panels
from lcmchain.coupons.specimen import (
    Progress,
    require_fabric,
    require_solid_shell,
)
from lcmchain.errors import InputError, SimulationError
from lcmchain.materials.fabric import FabricMaterial
from lcmchain.model import build_model
from lcmchain.report.style import INK, SERIES
from lcmchain.scene import Element, Scene
from lcmchain.statics import StaticProblem, solve
from lcmchain.tools.motion import STANDARD_GRAVITY

ORIENTATIONS = (0.0, 0.25 * math.pi, 0.5 * math.pi)  # of fibre 1 to the strip [rad]
ANGLE_TOLERANCE = math.radians(0.005)
# Two overhangs this close [m] with the angle between them end the search: the test itself reads no
# finer (ISO 9073-7: to 1 mm). The mesh of a strip at an angle to the fibres depends on its length,
# so that the tip's fall jumps by up to some degrees from one overhang to the next.
OVERHANG_TOLERANCE = 0.5e-3
MOST_STRIPS = 20  # overhangs that are tried until the tip falls by the angle
LOAD_STEP = 0.1
CURVE_POINTS = 41
# Closer than this to a fibre direction a strip bends as along the fibre.
ALIGNED = math.radians(0.1)


class Strip(NamedTuple):
    """Equilibrium of a strip: centre line (n, 2) reach and drop [m], and the length along it."""

    overhang: float
    arc: np.ndarray
    line: np.ndarray

    @property
    def chord_angle(self) -> float:
        """Fall of the line from clamp to tip [rad]."""
        return math.atan2(self.line[-1, 1], self.line[-1, 0])


def cantilever(
    material: FabricMaterial,
    element: Element | None = None,
    *,
    orientations: Sequence[float] = ORIENTATIONS,
    width: float = 25e-3,
    angle: float = CANTILEVER_ANGLE,
    edge_length: float = 5e-3,
    progress: Progress | None = None,
) -> CouponResult:
    """Find the overhang at which strips of several orientations fall by the angle of the test.

    Parameters
    ----------
    material : fabric of a scene; element : its element options.
    orientations : angles from the strip to fibre 1 [rad].
    width : of the strips [m]; angle : fall of the line from clamp to tip [rad].
    edge_length : of the elements [m].

    Raises
    ------
    InputError : the material is no fabric or loses energy as it is bent, or the element is no
        solid-shell.
    SimulationError : no equilibrium was found.
    """
    require_fabric(material)
    require_solid_shell(element)
    if material.bending_rubs or material.bending_resists_rates:
        raise InputError(
            "loses energy (friction_1, viscous_1, ...), of which the equilibrium of a cantilever "
            "knows nothing; lcmchain coupon pure-bending shows the loop, or leave them out",
            key="material.bending",
        )
    weight = material.areal_mass * STANDARD_GRAVITY
    curves, comparisons, strips = {}, [], []
    for number, orientation in enumerate(orientations):
        if progress is not None:
            progress(number, len(orientations), "bending under own weight")
        expected = _expected_overhangs(material, orientation, weight, angle)
        guess = float(np.mean(list(expected.values())))
        strip = _strip_at_angle(
            material, element or Element(), orientation, width, edge_length, guess, angle
        )
        strips.append(strip)
        name = f"{math.degrees(orientation):g}°"
        s = np.linspace(0.0, 1.0, CURVE_POINTS)
        for column, direction in enumerate(("reach", "drop")):
            values = np.interp(s, strip.arc / strip.overhang, strip.line[:, column])
            curves[f"{direction} {name} [mm]"] = 1e3 * values
        comparisons += [
            Comparison(f"overhang at {name}", "mm", 1e3 * strip.overhang, 1e3 * overhang, origin)
            for origin, overhang in expected.items()
        ]
    title = f"Cantilevers of {material.name} under their own weight"
    return CouponResult(
        name="cantilever",
        settings={
            "specimen": f"{1e3 * width:g} mm wide",
            "elements": f"elements of {1e3 * edge_length:g} mm",
            "angle": f"tip {math.degrees(angle):.3g}° below the clamp",
        },
        curves=curves,
        comparisons=tuple(comparisons),
        draw=lambda path: _draw(path, title, orientations, strips, comparisons, angle),
        figures={
            f"overhang_{math.degrees(orientation):g}_m": strip.overhang
            for orientation, strip in zip(orientations, strips, strict=True)
        },
    )


def bent_strip(
    material: FabricMaterial, element: Element, orientation: float, *, overhang: float,
    width: float, edge_length: float, gravity: float = STANDARD_GRAVITY,
) -> Strip:  # fmt: skip
    """Return the equilibrium of a strip clamped level at one end.

    Parameters
    ----------
    gravity : acceleration along -z [m/s²].

    Raises
    ------
    SimulationError : no equilibrium was found.
    """
    scene = Scene(
        title="cantilever",
        material=material,
        element=element,
        process={"time": 1.0},
        blank={"size": (overhang, width), "edge_length": edge_length, "fibre_angle": orientation},
    )
    model = build_model(scene)
    (body,) = model.bodies
    X = body.mesh.node_positions
    held = np.tile(X[:, 0] < -0.5 * overhang + 1e-9, (3, 1))
    problem = StaticProblem(model=model, held=held, gravity=(0.0, 0.0, -gravity))
    displacement = solve(problem, [1.0], first_step=LOAD_STEP)[-1].displacement

    n = body.mesh.pair_count
    arc = X[:n, 0] + 0.5 * overhang
    reach = arc + 0.5 * (displacement[0, :n] + displacement[0, n:])
    drop = -0.5 * (displacement[2, :n] + displacement[2, n:])
    # nodes of a cross-section: those that share their place along the strip
    places, section = np.unique(np.round(arc / overhang, 6), return_inverse=True)
    count = np.bincount(section)
    line = np.column_stack([np.bincount(section, v) / count for v in (reach, drop)])
    return Strip(overhang, places * overhang, line)


def _strip_at_angle(material, element, orientation, width, edge_length, overhang, angle) -> Strip:
    """Vary the overhang until the chord falls by ``angle``.

    The next overhang is that of a uniform elastica that fell as far as the strip did, or halves the
    interval in which the angle is known to lie.
    """
    target = load_parameter_at_chord_angle(angle)
    too_short: Strip | None = None
    too_long: Strip | None = None
    for _ in range(MOST_STRIPS):
        strip = bent_strip(
            material, element, orientation, overhang=overhang, width=width, edge_length=edge_length
        )
        if abs(strip.chord_angle - angle) < ANGLE_TOLERANCE:
            return strip
        if strip.chord_angle < angle:
            too_short = strip
        else:
            too_long = strip
        overhang *= (target / load_parameter_at_chord_angle(strip.chord_angle)) ** (1.0 / 3.0)
        if too_short is not None and too_long is not None:
            if too_long.overhang - too_short.overhang < OVERHANG_TOLERANCE:
                return min(too_short, too_long, key=lambda s: abs(s.chord_angle - angle))
            if not too_short.overhang < overhang < too_long.overhang:
                overhang = 0.5 * (too_short.overhang + too_long.overhang)
    raise SimulationError(
        f"no overhang was found at which a strip at {math.degrees(orientation):g}° falls by "
        f"{math.degrees(angle):.4g}°; the last one, {1e3 * strip.overhang:.4g} mm, fell by "
        f"{math.degrees(strip.chord_angle):.4g}°. Use a smaller edge length"
    )


def _expected_overhangs(material, orientation: float, weight: float, angle: float):
    """Return the overhang [m] of the elastica by its origin: one, or two limits."""
    cB, inertia = material.bending, material.thickness**3 / 12.0
    if abs(math.sin(2.0 * orientation)) < math.sin(2.0 * ALIGNED):
        first = abs(math.cos(orientation)) > 0.5
        curve = cB.curve_1 if first else cB.curve_2
        if curve is not None:
            points = MomentCurve(curve.curvature, curve.moment)
            return {"heavy elastica of the curve": overhang_by_curve(points, weight, angle)}
        along = (cB.C11 if first else cB.C22) * inertia
        return {"heavy elastica": float(overhang_at_angle(along, weight, angle))}
    C11, C22 = (
        stiffness if curve is None else curve.curve.start_slope / inertia
        for stiffness, curve in ((cB.C11, cB.curve_1), (cB.C22, cB.curve_2))
    )
    start = ", stiffness at the start" if any(cB.curves) else ""
    return {
        origin + start: float(
            overhang_at_angle(
                strip_stiffness(C11, C22, cB.C12, orientation, kind) * inertia, weight, angle
            )
        )
        for origin, kind in (
            ("elastica, free strip", "free-strip"),
            ("elastica, held across", "cylindrical"),
        )
    }


def _draw(path: Path, title, orientations, strips, comparisons, angle) -> None:
    with two_panels(path, "Cantilever test", title) as (left, right):
        for orientation, strip, colour in zip(orientations, strips, SERIES):
            name = f"{math.degrees(orientation):g}°"
            line = 1e3 * strip.line
            left.plot(line[:, 0], -line[:, 1], "o", ms=2.5, color=colour, label=name)
            shape = elastica(load_parameter_at_chord_angle(angle))
            L = 1e3 * strip.overhang
            left.plot(L * shape.x, -L * shape.y, "-", lw=0.9, color=colour)
            references = [c.reference for c in comparisons if c.quantity == f"overhang at {name}"]
            place = list(orientations).index(orientation)
            right.bar(place, L, 0.5, color=colour)
            right.hlines(references, place - 0.36, place + 0.36, color=INK, lw=1.2)
        reach = 1.05e3 * max(strip.line[-1, 0] for strip in strips)
        left.plot([0.0, reach], [0.0, -reach * math.tan(angle)], ":", color="#8a929c", lw=0.9)
        left.set_xlabel("reach [mm]  (dots: simulated, lines: elastica of the same overhang)")
        left.set_ylabel("drop [mm]")
        left.legend(loc="lower left", title="fibre 1 to strip")
        finish(left)
        left.set_ylim(-reach * math.tan(angle), 0.05 * reach)
        left.set_aspect("equal")
        right.set_xticks(range(len(orientations)),
                         [f"{math.degrees(o):g}°" for o in orientations])  # fmt: skip
        right.set_ylabel("overhang [mm]  (lines: elastica)")
        right.set_xlabel("orientation of fibre 1 to the strip")
        finish(right)
        right.set_xlim(-0.5, len(orientations) - 0.5)
