"""Expected cost of a run, from the undeformed sheets and the motion of the tools.

The number of steps is the integral of 1/Δt over the process, Δt = s 2/ω. The parts of ω² are known
in the reference: the fibre wave across the cells, with the cut ones
(``Body.reference_frequencies``), the bending of the fibres within the plane, and the stiffness of
the contacts. ``Simulation`` adds them up in the same way. Plies that touch add their springs. An
interface that resists sliding by its speed, such as a viscous film, has a rate of damping c. It
shortens the step even where nothing is stiff: Δt = 2 s / (√(ω² + c²/4) + c/2).

Two things change the step on the way. Compaction between parallel plates follows from their motion.
How far a sheet shears is not known beforehand. It matters where the bound of ω² adds up both
families of fibres, as the triangles and the cut elements do: with the sheared fibres at cos θ = sin
γ to each other it grows by 1 + sin γ. The few nodes with the highest ω² of the reference, at
corners of the outline, are taken not to shear.

A small file in the user's cache folder keeps the time per element and step on this machine, by
processor, threads, kind of element and size of the mesh. The fastest of the last runs counts. Runs
of many steps add their time at the end.
"""

from __future__ import annotations

import hashlib
import json
import math
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
from platformdirs import user_cache_path

from lcmchain.atomic import replacing
from lcmchain.compilation.cache import processor
from lcmchain.compilation.threads import worthwhile_threads
from lcmchain.errors import InputError, OutputError
from lcmchain.interfaces.laws.viscous_film import ViscousFilm
from lcmchain.materials.law import Material
from lcmchain.model import Model
from lcmchain.solver.simulation import VISCOUS_FABRIC
from lcmchain.tools.distance import PLANE
from lcmchain.tools.motion import GUIDED, prescribed_travel
from lcmchain.tools.table import turning

# --- computing time per element and step on this machine ------------------------------------------


#: Time per element and step that is assumed without a measurement, on one core.
ASSUMED = {"solid-shell": 0.09e-6, "partly curved solid-shell": 0.10e-6,
           "curved solid-shell": 0.14e-6, "membrane-shell": 0.05e-6,
           "membrane": 0.03e-6}  # fmt: skip
#: The same per node of plies that touch each other, of which about half do.
ASSUMED_BETWEEN_PLIES = 0.09e-6
# Part of a step that further threads share: two of them make it 1.6 times faster.
SHARED = 0.76
# Runs of fewer steps than this say little.
FEWEST_STEPS = 2000
# Last runs of which the fastest counts: other work on the machine only ever adds to the time.
KEPT = 5
FILE = "speed.json"


class Speed(NamedTuple):
    """Computing time per element and step [s], and where it is known from, in words."""

    seconds_per_element_step: float
    source: str


def machine_speed(model: Model) -> Speed:
    """Return the time that the last runs of such a model took here, else what is assumed."""
    threads = worthwhile_threads(model.element_count)
    measured = kept_numbers(FILE).get(speed_key(model, threads))
    if measured:
        threads_used = f"{threads} thread{'s' if threads > 1 else ''}"
        return Speed(min(measured), f"as the fastest of the last runs here with {threads_used}")
    per_step = sum(body.mesh.element_count * ASSUMED[body.kernel] for body in model.bodies)
    if model.ply_contact is not None:
        per_step += model.node_count * ASSUMED_BETWEEN_PLIES
    per_step *= 1.0 - SHARED + SHARED / threads
    source = "assumed" if model.pore is None else "assumed, without the flow of the resin"
    return Speed(per_step / model.element_count, source)


def record_speed(model: Model, threads: int, step_count: int, wall_s: float) -> None:
    """Keep the time of a run for later estimates."""
    if step_count < FEWEST_STEPS:
        return
    time = wall_s / (step_count * model.element_count)
    keep_numbers(FILE, kept_numbers(FILE), speed_key(model, threads), time)


def keep_numbers(file: str, kept: dict[str, list[float]], key: str, value: float) -> None:
    """Add a value to the last ones under a key, and write all that is kept to a file."""
    kept[key] = [*kept.get(key, []), value][-KEPT:]
    try:
        with replacing(_path(file)) as temporary:
            temporary.write_text(json.dumps(kept, indent=1), encoding="utf-8")
    except (InputError, OutputError):
        pass  # a cache folder that cannot be written leaves the estimate as it is


def _path(file: str) -> Path:
    return user_cache_path("lcmchain", appauthor=False, opinion=False) / file


def speed_key(model: Model, threads: int) -> str:
    """Name of a machine, threads, kernels and size; sizes within a factor of two are one."""
    machine = hashlib.blake2b(processor().encode(), digest_size=6).hexdigest()
    kernels = ", ".join(sorted({body.kernel for body in model.bodies}))
    if model.ply_contact is not None:
        kernels += " in contact"
    if model.pore is not None:
        kernels += " with resin"  # whose flow is computed in every window, and windows again
    size = 4 ** round(math.log(model.element_count, 4))
    return f"{machine}, {threads} threads, {kernels}, about {size} elements"


def kept_numbers(file: str) -> dict[str, list[float]]:
    """Return all that a file keeps; nothing where it is absent or not ours to read."""
    try:
        kept = json.loads(_path(file).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    if not isinstance(kept, dict):
        return {}
    return {key: values for key, values in kept.items() if _are_times(values)}


def _are_times(values: object) -> bool:
    return isinstance(values, list) and all(
        isinstance(value, float) and 0.0 < value < 1.0 for value in values
    )


# --- steps, time and memory of a run --------------------------------------------------------------


# Times of the process at which the step is estimated.
TIMES = 101
# What limits the step, as a run names it.
CAUSES = ("in-plane stiffness", "compaction (thickness)")
CONTACT_OF_PLIES = "contact between plies"
# Shear angle that the sheet is taken to reach steadily over the process, and the most of the range.
EXPECTED_SHEAR = math.radians(45.0)
LARGEST_SHEAR = math.radians(60.0)


@dataclass(frozen=True)
class Estimate:
    """Expected cost of a run.

    Parameters
    ----------
    critical_step : stable time step of the undeformed blank in contact [s].
    step_count : steps of the whole process, with the scene's safety factor.
    range : the same without shear, and with the most.
    speed : computing time per element and step, and where it is known from.
    seconds : expected computing time [s], without compilation.
    controlled_by : what limits the step at the start, in words.
    """

    critical_step: float
    step_count: int
    range: tuple[int, int]
    speed: Speed
    seconds: float
    controlled_by: str


def estimate_run(model: Model, refinement: float = 1.0) -> Estimate:
    """Estimate time step, step count and computing time.

    refinement : how many times shorter the edges of the run are than those of the model: waves in
        the plane, and the contact stiffness that the program chooses, are that much faster.
    """
    contact = contact_omega2(model)
    if model.automatic_penalty:
        contact *= refinement**2
    plies = contact_between_plies(model, refinement)
    start = omega2_over_time(model, 0.0, refinement)[:, 0]
    causes = dict(zip(CAUSES, start, strict=True)) | {"contact stiffness": contact}
    if plies.omega2 > 0.0:
        causes[plies.cause] = plies.omega2
    shears = (EXPECTED_SHEAR, 0.0, LARGEST_SHEAR)
    counts = [_step_count(model, contact, plies, shear, refinement) for shear in shears]
    speed = machine_speed(model)
    element_count = model.element_count * refinement**2
    total = float(start.max()) + contact + plies.omega2
    fabric = damping_of_fabric(model, refinement)
    critical_step = float(1.0 / _steps_per_second(total, plies.rate + fabric))
    controlled_by = max(causes, key=causes.__getitem__)
    if critical_step < 1.0 / math.sqrt(total):  # what resists a speed makes more of it
        by_plies = plies.rate > fabric
        controlled_by = f"damping by {plies.damped_by if by_plies else VISCOUS_FABRIC}"
    return Estimate(
        critical_step=critical_step,
        step_count=counts[0],
        range=(counts[1], counts[2]),
        speed=speed,
        seconds=counts[0] * element_count * speed.seconds_per_element_step,
        controlled_by=controlled_by,
    )


def _step_count(
    model: Model, contact: float, plies: PliesBound, shear_angle: float, refinement: float
) -> int:
    omega2 = omega2_over_time(model, shear_angle, refinement).max(axis=0) + contact + plies.omega2
    rate = plies.rate + damping_of_fabric(model, refinement)
    mean = np.trapezoid(_steps_per_second(omega2, rate), dx=1.0 / (TIMES - 1))
    return math.ceil(model.process_time / model.step_safety * mean)


def _steps_per_second(omega2: np.ndarray | float, rate: float) -> np.ndarray | float:
    """Return 1/Δt of the stable step for ω² [1/s²] and a rate of damping [1/s].

    As ``Simulation`` bounds it: ω²Δt²/4 + rate Δt/2 <= 1, for a damping that lags half a step.
    """
    return 0.5 * (np.sqrt(0.25 * rate**2 + omega2) + 0.5 * rate)


class PliesBound(NamedTuple):
    """What contact between plies asks of the step.

    omega2 : of plies of equal meshes in full contact [1/s²]. rate : of damping, c/m [1/s].
    cause, damped_by : of a step that either limits, in words.
    """

    omega2: float
    rate: float
    cause: str
    damped_by: str


def contact_between_plies(model: Model, refinement: float = 1.0) -> PliesBound:
    """Return what contact between plies asks of the step, as the solver bounds it.

    refinement : as for :func:`estimate_run`. A film resists by its area, and its mass goes with
        that: finer elements are damped by the same rate.
    """
    if model.ply_contact is None:
        return PliesBound(0.0, 0.0, "", "")
    data = model.ply_contact.data
    finer = refinement if model.automatic_penalty else 1.0
    omega2 = data.omega2 * finer**2
    of_springs = data.damping_time / finer * omega2
    films = [law.title() for law in model.ply_contact.laws if isinstance(law, ViscousFilm)]
    damped_by = CONTACT_OF_PLIES
    if data.sliding_rate > of_springs:
        damped_by = " and ".join(films) or "a law between plies that resists the speed of sliding"
    return PliesBound(omega2, of_springs + data.sliding_rate, CONTACT_OF_PLIES, damped_by)


def damping_of_fabric(model: Model, refinement: float = 1.0) -> float:
    """Return the rate of damping, c/m [1/s], by what resists the rate of the shear, unsheared.

    refinement : as for :func:`estimate_run`.
    """
    rates = [body.reference_frequencies().damping_rate for body in model.bodies]
    return max(rates) * refinement**2


def omega2_over_time(model: Model, shear_angle: float, refinement: float = 1.0) -> np.ndarray:
    """Return ω² (2, TIMES) of the waves in the plane and over the thickness [1/s²].

    The sheets are taken to shear by up to ``shear_angle`` [rad], in proportion to the square of the
    tools' travel: a net of fibres on a surface of the Gaussian curvature K shears by K times the
    area between two of them (Gauss and Bonnet). Where supports pull it shears with their travel.

    refinement : how many times shorter the edges are than those of the model.
    """
    times = np.linspace(0.0, model.process_time, TIMES)
    travel = np.array([_travel(model, time) for time in times])
    if not model.tool_names and model.supports is None:
        shear_angle = 0.0  # nothing forms the sheets
    sheared = 1.0 + np.sin(shear_angle * _shear_progress(model, travel, times))
    gap = plate_distance(model, travel)
    omega2 = np.zeros((2, TIMES))
    for body in model.bodies:
        reference = body.reference_frequencies()
        in_plane = np.maximum(reference.in_plane, reference.at_nodes * sheared)
        omega2[0] = np.maximum(omega2[0], in_plane + model.fibre_bending_omega2)
        if reference.over_thickness > 0.0:
            stiffening = _compaction_stiffening(body.material, gap / body.material.thickness)
            omega2[1] = np.maximum(omega2[1], reference.over_thickness * stiffening)
    omega2[0] *= refinement**2
    return omega2


def _compaction_stiffening(material: Material, stretch: np.ndarray) -> np.ndarray:
    """Return the stiffness over the thickness at a stretch (TIMES,), relative to the reference."""
    stretch = np.minimum(stretch, 1.0)
    strain = np.zeros((len(stretch), 6))
    strain[:, 2] = 0.5 * (stretch**2 - 1.0)
    tangent = material.stress_and_tangent(strain)[1][:, 2, 2]
    return np.maximum(stretch**2 * tangent / material.wave_stiffness()[1], 1.0)


def contact_omega2(model: Model) -> float:
    """Return what the contacts add to ω² [1/s²] when the tools have come to the sheets.

    A face touches one tool at a time, a sheet without thickness one from either side. A guided tool
    swings against all nodes of one side.
    """
    if not model.tool_names:
        return 0.0
    penalty, tools = model.environment.penalty, model.tools
    result, touched = 0.0, 0.0
    for body in model.bodies:
        sides = 1 if body.mesh.has_thickness else min(2, len(model.tool_names))
        result = max(result, sides * penalty * float((body.node_area / body.inertial_mass).max()))
        touched += penalty * float(body.node_area.sum()) / (2 if body.mesh.has_thickness else 1)
    guided = tools.mass[tools.motion_kind == GUIDED]
    return result + float((touched / guided).sum())


def plate_distance(model: Model, travel: np.ndarray) -> np.ndarray:
    """Return the least distance [m] of parallel plates that face each other, infinite without.

    travel : of all tools (TIMES, tool_count) [m].
    """
    tools = model.tools
    normal = tools.rotation[:, 2]
    distance = np.full(TIMES, math.inf)
    led = (tools.motion_kind != GUIDED) & ~turning(tools)
    plates = np.flatnonzero((tools.kind == PLANE) & led)
    for first in plates:
        for second in plates[plates > first]:
            if normal[first] @ normal[second] < -1.0 + 1e-9:
                places = tools.origin + travel[..., None] * tools.direction
                apart = (places[:, second] - places[:, first]) @ normal[first]
                distance = np.minimum(distance, np.where(apart > 0.0, apart, math.inf))
    return distance


def _travel(model: Model, time: float) -> list[float]:
    """Return the prescribed travel of the tools [m]."""
    return [prescribed_travel(model.tools, k, time)[0] for k in range(len(model.tool_names))]


def _shear_progress(model: Model, travel: np.ndarray, times: np.ndarray) -> np.ndarray:
    """Return the part of the shear, 0 to 1, by the way of the tool that moves furthest."""
    way = np.abs(np.diff(travel, axis=0, prepend=travel[:1])).cumsum(axis=0)
    if way.size == 0 or way[-1].max() == 0.0:
        return times / model.process_time
    furthest = way[:, np.argmax(way[-1])]
    return (furthest / furthest[-1]) ** 2
