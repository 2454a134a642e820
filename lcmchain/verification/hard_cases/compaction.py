"""Hard compaction: between plates to half the thickness and back, pinched between closed tools."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from lcmchain.fields.derived import pressure_fields
from lcmchain.solver.simulation import Simulation
from lcmchain.verification.hard_cases.case import CaseResult, guarded, hard_case, stopped
from lcmchain.verification.hard_cases.sheets import (
    MD600,
    fields,
    simulation,
    smooth,
)

THEME = "Compaction"
THICKNESS = 1.004e-3
EDGE = 0.02


def to_and_fro(travel: float, time: float) -> str:
    """Return the motion entries of a plate that goes down by ``travel`` [m] and comes back."""
    parts = np.linspace(0.0, 1.0, 81)
    way = [travel * smooth(min(2.0 * s, 2.0 - 2.0 * s), 1.0) for s in parts]
    times = " ".join(f"{1e3 * time * s:.9g}" for s in parts)
    travels = " ".join(f"{1e3 * w:.9g}" for w in way)
    return (
        f'{{ type = "table", direction = [0, 0, -1], times = "{times} ms", '
        f'travel = "{travels} mm" }}'
    )


def between_plates(
    motion: str,
    time: float,
    *,
    friction: float = 0.0,
    penalty: str = "1000 N/mm^3",
    element: str = "",
    perturbation: float = 0.0,
) -> Simulation:
    """Return a sheet of 4 x 4 elements between plates, its nodes shifted at random in the plane."""
    sim = simulation(
        f"""
        process = {{ time = "{time} s", mass_damping = "200 1/s" }}
        blank = {{ size = ["20 mm", "20 mm"], edge_length = "5 mm", height = "0.502 mm" }}
        contact = {{ friction = {friction}, penalty = "{penalty}" }}
        element = {{ {element} }}
        [material]
        {MD600}
        [[tools]]
        name = "lower"
        shape = {{ type = "plate", side = "below" }}
        [[tools]]
        name = "upper"
        shape = {{ type = "plate", side = "above" }}
        position = ["0 mm", "0 mm", "1.004 mm"]
        motion = {motion}
        """,
        perturbation=perturbation,
        seed=1,
    )
    shift = np.random.default_rng(0).uniform(-1e-6, 1e-6, sim.state.position.shape)
    shift[2] = 0.0
    sim.set_position(sim.state.position + shift)
    return sim


def director_tilts(sim: Simulation) -> np.ndarray:
    """Return the angles (element_count,) between director and normal of the mid-surface [rad]."""
    corners = sim.state.position.T[sim.model.only_body().mesh.elements]
    bottom, top = corners[:, :4], corners[:, 4:]
    middle = 0.5 * (bottom + top)
    normal = np.cross(middle[:, 2] - middle[:, 0], middle[:, 3] - middle[:, 1])
    director = (top - bottom).mean(axis=1)
    across = np.linalg.norm(np.cross(director, normal), axis=1)
    return np.arctan2(across, np.einsum("ed,ed->e", director, normal))


def squeeze(sim: Simulation, time: float) -> tuple[float, float, float]:
    """Run, and return deviation from the law, largest director tilt [rad], least thickness [m].

    The deviation is that of the pressure from p = λ|S33|, relative to it, above 0.02 MPa.
    """
    material = sim.model.only_body().material
    deviation = tilt = 0.0
    least = THICKNESS
    for part in np.linspace(0.0, 1.0, 81)[1:]:
        sim.advance_to(float(part * time))
        thickness = fields(sim)["thickness"]
        law = float(np.mean(material.compaction_pressure(thickness / THICKNESS)))
        pressure = float(sim.state.tool_force[1, 2]) / EDGE**2
        if law > 2e4:
            deviation = max(deviation, abs(pressure / law - 1.0))
        tilt = max(tilt, float(director_tilts(sim).max()))
        least = min(least, float(thickness.min()))
    return deviation, tilt, least


@hard_case("compaction_between_plates", THEME)
def compaction_between_plates(name: str, full: bool) -> Iterator[CaseResult]:
    """MD600 between plates, compacted to 0.5 mm and released, with and without friction.

    Hard because the stiffness grows 500-fold, the thickness wave comes to govern the step, and the
    pressure (7 MPa) exceeds the transverse shear stiffness (0.1 MPa) seventy times: only a
    compaction strain that a tilt of the director does not relieve keeps the sheet from shearing
    off. Nodes are shifted at random to start just that.
    """
    time, travel = 0.04, 0.52e-3
    for friction in (0.0, 0.3):
        sim = between_plates(to_and_fro(travel, time), time, friction=friction)
        start = sim.state.position.copy()
        deviation, tilt, least = squeeze(sim, time)
        without = ""
        if full or friction == 0.0:
            without = director_between_plates(to_and_fro(travel, time), time, friction)
        where = f"µ = {friction:g}, to {1e3 * least:.3f} mm"
        yield CaseResult(
            name, f"{where}: pressure against p = λ|S33|, both ways", 100.0 * deviation, 2.0, "%"
        )
        yield CaseResult(
            name, f"{where}: tilt of the directors", math.degrees(tilt), 1.0, "°", without=without
        )
        sim.advance_to(time + 0.02)
        left = float(np.abs(sim.state.position - start).max())
        yield CaseResult(name, f"{where}: distance from the start", 1e6 * left, 5.0, "µm")


def director_between_plates(motion: str, time: float, friction: float) -> str:
    """Return what the published compaction strain does in the same test."""
    sim = between_plates(motion, time, friction=friction, element='compaction_strain = "director"')
    tilts = []
    message = stopped(
        lambda: sim.advance_to(0.5 * time, lambda s: tilts.append(director_tilts(s).max()))
    )
    if message:
        return f"director strain: the guard stops it ({message.split('. Likely')[0]})"
    thickness = float(fields(sim)["thickness"].mean())
    law = float(sim.model.only_body().material.compaction_pressure(thickness / THICKNESS))
    share = float(sim.state.tool_force[1, 2]) / EDGE**2 / law
    return (
        f"director strain: tilt {math.degrees(max(tilts)):.0f}°, pressure {100.0 * share:.0f} % of "
        f"the law at {1e3 * thickness:.2f} mm"
    )


def advance_at_constant_step(sim: Simulation, time: float) -> None:
    """Advance with the step of the start, and with all guards."""
    step = sim.prepare_steps()
    while sim.time < time:
        sim.make_steps(50, step)
        sim.prepare_steps()


@hard_case("step_follows_compaction", THEME)
def step_follows_compaction(name: str, full: bool) -> Iterator[CaseResult]:
    """The same with contact soft enough for the thickness wave to govern the step.

    Hard because the stable step falls to a half within the run, and a step of the start is too long
    by then.
    """
    time, motion = 0.04, to_and_fro(0.60e-3, 0.04)
    sim = between_plates(motion, time, penalty="200 N/mm^3")
    steps = []
    sim.advance_to(0.5 * time, lambda sim: steps.append(sim.control.step))
    least, stored = float(fields(sim)["thickness"].min()), sim.stored_energy()
    sim.advance_to(time)
    fixed = between_plates(motion, time, penalty="200 N/mm^3")
    message = stopped(lambda: advance_at_constant_step(fixed, time))
    without = (
        f"step of the start: stopped at {1e3 * fixed.time:.1f} ms of {1e3 * time:.0f} ms"
        if message
        else "step of the start: runs through"
    )
    yield CaseResult(
        name,
        f"energy balance error over the stored energy (least thickness {1e3 * least:.2f} mm, "
        f"step {1e6 * max(steps):.2f} to {1e6 * min(steps):.2f} µs)",
        100.0 * abs(sim.energy()["balance_error"]) / stored,
        0.5,
        "%",
        without=without,
    )


def s_shaped_tools(gap: float, travel: float) -> str:
    """Return the tables of two S-shaped tools whose surfaces end ``gap`` [mm] apart.

    The step is 10 mm high under 45 degrees. Fillets that face each other have one centre: that of
    the upper tool is shorter by the gap in the valley of the lower one, longer at its brow.
    """
    radius, height, run = 10.0, 10.0, 10.0
    # the offset of a polyline by the gap: its corners move along the bisectors
    shift = gap * math.tan(math.radians(22.5))
    lower = [(-60, 0), (-0.5 * run, 0), (0.5 * run, height), (60, height)]
    upper = [
        (-60, gap),
        (-0.5 * run - shift, gap),
        (0.5 * run - shift, height + gap),
        (60, height + gap),
    ]

    def profile(points, radii, solid):
        corners = ", ".join(f'["{x} mm", "{z} mm"]' for x, z in points)
        fillets = " ".join(f"{r}" for r in radii)
        return (
            f'{{ type = "extruded_profile", points = [{corners}], fillet_radii = "{fillets} mm", '
            f'solid = "{solid}" }}'
        )

    return f"""
        [[tools]]
        name = "lower"
        shape = {profile(lower, (0, radius, radius, 0), "right")}
        [[tools]]
        name = "upper"
        position = ["0 mm", "0 mm", "{travel} mm"]
        shape = {profile(upper, (0, radius - gap, radius + gap, 0), "left")}
        motion = {{ type = "stroke", direction = [0, 0, -1], distance = "{travel} mm" }}
        """


def strip_between_s_shaped_tools(gap: float, travel: float, time: float) -> Simulation:
    """Return a strip between :func:`s_shaped_tools`."""
    return simulation(
        f"""
        process = {{ time = "{time} s", mass_damping = "100 1/s" }}
        blank = {{ size = ["80 mm", "20 mm"], edge_length = "2.5 mm", height = "10.502 mm" }}
        contact = {{ friction = 0.157 }}
        [material]
        {MD600}
        {s_shaped_tools(gap, travel)}
        """
    )


@hard_case("pinched", THEME)
def pinched(name: str, full: bool) -> Iterator[CaseResult]:
    """A strip between S-shaped tools that close to 80 % of its thickness.

    Hard because bending, friction on both faces and compaction come together, and the sheet cannot
    give way any more. Between the tools its layers slide on each other as it bends, so that the
    directors tilt (by 45° on the slope if they slid freely); where directors give way to pressure
    and fold over, neighbours tilt by more than 30° and the pressure is lost.
    """
    gap = 0.8 * 1e3 * THICKNESS
    sim = strip_between_s_shaped_tools(gap, 11.3, 0.06)
    sim.advance_to(0.06)
    face = fields(sim)
    off_gap = np.abs(1e3 * face["thickness"] / gap - 1.0)
    law = float(sim.model.only_body().material.compaction_pressure(1e-3 * gap / THICKNESS))
    # in the sheet: of the tools and of its bending together
    body = sim.model.only_body()
    inside = sum(pressure_fields(body, sim.state.position.T, sim.state.history).values())
    off_law = np.abs(inside / law - 1.0)
    tilt = director_tilts(sim)
    centre = body.mesh.mid_surface_positions[body.mesh.faces].mean(axis=1)
    level = np.abs(centre[:, 0]) > 0.02
    for where, part in (("level parts", level), ("bends", ~level)):
        thickness, pressure = (100.0 * float(off[part].max()) for off in (off_gap, off_law))
        yield CaseResult(name, f"{where}: thickness against the gap", thickness, 2.0, "%")
        yield CaseResult(name, f"{where}: pressure against the law at the gap", pressure, 10.0, "%")
    yield CaseResult(
        name, "bends: tilt of the directors", math.degrees(tilt[~level].max()), 20.0, "°"
    )
    energy = sim.energy()
    yield CaseResult(
        name,
        "energy balance error over the work",
        100.0 * abs(energy["balance_error"] / energy["external"]),
        1.0,
        "%",
    )
    yield CaseResult(
        name,
        "kinetic over internal energy at the end",
        100.0 * energy["kinetic"] / energy["internal"],
        1.0,
        "%",
    )


@hard_case("pinched_shut", THEME)
def pinched_shut(name: str, full: bool) -> Iterator[CaseResult]:
    """The same tools closed to 10 % of the thickness: more fibre than space.

    Outside what the method can do: with the automatic contact stiffness the sheet would sink into
    the tools, with a stiff one the compaction law would be read where it means nothing.
    """
    yield guarded(
        name,
        "automatic contact stiffness: ends in the guard's words",
        lambda: strip_between_s_shaped_tools(0.1, 11.3, 0.06).advance_to(0.06),
        "inside",
        "contact.penalty",
    )
    plates = '{ type = "stroke", direction = [0, 0, -1], distance = "0.9 mm" }'
    yield guarded(
        name,
        "stiff plates: ends in the guard's words",
        lambda: between_plates(plates, 0.02, penalty="10000 N/mm^3").advance_to(0.02),
        "collapsed",
        "lower, upper",
    )
