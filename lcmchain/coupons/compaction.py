"""Plate-to-plate compaction: a piece of fabric between two parallel plates.

Source: Schäfer, Mitsch, Kärger, section 3.2.2. The pressure on the plates is p = λ|S33|, nominal
and Cauchy alike, because the area does not change; the experimental law is Φ = A p_n^B, Eq. (24).

A piece may be sheared first. Its area is less by cos γ then, and the pressure that of the plates on
this area, λ|S33|/cos γ.

Plates may stand still in the end. The pressure on a fabric whose compaction relaxes falls then; the
reference is its law along the thickness that was measured over time.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import brentq

from lcmchain.coupons.analytic import power_law_pressure
from lcmchain.coupons.plots import finish, two_panels
from lcmchain.coupons.result import Comparison, CouponResult
from lcmchain.coupons.specimen import Progress, require_one_temperature, require_solid_shell
from lcmchain.effects.supports import Support
from lcmchain.errors import InputError
from lcmchain.fields.derived import derive_fields
from lcmchain.materials.fabric import Fabric, FabricMaterial
from lcmchain.materials.features.shear_compaction import free_stretch
from lcmchain.materials.law import couples_shear
from lcmchain.mesh.blank import BlankMesh
from lcmchain.model import build_model
from lcmchain.report.style import INK, SERIES
from lcmchain.scene import Element, Scene
from lcmchain.scene.presets import MEASURED_COMPACTION
from lcmchain.solver.simulation import Simulation

DURATION = 0.04  # of the pressing [s]
SHEARING = 0.02  # duration of the shear before it, and of a rest [s]
SAMPLES = 80
HELD_SAMPLES = 20
# The thickness between two samples is followed in so many steps, for the law of a relaxing fabric.
PATH_STEPS = 10
# Plates are this much stiffer than the automatic contact of a forming tool would be: they may
# sink into the fabric by this part of its thickness under the full pressure.
PENETRATION = 0.01
LARGEST_ANGLE = math.radians(80.0)
COMPARED_AT = (0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 1.4)  # pressures [MPa]


def compaction(
    material: FabricMaterial,
    element: Element | None = None,
    *,
    pressure: float = 1.5e6,
    size: float = 20e-3,
    shear_angle: float = 0.0,
    hold: float = 0.0,
    edge_length: float = 5e-3,
    progress: Progress | None = None,
) -> CouponResult:
    """Simulate a plate-to-plate compaction test.

    Parameters
    ----------
    material : material of a scene; element : its element options.
    pressure : at the end [Pa]; size : of the square specimen [m]; edge_length : of elements [m].
    shear_angle : to which the specimen is sheared before it is pressed [rad].
    hold : time that the plates stand still in the end, while the fabric relaxes [s].

    Raises
    ------
    InputError : the element has no thickness direction, the shear angle is not below 80 degrees, or
        the piece is held although its compaction does not relax.
    """
    require_solid_shell(element)
    require_one_temperature(material)
    if not 0.0 <= shear_angle < LARGEST_ANGLE:
        raise InputError(
            f"is {math.degrees(shear_angle):.4g} deg; a specimen can be pressed at 0 to "
            f"{math.degrees(LARGEST_ANGLE):g} deg",
            key="shear_angle",
        )
    if hold > 0.0 and not material.relaxes:
        raise InputError(
            "lets the fabric relax, but its compaction does not; state "
            "material.viscous.compaction, or leave it out",
            key="--hold",
        )
    thickness = material.thickness
    fabric = material.build()
    area = size**2 * math.cos(shear_angle)

    def law(stretch: ArrayLike) -> np.ndarray:
        if not shear_angle:
            return fabric.compaction_pressure(stretch)
        g = math.sin(shear_angle)
        return fabric.compaction_pressure(stretch, None, g) / math.cos(shear_angle)

    before = SHEARING if shear_angle else 0.0
    free = thickness
    if couples_shear(fabric):
        free *= float(free_stretch(fabric, math.sin(shear_angle)))
    penalty = pressure / (PENETRATION * thickness)
    squeezed = free - _thickness_at(law, thickness, pressure, free / thickness)
    distance = squeezed + 2.0 * PENETRATION * thickness
    end = before + DURATION
    motion: dict[str, Any] = {"type": "stroke", "distance": distance, "profile": "smooth"}
    if before or hold:
        s = np.linspace(0.0, 1.0, 101)
        times = [*([0.0] if before else []), *(before + DURATION * s)]
        travel = [*([0.0] if before else []), *(distance * s**3 * (10.0 - s * (15.0 - 6.0 * s)))]
        if hold:
            times, travel = [*times, end + hold], [*travel, distance]
        motion = {"type": "table", "times": tuple(times), "travel": tuple(travel)}
    plates = [
        {"name": "lower", "shape": {"type": "plate", "side": "below"}, "friction": 0.0},
        {
            "name": "upper",
            "shape": {"type": "plate", "side": "above"},
            "position": (0.0, 0.0, free),
            "motion": {"direction": (0, 0, -1), **motion},
            "friction": 0.0,
        },
    ]
    scene = Scene(
        title=f"Compaction of {material.name} between plates",
        material=material,
        element=element or Element(),
        process={"time": end + hold, "frames": SAMPLES + 1},
        blank={"size": (size, size), "edge_length": edge_length, "height": 0.5 * free},
        contact={"penalty": penalty},
        tools=plates,
    )
    simulation = Simulation(build_model(scene, _sheared(shear_angle)))
    state = simulation.state
    (body,) = simulation.model.bodies
    rows = []
    sampled = before + np.linspace(0.0, DURATION, SAMPLES + 1)[1:]
    if hold:
        sampled = np.concatenate(
            [sampled, end + hold * np.linspace(0.0, 1.0, HELD_SAMPLES + 1)[1:]]
        )
    for time in sampled:
        simulation.advance_to(float(time))
        # forces are those of the last step, whose positions were these
        position = (state.position - state.last_step * state.velocity).T
        measured = derive_fields(body.mesh, body.material, position)["thickness"]
        rows.append((measured.mean(), np.ptp(measured), state.tool_force[1, 2] / area))
        if progress is not None:
            progress(simulation.time, end + hold, scene.title)
    t, spread, p = np.array(rows).T
    expected = law(t / thickness)
    if material.relaxes:
        expected = relaxing_pressure(
            fabric, [before, *sampled], np.array([free, *t]) / thickness, math.sin(shear_angle)
        )[1:] / math.cos(shear_angle)  # fmt: skip
    curves = {
        "thickness [mm]": 1e3 * t,
        "pressure [MPa]": 1e-6 * p,
        "law pressure [MPa]": 1e-6 * expected,
        **({"time [s]": sampled} if material.relaxes else {}),
    }
    pressed = slice(0, SAMPLES)  # then held
    at_shear = " and shear" if shear_angle else ""
    comparisons = [
        Comparison(  # type: ignore[call-arg]
            f"pressure at {at:g} MPa", "MPa", *(1e-6 * _at(1e6 * at, expected[pressed], v[pressed])  # type: ignore[arg-type]
            for v in (p, expected)), "λ|S33| at the same thickness" + at_shear,
        )
        for at in COMPARED_AT
        if 1e6 * at <= expected[pressed][-1]
    ]  # fmt: skip
    comparisons += [
        Comparison(
            f"pressure {1e3 * (sampled[k] - end):.4g} ms after the stop", "MPa", 1e-6 * p[k],
            1e-6 * expected[k], "the law along the thickness over time",
        )
        for k in range(SAMPLES, len(sampled))
    ]  # fmt: skip
    measured_law = MEASURED_COMPACTION.get(getattr(material, "preset", None) or material.name)
    if measured_law is not None and not shear_angle and not material.relaxes:
        solid_height = material.areal_mass / material.fibre_density
        experiment = power_law_pressure(t, *measured_law, solid_height)
        curves["measured pressure, Eq. (24) [MPa]"] = 1e-6 * experiment
        comparisons += [
            Comparison(  # type: ignore[call-arg]
                f"pressure at {at:g} MPa", "MPa", *(1e-6 * _at(1e6 * at, experiment, v)  # type: ignore[arg-type]
                for v in (p, experiment)), "experiment, Eq. (24)",
            )
            for at in COMPARED_AT
            if 1e6 * at <= experiment[-1]
        ]  # fmt: skip
    energy = simulation.energy()
    return CouponResult(
        name="compaction",
        settings={
            "specimen": f"{1e3 * size:g} mm x {1e3 * size:g} mm",
            "elements": f"{simulation.model.element_count} elements of {1e3 * edge_length:g} mm",
            "duration": f"{1e3 * DURATION:g} ms",
            **({"then held": f"{1e3 * hold:g} ms"} if hold else {}),
            **({"shear angle": f"{math.degrees(shear_angle):g} deg"} if shear_angle else {}),
        },
        curves=curves,
        comparisons=tuple(comparisons),
        draw=lambda path: _draw(path, curves, scene.title),
        figures={
            "steps": state.step_count,
            "thickness_spread_max_m": float(spread.max()),
            "kinetic_to_internal_end": energy["kinetic"] / energy["internal"],
            "balance_error_to_internal": energy["balance_error"] / energy["internal"],
        },
    )


def relaxing_pressure(
    fabric: Fabric, times: ArrayLike, stretches: ArrayLike, g: float
) -> np.ndarray:
    """Return the pressure [Pa] on the area at the start along a thickness over time.

    Parameters
    ----------
    fabric : whose compaction relaxes. times : rising [s]; nothing has been pressed at the first.
    stretches : thickness over t0 at these times. g : shear strain sin γ at which it is pressed.
    """
    assert fabric.relaxation is not None
    times, stretches = np.asarray(times, dtype=float), np.asarray(stretches, dtype=float)
    memory = np.zeros(len(fabric.relaxation.memory))
    E, found = np.zeros(6), np.zeros(len(times))
    E[3] = g
    for k in range(1, len(times)):
        size = (times[k] - times[k - 1]) / PATH_STEPS
        for stretch in np.linspace(stretches[k - 1], stretches[k], PATH_STEPS + 1)[1:]:
            E[2] = 0.5 * (stretch**2 - 1.0)
            memory = fabric.relaxed(E, memory, size)
        S = fabric.stress_and_tangent(E)[0] + fabric.relaxing_stress(E, memory)
        found[k] = -stretches[k] * S[2]
    return found


def _sheared(angle: float) -> Callable[[BlankMesh], list[Support]]:
    """Return what shears all nodes in the plane, fibres at their length, and holds them so."""

    def motion(time: float) -> np.ndarray:
        s = min(time / (0.75 * SHEARING), 1.0)
        half = 0.5 * angle * s**3 * (10.0 - s * (15.0 - 6.0 * s))
        c, t = math.cos(half), math.sin(half)
        return np.array([[c, t, 0.0, 0.0], [t, c, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]])

    def supports(mesh: BlankMesh) -> list[Support]:
        if not angle:
            return []
        return [Support("shear", np.arange(mesh.node_count), "xy", motion=motion)]

    return supports


def _thickness_at(law, thickness: float, pressure: float, free: float) -> float:
    """Return the thickness [m] under a pressure [Pa]; ``free`` is the stretch without any."""
    return thickness * brentq(lambda stretch: float(law(stretch)) - pressure, 0.35 * free, free)


def _at(pressure: float, of: np.ndarray, values: np.ndarray) -> float:
    """Return ``values`` where the rising curve ``of`` reaches ``pressure``, log-interpolated."""
    used = (of > 0.0) & (values > 0.0)
    place = np.interp(np.log(pressure), np.log(of[used]), np.log(values[used]))
    return float(np.exp(place))


def _draw(path: Path, curves, title: str) -> None:
    with two_panels(path, "Plate-to-plate compaction", title) as (left, right):
        t = curves["thickness [mm]"]
        for axis in (left, right):
            for name, style in (
                ("pressure [MPa]", {"marker": "o", "ms": 3, "ls": "", "color": SERIES[0]}),
                ("law pressure [MPa]", {"color": INK, "lw": 1.2}),
                ("measured pressure, Eq. (24) [MPa]", {"color": SERIES[1], "lw": 1.2, "ls": "--"}),
            ):
                if name in curves:
                    label = {"p": "simulated", "l": "λ|S33|", "m": "experiment, Φ = A pₙᴮ"}[name[0]]
                    axis.plot(t, curves[name], label=label, **style)
            axis.set_xlabel("thickness [mm]")
            axis.set_ylabel("pressure [MPa]")
            finish(axis)
            axis.set_xlim(t.min() - 0.01, t.max())
        right.set_yscale("log")
        right.set_ylim(1e-3, 2.0)
        left.legend(loc="upper right")
