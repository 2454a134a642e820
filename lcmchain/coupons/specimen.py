"""Specimens of coupon tests as simulations of the forming solver, and their recording."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import ClassVar, NamedTuple

import numpy as np

from lcmchain.compilation.threads import use_threads
from lcmchain.effects.supports import Support
from lcmchain.errors import InputError
from lcmchain.fields.derived import derive_fields
from lcmchain.materials.features.shear_compaction import free_shear_stress
from lcmchain.materials.law import Material
from lcmchain.materials.laws import AnyMaterial
from lcmchain.mesh.blank import BlankMesh
from lcmchain.model import build_model
from lcmchain.quantities.units import LENGTH, Dimension
from lcmchain.scene import Element, Scene
from lcmchain.solver.simulation import Simulation, Snapshot

#: Frames that the shear tests keep: forces are means between every other one of them, so that each
#: has a frame in its middle.
FRAMES = 49

#: Called with (completed, total, text).
Progress = Callable[[float, float, str], None]


class SteadyPull(NamedTuple):
    """Travel of a testing machine: a smooth start over ``start`` [s], then a constant speed."""

    distance: float  # [m]
    duration: float  # [s]
    start: float  # [s]

    @property
    def speed(self) -> float:
        return self.distance / (self.duration - 0.5 * self.start)

    def travel(self, time: float) -> float:
        """Return the travel [m]; velocity and acceleration vanish at time 0."""
        if time >= self.start:
            return self.speed * (time - 0.5 * self.start)
        s = time / self.start
        return self.speed * self.start * s**4 * (2.5 + s * (s - 3.0))


class Loop(NamedTuple):
    """Way of a testing machine between turning points, at rest in each, by half waves of a cosine.

    points : in their order, the first one at time 0. quarter : time [s] for as far as the second
    one lies from the first.
    """

    points: Sequence[float]
    quarter: float

    @property
    def times(self) -> np.ndarray:
        """Times of the turning points [s]."""
        way = np.abs(np.diff(self.points))
        return np.concatenate([[0.0], np.cumsum(way / way[0])]) * self.quarter

    @property
    def duration(self) -> float:
        return float(self.times[-1])

    def travel(self, time: float) -> float:
        """Return where the machine is at a time [s]."""
        times = self.times
        k = int(np.clip(np.searchsorted(times, time, side="right") - 1, 0, len(times) - 2))
        s = min((time - times[k]) / (times[k + 1] - times[k]), 1.0)
        return self.points[k] + (self.points[k + 1] - self.points[k]) * 0.5 * (
            1.0 - float(np.cos(np.pi * s))
        )


class Recording(NamedTuple):
    """Snapshots of a coupon test at equidistant times, and what the supports have done by then.

    impulse : (T, support_count, 3) [N s]; work : (T,) external work [J].
    seconds : solver time, without compilation [s].
    """

    snapshots: list[Snapshot]
    impulse: np.ndarray
    work: np.ndarray
    seconds: float

    @property
    def time(self) -> np.ndarray:
        return np.array([snapshot.time for snapshot in self.snapshots])

    @property
    def energy(self) -> dict[str, np.ndarray]:
        names = self.snapshots[0].energy
        return {name: np.array([s.energy[name] for s in self.snapshots]) for name in names}


def require_fabric(material: AnyMaterial, *, knows_losses: bool = False) -> None:
    """Refuse materials of which the analytic solution of a coupon knows nothing.

    knows_losses : whether it knows stresses that depend on a rate, and shear that rubs.

    Raises
    ------
    InputError : the material is no fabric, one that loses energy, or one of several temperatures.
    """
    require_one_temperature(material)
    if not knows_losses:
        require_no_friction(material)
    if material.resists_rates and not knows_losses:
        raise InputError(
            "makes a stress depend on its rate, of which the analytic solution of this coupon "
            "knows nothing; use lcmchain coupon picture-frame, or leave the table out",
            key="material.viscous",
        )
    if material.law != "fabric":
        raise InputError(
            f'is "{material.law}"; this coupon is compared with the analytic solution of a '
            'textile and needs law = "fabric" (or a preset)',
            key="material.law",
        )


def require_no_friction(material: AnyMaterial) -> None:
    """Refuse friction in shear, of which the analytic solution of a coupon knows nothing.

    Raises
    ------
    InputError : the material states it.
    """
    if material.shear_rubs:
        raise InputError(
            "makes the shear depend on its past, of which the analytic solution of this coupon "
            "knows nothing; use lcmchain coupon picture-frame --cycles, or leave it out",
            key="material.membrane.friction",
        )


def require_one_temperature(material: AnyMaterial) -> None:
    """Refuse a temperature that differs over the blank, of which no reference knows.

    Raises
    ------
    InputError : the material has one.
    """
    if material.temperature_varies:
        raise InputError(
            "differs over the blank, and a coupon has one temperature; give "
            "material.viscous.temperature instead",
            key="material.viscous.temperature_field",
        )


def require_solid_shell(element: Element | None) -> None:
    """Refuse elements without a thickness direction, which only the explicit solver knows.

    Raises
    ------
    InputError : the element is no solid-shell.
    """
    if element is not None and element.type != "solid-shell":
        raise InputError(
            f'is "{element.type}", but this coupon needs element = "solid-shell"', key="element"
        )


def record(
    scene: Scene,
    supports: Callable[[BlankMesh], Sequence[Support]],
    *,
    threads: int | None = None,
    progress: Progress | None = None,
) -> tuple[Simulation, Recording]:
    """Simulate a coupon and keep ``process.frames`` snapshots of it.

    Parameters
    ----------
    threads : of the compiled loops, by default as many as the specimen is large enough for.
    """
    simulation = Simulation(build_model(scene, supports))
    use_threads(threads, simulation.model.element_count)
    simulation.compile()
    start = time.perf_counter()
    snapshots, impulse, work = [simulation.snapshot()], [], [0.0]
    impulse.append(simulation.state.support_impulse.copy())
    for until in np.linspace(0.0, scene.process.time, scene.process.frames)[1:]:
        simulation.advance_to(float(until))
        snapshots.append(simulation.snapshot())
        impulse.append(simulation.state.support_impulse.copy())
        work.append(snapshots[-1].energy["external"])
        if progress is not None:
            progress(simulation.time, scene.process.time, scene.title)
    seconds = time.perf_counter() - start
    return simulation, Recording(snapshots, np.array(impulse), np.array(work), seconds)


@dataclass(frozen=True)
class PulledStrip:
    """A test in which clamps at both ends of a strip are pulled from each other.

    Parameters
    ----------
    displacement : of the clamps from each other at the end [m].
    """

    displacement: float

    driven_by: ClassVar[tuple[str, Dimension]] = ("displacement", LENGTH)

    def pull(self, scene: Scene) -> SteadyPull:
        """Return the travel of the clamps from each other over the process of a scene.

        A fifth of the process is its smooth start.
        """
        return SteadyPull(self.displacement, scene.process.time, 0.2 * scene.process.time)

    def force(self, scene: Scene, recording: Recording) -> np.ndarray:
        """Return the force of the clamps along x [N], means over every other frame's interval."""
        time, impulse = recording.time[::2], recording.impulse[::2, :, 0]
        return np.diff(0.5 * (impulse[:, 1] - impulse[:, 0])) / np.diff(time)


def clamped_ends(
    blank: BlankMesh,
    length: float,
    motion_of: Callable[[float], Callable[[float], np.ndarray]],
    held: str = "xyz",
) -> list[Support]:
    """Return the clamps of both ends of a strip along x, the left one first.

    length : of the strip [m]. motion_of : motion of the clamp on side -1 or 1. held : directions.
    """
    x = blank.node_positions[:, 0]
    return [
        Support(
            name, np.flatnonzero(side * x > 0.5 * length - 1e-9), held, motion=motion_of(side)
        )
        for name, side in (("left clamp", -1.0), ("right clamp", 1.0))
    ]  # fmt: skip


def mean_field(
    simulation: Simulation, snapshots: Sequence[Snapshot], name: str, mask: np.ndarray
) -> np.ndarray:
    """Return the mean of the size of a face field over the elements in ``mask``, (T,)."""
    (body,) = simulation.model.bodies
    return np.array(
        [
            np.abs(derive_fields(body.mesh, body.material, s.position)[name][mask]).mean()
            for s in snapshots
        ]
    )


def effort_of(simulation: Simulation, recording: Recording) -> dict[str, float]:
    """Return steps, and what inertia, damping and the balance have of the energies at the end."""
    energy = recording.energy
    return {
        "steps": simulation.state.step_count,
        "kinetic_to_internal_end": energy["kinetic"][-1] / energy["internal"][-1],
        "damping_to_external": energy["damping"][-1] / energy["external"][-1],
        "balance_error_to_internal": energy["balance_error"][-1] / energy["internal"][-1],
    }


def element_centres(blank: BlankMesh) -> np.ndarray:
    """Return the centres of the elements in the reference, (element_count, 3) [m]."""
    return blank.node_positions[blank.elements].mean(axis=1)


def shear_stress_of(material: Material) -> Callable[[np.ndarray], np.ndarray]:
    """Return S12(γ) [Pa] of pure shear for a material law, of a sheet that nothing presses."""
    return partial(free_shear_stress, material)
