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
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import brentq

from lcmchain.coupons.analytic import power_law_pressure
from lcmchain.coupons.result import Comparison, CouponResult, finish, two_panels
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
    _require_pressable(material, shear_angle, hold)
    test = _Test(material.build(), shear_angle, hold)
    scene = _scene(test, material, element or Element(), pressure, size, edge_length)
    simulation = Simulation(build_model(scene, _sheared(shear_angle)))
    area = size**2 * math.cos(shear_angle)

    def tell(now: float, end: float) -> None:
        if progress is not None:
            progress(now, end, scene.title)

    t, spread, p = _pressed(test, simulation, area, tell)
    expected = test.law(t / material.thickness)
    if material.relaxes:
        expected = test.relaxing_law(t)
    curves = {
        "thickness [mm]": 1e3 * t,
        "pressure [MPa]": 1e-6 * p,
        "law pressure [MPa]": 1e-6 * expected,
        **({"time [s]": test.times} if material.relaxes else {}),
    }
    comparisons = _with_law(test, p, expected)
    measured_law = MEASURED_COMPACTION.get(getattr(material, "preset", None) or material.name)
    if measured_law is not None and not shear_angle and not material.relaxes:
        solid_height = material.areal_mass / material.fibre_density
        experiment = power_law_pressure(t, *measured_law, solid_height)
        curves["measured pressure, Eq. (24) [MPa]"] = 1e-6 * experiment
        comparisons += _at_pressures(p, experiment, "experiment, Eq. (24)")
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
            "steps": simulation.state.step_count,
            "thickness_spread_max_m": float(spread.max()),
            "kinetic_to_internal_end": energy["kinetic"] / energy["internal"],
            "balance_error_to_internal": energy["balance_error"] / energy["internal"],
        },
    )


def _require_pressable(material: FabricMaterial, shear_angle: float, hold: float) -> None:
    """Refuse what the law as a reference does not know, and a hold without relaxation."""
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


class _Test(NamedTuple):
    """A test: shear, press, hold. shear_angle : [rad]. hold : [s]."""

    fabric: Fabric
    shear_angle: float
    hold: float

    @property
    def start(self) -> float:
        """When the plates begin to close [s]."""
        return SHEARING if self.shear_angle else 0.0

    @property
    def stop(self) -> float:
        """When the plates stand still [s]."""
        return self.start + DURATION

    @property
    def times(self) -> np.ndarray:
        """Times of the samples [s], those of the hold behind the :data:`SAMPLES` of the closing."""
        closing = self.start + np.linspace(0.0, DURATION, SAMPLES + 1)[1:]
        if not self.hold:
            return closing
        held = self.stop + self.hold * np.linspace(0.0, 1.0, HELD_SAMPLES + 1)[1:]
        return np.concatenate([closing, held])

    @property
    def free(self) -> float:
        """Thickness of the sheared fabric before it is pressed [m]."""
        free = self.fabric.thickness
        if couples_shear(self.fabric):
            free *= float(free_stretch(self.fabric, math.sin(self.shear_angle)))
        return free

    def law(self, stretch: ArrayLike) -> np.ndarray:
        """Return the pressure [Pa] on the present area at stretches t/t0."""
        if not self.shear_angle:
            return self.fabric.compaction_pressure(stretch)
        g = math.sin(self.shear_angle)
        return self.fabric.compaction_pressure(stretch, None, g) / math.cos(self.shear_angle)

    def relaxing_law(self, thickness: np.ndarray) -> np.ndarray:
        """Return that of a fabric that relaxes, at the thicknesses [m] of the samples."""
        stretches = np.array([self.free, *thickness]) / self.fabric.thickness
        pressure = relaxing_pressure(
            self.fabric, [self.start, *self.times], stretches, math.sin(self.shear_angle)
        )
        return pressure[1:] / math.cos(self.shear_angle)

    def stroke(self, distance: float) -> dict[str, Any]:
        """Return the motion of the upper plate by a distance [m], as an entry of the scene."""
        if not self.shear_angle and not self.hold:
            return {"type": "stroke", "distance": distance, "profile": "smooth"}
        s = np.linspace(0.0, 1.0, 101)
        at_rest = [0.0] if self.shear_angle else []
        times = [*at_rest, *(self.start + DURATION * s)]
        travel = [*at_rest, *(distance * s**3 * (10.0 - s * (15.0 - 6.0 * s)))]
        if self.hold:
            times, travel = [*times, self.stop + self.hold], [*travel, distance]
        return {"type": "table", "times": tuple(times), "travel": tuple(travel)}


def _scene(
    test: _Test,
    material: FabricMaterial,
    element: Element,
    pressure: float,
    size: float,
    edge_length: float,
) -> Scene:
    """Return the specimen between two plates without friction."""
    thickness, free = material.thickness, test.free
    squeezed = free - _thickness_at(test.law, thickness, pressure, free / thickness)
    distance = squeezed + 2.0 * PENETRATION * thickness
    plates = [
        {"name": "lower", "shape": {"type": "plate", "side": "below"}, "friction": 0.0},
        {
            "name": "upper",
            "shape": {"type": "plate", "side": "above"},
            "position": (0.0, 0.0, free),
            "motion": {"direction": (0, 0, -1), **test.stroke(distance)},
            "friction": 0.0,
        },
    ]
    return Scene(
        title=f"Compaction of {material.name} between plates",
        material=material,
        element=element,
        process={"time": test.stop + test.hold, "frames": SAMPLES + 1},
        blank={"size": (size, size), "edge_length": edge_length, "height": 0.5 * free},
        contact={"penalty": pressure / (PENETRATION * thickness)},
        tools=plates,
    )


def _pressed(
    test: _Test, simulation: Simulation, area: float, tell: Callable[[float, float], None]
) -> np.ndarray:
    """Return mean thickness [m], its spread [m] and pressure [Pa] at the samples, (3, n).

    tell : called with the times [s] of a sample and of the end.
    """
    state = simulation.state
    (body,) = simulation.model.bodies
    rows = []
    for time in test.times:
        simulation.advance_to(float(time))
        # forces are those of the last step, whose positions were these
        position = (state.position - state.last_step * state.velocity).T
        measured = derive_fields(body.mesh, body.material, position)["thickness"]
        rows.append((measured.mean(), np.ptp(measured), state.tool_force[1, 2] / area))
        tell(simulation.time, test.stop + test.hold)
    return np.array(rows).T


def _with_law(test: _Test, p: np.ndarray, expected: np.ndarray) -> list[Comparison]:
    """Return the pressures [Pa] beside those of the law, while the plates close and behind."""
    closing = slice(0, SAMPLES)
    at_shear = " and shear" if test.shear_angle else ""
    comparisons = _at_pressures(
        p[closing], expected[closing], "λ|S33| at the same thickness" + at_shear
    )
    times = test.times
    return comparisons + [
        Comparison(
            f"pressure {1e3 * (times[k] - test.stop):.4g} ms after the stop", "MPa", 1e-6 * p[k],
            1e-6 * expected[k], "the law along the thickness over time",
        )
        for k in range(SAMPLES, len(times))
    ]  # fmt: skip


def _at_pressures(p: np.ndarray, reference: np.ndarray, origin: str) -> list[Comparison]:
    """Return the pressure [Pa] where that of a reference has round values."""
    return [
        Comparison(
            f"pressure at {at:g} MPa", "MPa", 1e-6 * _at(1e6 * at, reference, p),
            1e-6 * _at(1e6 * at, reference, reference), origin,
        )
        for at in COMPARED_AT
        if 1e6 * at <= reference[-1]
    ]  # fmt: skip


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


def _draw(path: Path, curves: dict[str, np.ndarray], title: str) -> None:
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
