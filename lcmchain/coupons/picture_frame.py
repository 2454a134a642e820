"""Picture-frame test: a square of fabric is sheared by a hinged frame along its sides.

The reference is homogeneous pure shear (:class:`lcmchain.coupons.analytic.PictureFrame`); the shear
force along a side is L t0 S12 exactly. Nothing presses the fabric: its thickness is that which the
shear-compaction coupling gives without pressure.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import ClassVar

import numpy as np

from lcmchain.coupons.analytic import PictureFrame
from lcmchain.coupons.result import Comparison, CouponResult, finish, finish_loop, two_panels
from lcmchain.coupons.specimen import (
    FRAMES,
    Loop,
    Progress,
    Recording,
    SteadyPull,
    mean_field,
    record,
    require_fabric,
    shear_stress_of,
)
from lcmchain.effects.supports import Support
from lcmchain.errors import InputError
from lcmchain.fields import FrameSeries, build_datasets
from lcmchain.materials.fabric import FabricMaterial
from lcmchain.materials.features.shear_compaction import free_stretch
from lcmchain.materials.features.shear_friction import shear_friction_of
from lcmchain.materials.features.viscous_shear import viscous_of
from lcmchain.materials.law import Material, couples_shear, own_memory
from lcmchain.mesh.blank import BlankMesh
from lcmchain.quantities.units import ANGLE, Dimension
from lcmchain.report.style import INK, SERIES
from lcmchain.scene import Element, Scene
from lcmchain.scene.stack import PlySettings
from lcmchain.solver.simulation import Simulation, Snapshot

# Slow enough that inertia and damping add less than half a percent to the force.
DURATION = 0.5  # [s]
# Part of the pull in which it comes to its speed.
START = 0.2
# Steps in which the law of a fabric that resists rates is followed along the pull.
PATH_STEPS = 4000
MASS_DAMPING = 20.0  # [1/s]
COMPARED_AT = (10.0, 20.0, 30.0, 40.0, 50.0, 60.0)  # shear angles [deg]
# Curve, its unit, and where the reference comes from.
COMPARED = (("thickness", "mm", "t0/cos^β"), ("edge shear force", "N", "L t0 S12"))


@dataclass(frozen=True)
class PictureFrameTest:
    """The test as the forming solver runs it, of whatever square.

    Parameters
    ----------
    shear_angle : of the frame at the end [rad].
    hold : time at the end of the process that the frame stands still [s].
    cycles : how often the frame goes there and back; 0 only there.
    """

    shear_angle: float = math.radians(64.0)
    hold: float = 0.0
    cycles: int = 0

    name: ClassVar[str] = "picture-frame"
    driven_by: ClassVar[tuple[str, Dimension]] = ("shear_angle", ANGLE)

    @property
    def text(self) -> str:
        """The scene of a square of 200 mm, as TOML."""
        return f"""
title = "Picture frame, {math.degrees(self.shear_angle):.3g}°"
process = {{ time = "{DURATION} s", mass_damping = "{MASS_DAMPING} 1/s" }}
blank = {{ size = ["200 mm", "200 mm"], edge_length = "10 mm" }}
material = {{ preset = "MD600" }}
"""

    def pull(self, scene: Scene) -> SteadyPull | Loop:
        """Return the travel along the diagonal over the process of a scene."""
        distance = float(_net(scene).displacement(self.shear_angle))
        if self.cycles:
            ends = [0.0, *[distance, 0.0] * self.cycles]
            return Loop(ends, scene.process.time / (2 * self.cycles))
        duration = scene.process.time - self.hold
        return SteadyPull(distance, duration, START * duration)

    def supports(self, scene: Scene) -> Callable[[BlankMesh], list[Support]]:
        """Return what holds the square: its sides, which turn about its corners."""
        net, pull, half_side = _net(scene), self.pull(scene), 0.5 * _square(scene).blank.extent[0]

        def hinged(time: float) -> np.ndarray:
            half = 0.5 * float(net.shear_angle(pull.travel(min(time, pull.duration))))
            c, s = math.cos(half), math.sin(half)
            return np.array([[c, s, 0.0, 0.0], [s, c, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]])

        def frame(blank: BlankMesh) -> list[Support]:
            on_side = (np.abs(blank.node_positions[:, :2]) > half_side - 1e-9).any(axis=1)
            return [Support("frame", np.flatnonzero(on_side), "xy", motion=hinged)]

        return frame

    def force(self, scene: Scene, recording: Recording) -> np.ndarray:
        """Return the force along the diagonal [N], means over every other frame's interval.

        The frame has no net force: its force on the machine is work per travel. Where it stands
        still there is none.
        """
        pull = self.pull(scene)
        travel = np.array([pull.travel(min(t, pull.duration)) for t in recording.time[::2]])
        way = np.diff(travel)
        return np.diff(recording.work[::2]) / np.where(way != 0.0, way, math.nan)


def _net(scene: Scene) -> PictureFrame:
    return PictureFrame(_square(scene).blank.extent[0], _square(scene).thickness)


def _square(scene: Scene) -> PlySettings:
    return scene.only_ply("a coupon")


def picture_frame(
    material: FabricMaterial,
    element: Element | None = None,
    *,
    side: float = 0.2,
    shear_angle: float = math.radians(64.0),
    edge_length: float = 10e-3,
    speed: float | None = None,
    hold: float = 0.0,
    cycles: int = 0,
    progress: Progress | None = None,
) -> CouponResult:
    """Simulate a picture-frame test.

    Of a fabric that resists the rate of its shear (``material.viscous``) or rubs
    (``material.membrane.friction``) the reference is its law along the angle of the frame over
    time.

    Parameters
    ----------
    material : material of a scene; element : its element options.
    side : of the frame, which the fabric fills [m]; shear_angle : at the end [rad].
    edge_length : of the elements [m].
    speed : of the machine [m/s], by default one that takes half a second.
    hold : time that the frame stands still in the end, while the fabric relaxes [s].
    cycles : how often the frame goes there and back; 0 only there.

    Raises
    ------
    InputError : the material is no fabric, or is held although nothing in it relaxes or it goes
        back.
    """
    _require_shearable(material, speed, hold, cycles)
    net = PictureFrame(side, material.thickness)
    test = PictureFrameTest(shear_angle, hold, cycles)
    duration = DURATION * max(2 * cycles, 1)
    if speed is not None:
        duration = float(net.displacement(shear_angle)) / (speed * (1.0 - 0.5 * START))
    scene = Scene(
        title=f"Picture frame of {material.name}, {math.degrees(shear_angle):.3g}°",
        material=material,
        element=element or Element(),
        process={
            "time": duration + hold,
            "frames": (FRAMES - 1) * max(2 * cycles, 1) + 1,
            "mass_damping": MASS_DAMPING,
        },
        blank={"size": (side, side), "edge_length": edge_length},
    )
    simulation, recording = record(scene, test.supports(scene), progress=progress)
    (body,) = simulation.model.bodies
    pull, force = test.pull(scene), test.force(scene, recording)
    curves = _curves(simulation, recording, net, pull, force)
    if material.resists_rates or cycles:
        curves["time [s]"] = recording.time[1::2]
    frames = FrameSeries.from_snapshots(recording.snapshots[::4], ())
    energy = recording.energy
    return CouponResult(
        name="picture-frame",
        settings={
            "specimen": f"{1e3 * side:g} mm x {1e3 * side:g} mm",
            "elements": f"{simulation.model.element_count} elements of {1e3 * edge_length:g} mm",
            "duration": f"{1e3 * duration:g} ms",
            **({"then held": f"{1e3 * hold:g} ms"} if hold > 0.0 else {}),
        },
        curves=curves,
        comparisons=_comparisons(
            curves, np.isnan(force), recording.time[1::2], duration, cycles, body.material
        ),
        draw=lambda path: _draw(path, curves, scene.title),
        datasets=build_datasets(scene, body.mesh, frames, material=body.material),
        shown="shear_angle",
        figures={
            "steps": simulation.state.step_count,
            "kinetic_to_internal_end": energy["kinetic"][-1] / energy["internal"][-1],
            "damping_to_external": energy["damping"][-1] / energy["external"][-1],
        },
    )


def _comparisons(
    curves: dict[str, np.ndarray],
    still: np.ndarray,
    time: np.ndarray,
    duration: float,
    cycles: int,
    material: Material,
) -> tuple[Comparison, ...]:
    """Compare the way there, the hold and the ways back with the law.

    still : (T,) whether the frame stands, at times [s]. duration : of all ways [s].
    """
    # the way there, in cycles that of the first one
    there = ~still & (time < (duration / (2 * cycles) if cycles else math.inf))
    return (
        *_of_way_there(curves, there, couples_shear(material)),
        *_of_hold(curves, np.flatnonzero(still), time - duration),
        *_of_way_back(curves, cycles),
    )


def _require_shearable(
    material: FabricMaterial, speed: float | None, hold: float, cycles: int
) -> None:
    """Refuse what is no fabric, a hold in which nothing relaxes, and cycles that are held."""
    require_fabric(material, knows_losses=True)
    if hold > 0.0 and not material.resists_rates:
        raise InputError(
            "lets the fabric relax, but its shear does not depend on its rate; state "
            "material.viscous, or leave it out",
            key="--hold",
        )
    if cycles and (hold > 0.0 or speed is not None):
        raise InputError(
            "go there and back in a second each; leave out --hold and --speed", key="--cycles"
        )


def _curves(
    simulation: Simulation,
    recording: Recording,
    net: PictureFrame,
    pull: SteadyPull | Loop,
    force: np.ndarray,
) -> dict[str, np.ndarray]:
    """Return what was simulated over the travel, and what pure shear makes of it.

    force : along the diagonal [N]; where the frame stands still, nan, it is that of the stress in
        the fabric.
    """
    (body,) = simulation.model.bodies
    material = body.material
    d = np.array([pull.travel(min(t, pull.duration)) for t in recording.time])
    gamma = net.shear_angle(d[1::2])
    edge_force = 0.5 * force / np.cos(0.25 * np.pi - 0.5 * gamma)
    for k in np.flatnonzero(np.isnan(force)):
        stress = _shear_stress(simulation, recording.snapshots[2 * k + 1])
        edge_force[k] = net.side * net.thickness * stress
        force[k] = 2.0 * edge_force[k] * math.cos(0.25 * np.pi - 0.5 * gamma[k])
    everywhere = np.ones(simulation.model.element_count, dtype=bool)
    measured, thickness = (
        mean_field(simulation, recording.snapshots[1::2], field, everywhere)
        for field in ("shear_angle", "thickness")
    )
    free = net.thickness * free_stretch(material, np.sin(gamma))
    shear_stress = shear_stress_of(material)
    if viscous_of(material) is not None or shear_friction_of(material) is not None:
        at_rest, path = shear_stress, partial(_angle_at, net, pull)
        of_way = _stress_of_way(material, recording.time[1::2], path)
        shear_stress = lambda angle: at_rest(angle) + of_way  # noqa: E731
    return {
        "displacement [mm]": 1e3 * d[1::2],
        "force [N]": force,
        "shear angle [deg]": np.degrees(measured),
        "edge shear force [N]": edge_force,
        "thickness [mm]": 1e3 * thickness,
        "analytic force [N]": net.force(gamma, shear_stress),
        "analytic shear angle [deg]": np.degrees(gamma),
        "analytic edge shear force [N]": net.edge_shear_force(gamma, shear_stress),
        "analytic thickness [mm]": 1e3 * free,
    }


def _of_way_there(
    curves: dict[str, np.ndarray], there: np.ndarray, couples: bool
) -> Iterator[Comparison]:
    """Yield force and, of a fabric that couples it with the shear, thickness at round angles.

    there : rows of the way there.
    """
    angles = curves["analytic shear angle [deg]"][there]
    for name, unit, origin in COMPARED[0 if couples else 1 :]:
        simulated, law = (curves[f"{of}{name} [{unit}]"][there] for of in ("", "analytic "))
        for angle in COMPARED_AT:
            if angle <= angles[-1]:
                yield Comparison(
                    f"{name} at {angle:g}°", unit, float(np.interp(angle, angles, simulated)),
                    float(np.interp(angle, angles, law)), origin,
                )  # fmt: skip


def _of_hold(
    curves: dict[str, np.ndarray], rows: np.ndarray, since: np.ndarray
) -> Iterator[Comparison]:
    """Yield the force where the frame stands still. since : time of every row after the stop."""
    for k in rows:
        yield Comparison(
            f"edge shear force {1e3 * since[k]:.4g} ms after the stop", "N",
            float(curves["edge shear force [N]"][k]),
            float(curves["analytic edge shear force [N]"][k]), "L t0 S12",
        )  # fmt: skip


def _angle_at(net: PictureFrame, pull: SteadyPull | Loop, time: float) -> float:
    """Return the shear angle of the frame [rad] at a time [s]."""
    return float(net.shear_angle(pull.travel(min(time, pull.duration))))


def _stress_of_way(
    material: Material, times: np.ndarray, angle: Callable[[float], float]
) -> np.ndarray:
    """Return what rate and friction add to S12 [Pa] at times [s], along the angle of the frame."""
    steps = np.linspace(0.0, times[-1], PATH_STEPS + 1)[1:]
    strains = np.sin([angle(float(time)) for time in steps])
    viscous, friction = viscous_of(material), shear_friction_of(material)
    added = np.zeros(times.size)
    if viscous is not None:
        memory, stress = np.zeros(len(viscous.memory)), []
        for g in strains:
            memory = viscous.in_step(g, memory, float(steps[0]))
            stress.append(memory[1])
        # the dashpot is that of the middle of a step
        added += np.interp(times, steps - 0.5 * steps[0], stress)
    if friction is not None:
        elastic = shear_stress_of(material)(np.arcsin(strains))
        memory, stress = np.zeros(len(friction.memory)), []
        for g, elastic_stress in zip(strains, elastic, strict=True):
            before, memory = memory[0], friction.in_step(g, memory, elastic_stress)
            stress.append(friction.stress_of(before, g, memory[1]))
        added += np.interp(times, steps, stress)
    return added


def _of_way_back(curves: dict[str, np.ndarray], cycles: int) -> Iterator[Comparison]:
    """Yield the force on the last way back, and the energy that the last cycle takes."""
    if not cycles:
        return
    half = len(curves["force [N]"]) // (2 * cycles)
    back, cycle = slice(-half, None), slice(-2 * half, None)
    angles = curves["analytic shear angle [deg]"][back][::-1]
    name = "edge shear force [N]"
    for angle in COMPARED_AT:
        if angle <= angles[-1]:
            simulated, law = (
                float(np.interp(angle, angles, curves[curve][back][::-1]))
                for curve in (name, f"analytic {name}")
            )
            yield Comparison(
                f"edge shear force back at {angle:g}°", "N", simulated, law, "L t0 S12"
            )
    travel = 1e-3 * curves["displacement [mm]"][cycle]
    simulated, law = (
        float(np.trapezoid(curves[curve][cycle], travel))
        for curve in ("force [N]", "analytic force [N]")
    )
    yield Comparison("energy of the last cycle", "J", simulated, law, "law along the angle")


def _shear_stress(simulation: Simulation, snapshot: Snapshot) -> float:
    """Return the mean S12 [Pa] of a sheet whose law resists rates, and that nothing presses."""
    (body,) = simulation.model.bodies
    past = body.element_history(simulation.model.history_of(body, snapshot.history))
    strain = np.zeros((past.shape[1], 6))
    viscous = viscous_of(body.material)
    assert viscous is not None
    shear, of_rate = own_memory(body.material.law, viscous.memory, past)[:2]
    friction = shear_friction_of(body.material)
    if friction is not None:
        _, moment, _ = own_memory(body.material.law, friction.memory, past)
        of_rate = of_rate + friction.stress_of(shear, shear, moment)
    strain[:, 3] = shear
    strain[:, 2] = 0.5 * (free_stretch(body.material, shear) ** 2 - 1.0)
    return float((body.material.stress_and_tangent(strain)[0][:, 3] + of_rate).mean())


def _draw(path: Path, curves: dict[str, np.ndarray], title: str) -> None:
    with two_panels(path, "Picture-frame test", title) as (left, right):
        gamma = curves["analytic shear angle [deg]"]
        for axis, name, label in (
            (left, "force [N]", "force along the diagonal [N]"),
            (right, "edge shear force [N]", "shear force along a side [N]"),
        ):
            axis.plot(gamma, curves[name], "o", ms=3.5, color=SERIES[0], label="simulated")
            axis.plot(gamma, curves[f"analytic {name}"], "-", lw=1.2, color=INK, label="analytic")
            axis.set_xlabel("shear angle of the frame [deg]")
            axis.set_ylabel(label)
            # friction takes a force to bring the fabric back
            (finish_loop if np.nanmin(curves[name]) < 0.0 else finish)(axis)
        left.legend(loc="upper left")
