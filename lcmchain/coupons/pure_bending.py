"""Pure bending: a short strip is bent to one curvature, back, to the other side, and round again.

Kawabata's test (KES-FB2) of the moment over the curvature, with its loop. One end of the strip is
clamped, the other one is led along the polygon of the elements' chords and turned with it, so that
the curvature is the same everywhere and the fibres keep their length. The moment is the work of the
led end over its turn. The reference is the law along the curvature over time: the elastic part,
friction and what resists the rate.

Source: Kawabata, "The standardization and analysis of hand evaluation" (1980): B from the slope,
2HB from the width of the loop at 1 1/cm.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np

from lcmchain.coupons.result import Comparison, CouponResult, finish_loop, two_panels
from lcmchain.coupons.specimen import (
    Loop,
    Progress,
    effort_of,
    record,
    require_fabric,
    require_solid_shell,
)
from lcmchain.effects.supports import Support
from lcmchain.materials.fabric import FabricMaterial
from lcmchain.materials.law import Material, bending_losses_of, bending_response
from lcmchain.mesh.blank import BlankMesh
from lcmchain.report.style import INK, SERIES
from lcmchain.scene import Element, Scene

# Time of a quarter of a loop [s], slow against the waves of a strip of some centimetres.
QUARTER = 0.1
# Frames of a quarter: two of them are one interval over which the work is taken.
QUARTER_FRAMES = 24
MASS_DAMPING = 100.0  # [1/s]
# Steps in which the law is followed along a quarter.
PATH_STEPS = 2000


def pure_bending(
    material: FabricMaterial,
    element: Element | None = None,
    *,
    curvature: float = 20.0,
    cycles: int = 2,
    fibre: int = 1,
    length: float = 20e-3,
    width: float = 20e-3,
    edge_length: float = 5e-3,
    progress: Progress | None = None,
) -> CouponResult:
    """Simulate a test of pure bending along a fibre direction.

    Parameters
    ----------
    material : fabric of a scene; element : its element options.
    curvature : largest, to both sides [1/m]; cycles : loops.
    fibre : direction that is bent, 1 or 2.
    length, width : of the strip between its ends [m]; edge_length : of the elements [m].

    Raises
    ------
    InputError : the material is no fabric, or the element no solid-shell.
    """
    require_fabric(material, knows_losses=True)
    require_solid_shell(element)
    turns = [0.0, *(side * curvature for _ in range(cycles) for side in (1.0, -1.0)), curvature]
    loop = Loop(turns, QUARTER)
    scene = Scene(
        title=f"Pure bending of {material.name} along fibres {fibre}, ±{curvature:.4g} 1/m",
        material=material,
        element=element or Element(),
        process={
            "time": loop.duration,
            "frames": QUARTER_FRAMES * round(loop.duration / QUARTER) + 1,
            "mass_damping": MASS_DAMPING,
        },
        blank={
            "size": (length, width),
            "edge_length": edge_length,
            "fibre_angle": 0.0 if fibre == 1 else 0.5 * math.pi,
        },
    )
    simulation, recording = record(scene, bent_ends(loop), progress=progress)
    (body,) = simulation.model.bodies
    count = chord_count(body.mesh)
    at_ends = np.array([loop.travel(t) for t in recording.time[::2]])
    turn = 2.0 * count * np.arcsin(0.5 * at_ends * length / count)
    moment = np.diff(recording.work[::2]) / (np.diff(turn) * width)
    time = recording.time[1::2]
    bent = np.array([loop.travel(t) for t in time])
    path = np.linspace(0.0, loop.duration, PATH_STEPS * round(loop.duration / QUARTER) + 1)
    curves = {
        "time [s]": time,
        "curvature [1/m]": bent,
        "moment [N]": moment,
        "analytic moment [N]": np.interp(
            time, path, moments_along(body.material, fibre, loop.travel, path)
        ),
    }
    title = scene.title
    return CouponResult(
        name="pure-bending",
        settings={
            "specimen": f"{1e3 * length:g} mm long",
            "elements": f"elements of {1e3 * edge_length:g} mm",
            "curvature": f"to ±{curvature:g} 1/m, {cycles} times",
        },
        curves=curves,
        comparisons=tuple(_comparisons(curves, loop, curvature)),
        draw=lambda path: _draw(path, curves, title),
        figures={**effort_of(simulation, recording), "energy": _last(recording.energy)},
    )


def bent_ends(loop: Loop) -> Callable[[BlankMesh], list[Support]]:
    """Return what clamps the left end of a strip along x, and leads the right one."""

    def supports(blank: BlankMesh) -> list[Support]:
        x = blank.node_positions[:, 0]
        count, chord = chord_count(blank), np.ptp(x) / chord_count(blank)
        pivot = np.array([x.max(), 0.0, blank.node_positions[:, 2].mean()])

        def led(time: float) -> np.ndarray:
            # by chords of the arc, each turned by an angle against the one before
            angle = 2.0 * math.asin(0.5 * loop.travel(time) * chord)
            slope = angle * (np.arange(count) + 0.5)
            there = np.array([x.min(), 0.0, pivot[2]])
            there += chord * np.array([np.cos(slope).sum(), 0.0, np.sin(slope).sum()])
            c, s = math.cos(count * angle), math.sin(count * angle)
            turned = np.array([[c, 0.0, -s], [0.0, 1.0, 0.0], [s, 0.0, c]])
            return np.column_stack([turned, there - turned @ pivot])

        return [
            Support("clamp", np.flatnonzero(x < x.min() + 1e-9), "xyz"),
            Support("led end", np.flatnonzero(x > x.max() - 1e-9), "xyz", motion=led),
        ]

    return supports


def chord_count(blank: BlankMesh) -> int:
    """Return how many elements follow each other along x."""
    return len(np.unique(np.round(blank.node_positions[:, 0], 9))) - 1


def moments_along(
    material: Material, fibre: int, travel: Callable[[float], float], times: np.ndarray
) -> np.ndarray:
    """Return the moments per width [N] of a law at times [s], from rest at the first one."""
    direction, height = fibre - 1, 0.5 * material.thickness
    bent = np.array([travel(float(t)) for t in times])
    E = np.zeros((len(times), 6))
    E[:, direction] = height * bent
    S = bending_response(material, E, height)[0][:, direction]
    elastic = S * material.thickness**3 / (12.0 * height)
    losses = bending_losses_of(material)
    if losses is None:
        return elastic
    memory, lost = np.zeros(len(losses.memory)), [0.0]
    for curvature, size in zip(bent[1:], np.diff(times), strict=True):
        both = np.zeros(2)
        both[direction] = curvature
        memory = losses.in_step(both, memory, size)
        lost.append(losses.moments(memory)[direction])
    return elastic + np.array(lost)


def _comparisons(curves: dict[str, np.ndarray], loop: Loop, curvature: float):
    """Yield the moment on the way there and back, and the energy that the last loop takes."""
    bent, time = curves["curvature [1/m]"], curves["time [s]"]
    simulated, law = curves["moment [N]"], curves["analytic moment [N]"]
    for name, piece in (("bent first", 0), ("bent back", len(loop.points) - 3)):
        way = (time > loop.times[piece]) & (time < loop.times[piece + 1])
        rows = np.flatnonzero(way)[np.argsort(bent[way])]
        for place in (0.5 * curvature, 0.9 * curvature):
            values = [float(np.interp(place, bent[rows], m[rows])) for m in (simulated, law)]
            yield Comparison(f"moment {name} at {place:g} 1/m", "N", values[0], values[1], "law")
    rows = np.flatnonzero(time > loop.times[-3])
    area = [float(np.trapezoid(m[rows], bent[rows])) for m in (simulated, law)]
    yield Comparison("energy of the last loop", "N/m", area[0], area[1], "law")


def _last(energy: dict[str, np.ndarray]) -> dict[str, float]:
    return {name: float(values[-1]) for name, values in energy.items()}


def _draw(path: Path, curves: dict[str, np.ndarray], title: str) -> None:
    with two_panels(path, "Pure bending", title) as (left, right):
        for axis, heading, label in (
            (left, "curvature [1/m]", "curvature [1/m]"),
            (right, "time [s]", "time [s]"),
        ):
            x = curves[heading]
            found, law = 1e3 * curves["moment [N]"], 1e3 * curves["analytic moment [N]"]
            axis.plot(x, found, "o", ms=2.5, color=SERIES[0], label="simulated")
            axis.plot(x, law, "-", lw=1.2, color=INK, label="law")
            axis.set_xlabel(label)
            axis.set_ylabel("moment per width [mN]")
            finish_loop(axis)
        left.legend(loc="upper left")
