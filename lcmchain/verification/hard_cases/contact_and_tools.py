"""Hard for contact: small fillets, chatter on an edge, release, coarse meshes, wrinkling."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from lcmchain.effects.contact import normal_force
from lcmchain.effects.supports import Support, translation
from lcmchain.solver.simulation import Simulation
from lcmchain.verification.hard_cases.case import CaseResult, hard_case
from lcmchain.verification.hard_cases.sheets import (
    MD600,
    fields,
    nodes_at,
    simulation,
    smooth,
)

THEME = "Contact and tools"


def wiping_tools(
    radius: float, motion: str, *, thickness: float = 1.004, holder: str = 'mass = "50 g"'
) -> str:
    """Return the tables of a punch that wipes a sheet down over the edge of a die, under a holder.

    ``radius`` of the fillets of die and punch, ``thickness`` of the sheet or stack that lies on the
    die, in mm. The clearance between die and punch is 1.3 thicknesses. ``holder`` : what guides it.
    """
    clearance = round(1.3 * thickness / 1.004, 9)
    return f"""
        [[tools]]
        name = "die"
        shape = {{ type = "extruded_profile", solid = "right", \
fillet_radii = "0 {radius} 0 mm", \
points = [["-100 mm", "0 mm"], ["0 mm", "0 mm"], ["0 mm", "-100 mm"]] }}
        [[tools]]
        name = "punch"
        position = ["{clearance} mm", "0 mm", "{thickness} mm"]
        shape = {{ type = "extruded_profile", solid = "left", \
fillet_radii = "0 {radius} 0 mm", \
points = [["0 mm", "100 mm"], ["0 mm", "0 mm"], ["100 mm", "0 mm"]] }}
        motion = {motion}
        [[tools]]
        name = "holder"
        position = ["0 mm", "0 mm", "{thickness} mm"]
        shape = {{ type = "extruded_profile", solid = "left", \
fillet_radii = "0 {radius} 0 mm", \
points = [["-100 mm", "0 mm"], ["-2 mm", "0 mm"], ["-2 mm", "100 mm"]] }}
        motion = {{ type = "guided", direction = [0, 0, -1], {holder}, ramp = "5 ms" }}
        """


def wiped(radius: float, edge: float, motion: str, time: float) -> Simulation:
    """Return a strip between :func:`wiping_tools`; ``edge`` length of the elements in mm."""
    return simulation(
        f"""
        process = {{ time = "{time} s", mass_damping = "100 1/s" }}
        blank = {{ size = ["100 mm", "20 mm"], edge_length = "{edge} mm", height = "0.502 mm" }}
        contact = {{ friction = 0.157 }}
        [material]
        {MD600}
        {wiping_tools(radius, motion)}
        """
    )


def stroke(distance: float) -> str:
    """Return the motion entries of a smooth stroke downwards [mm]."""
    return f'{{ type = "stroke", direction = [0, 0, -1], distance = "{distance} mm" }}'


def to_and_back(distance: float, down: float) -> str:
    """Return the motion entries of a smooth stroke downwards [mm] in a time [s], and back."""
    times = np.linspace(0.0, 2.0 * down, 61)
    way = [distance * smooth(min(t, 2.0 * down - t), down) for t in times]
    return (
        f'{{ type = "table", direction = [0, 0, -1], '
        f'times = "{" ".join(f"{1e3 * t:.9g}" for t in times)} ms", '
        f'travel = "{" ".join(f"{w:.9g}" for w in way)} mm" }}'
    )


@hard_case("fillets", THEME)
def fillets(name: str, full: bool) -> Iterator[CaseResult]:
    """Strips wiped over fillets of 2, 5 and 10 mm with elements of 2.5, 5 and 10 mm.

    Hard because an element spans up to five times the radius: contact is at the nodes only, and the
    tool pulls the coarse ones off the surface and on again. No mesh may gain energy, fold or lose
    its thickness.
    """
    time = 0.06
    for edge in (2.5, 5.0, 10.0):
        balance, thinnest, deepest = 0.0, 1.0, 0.0
        for radius in (2.0, 5.0, 10.0):
            sim = wiped(radius, edge, stroke(35.0), time)
            errors: list[dict[str, float]] = []
            sim.advance_to(time, lambda sim, errors=errors: errors.append(sim.energy()))  # type: ignore[misc]
            work = max(abs(energy["external"]) for energy in errors)
            worst = max(abs(energy["balance_error"]) for energy in errors)
            balance = max(balance, worst / work)
            thinnest = min(thinnest, float(fields(sim)["thickness"].min()) / 1.004e-3)
            deepest = max(deepest, float(sim.state.penetration_max.max()))
        mesh = f"elements of {edge:g} mm, radii 2, 5, 10 mm"
        yield CaseResult(
            name, f"{mesh}: energy balance error over the work", 100.0 * balance, 1.0, "%"
        )
        yield CaseResult(
            name,
            f"{mesh}: least thickness over the initial one",
            thinnest,
            0.7,
            at_least=True,
        )
        yield CaseResult(name, f"{mesh}: deepest penetration", 1e3 * deepest, 0.1, "mm")


@hard_case("release", THEME)
def release(name: str, full: bool) -> Iterator[CaseResult]:
    """The strip is wiped over a fillet of 5 mm, and the punch goes back.

    Hard because the stored energy comes free while contact opens: the sheet must come to rest, with
    no energy but that which the tools left in it.
    """
    down, end = 0.06, 0.2
    sim = wiped(5.0, 5.0, to_and_back(35.0, down), end)
    sim.advance_to(down)
    formed = sim.stored_energy()
    sim.advance_to(end)
    energy = sim.energy()
    yield CaseResult(
        name,
        "kinetic energy at the end over the stored energy of the formed strip",
        100.0 * energy["kinetic"] / formed,
        0.1,
        "%",
    )
    yield CaseResult(
        name,
        "energy balance error over the stored energy of the formed strip",
        100.0 * abs(energy["balance_error"]) / formed,
        1.0,
        "%",
    )


@hard_case("chatter_on_an_edge", THEME)
def chatter_on_an_edge(name: str, full: bool) -> Iterator[CaseResult]:
    """A free sheet is thrown onto the sharp edge of a block, without damping, friction or gravity.

    Hard because its nodes go in and out of the contact again and again, at any phase of the step,
    while the normal of the edge changes. Not one of these impacts may add energy.
    """
    sim = simulation(
        f"""
        process = {{ time = "20 ms" }}
        blank = {{ size = ["60 mm", "20 mm"], edge_length = "5 mm", height = "0.6 mm" }}
        contact = {{ damping_ratio = 0.0 }}
        [material]
        {MD600}
        [[tools]]
        name = "block"
        shape = {{ type = "extruded_profile", solid = "right", \
points = [["-100 mm", "0 mm"], ["1 mm", "0 mm"], ["1 mm", "-100 mm"]] }}
        [[tools]]
        name = "lid"
        shape = {{ type = "plate", side = "above" }}
        position = ["0 mm", "0 mm", "1.3 mm"]
        """
    )
    X = sim.model.only_body().mesh.node_positions
    sim.set_velocity(np.array([0.0 * X[:, 0], 0.0 * X[:, 0], -0.5 - 20.0 * X[:, 0]]))
    start = sim.energy()["external"]
    impacts, gains = np.zeros(1), [0.0]
    inside = np.zeros(sim.model.node_count, dtype=bool)

    def look(sim):
        nonlocal inside
        now = sim.state.position[2] < 0.0
        impacts[0] += np.count_nonzero(now & ~inside)
        inside = now
        gains.append(sim.energy()["balance_error"] / start)

    sim.advance_to(0.02, look)
    yield CaseResult(
        name,
        f"largest gain of energy (at least {impacts[0]:.0f} impacts of nodes)",
        100.0 * max(gains),
        0.5,
        "%",
        without=(
            f"full spring force from the first step inside: single impacts change the energy by "
            f"{bounce_change(shared=False)}, with the force by the share of the step: "
            f"{bounce_change(shared=True)}"
        ),
    )


def bounce_change(shared: bool) -> str:
    """Return the range of the energy change of one undamped impact over all phases of the step.

    A single mass against a penalty spring, at the ratio of step and contact period that the
    automatic contact stiffness gives (ω dt = 0.57).
    """
    stiffness, changes = 0.57**2, []
    for phase in np.linspace(0.0, 1.0, 101):
        position, velocity = 1.5 + phase, -1.0  # mass, step and speed are 1
        for _ in range(40):
            force = 0.0
            if position < 0.0:
                force = -stiffness * position
                if shared:
                    force = normal_force(stiffness, 0.0, position, velocity, 1.0, 0.0, 1.0, 1.0)[0]
            velocity += force
            position += velocity
        changes.append(100.0 * (velocity**2 - 1.0))
    return f"{min(changes):+.1f} to {max(changes):+.1f} %"


def shortened_strip(time: float, shortening: float, imperfection: float) -> Simulation:
    """Return a clamped strip that is shortened [m] within half the ``time``.

    ``imperfection`` is the amplitude of the first wave in thicknesses.
    """
    length = 0.1

    def supports(X):
        push = translation([-1, 0, 0], lambda t: shortening * smooth(t, 0.5 * time))
        return [
            Support("left", nodes_at(X, 0, -0.5 * length)),
            Support("right", nodes_at(X, 0, 0.5 * length), motion=push),
        ]

    sim = simulation(
        f"""
        process = {{ time = "{time} s", mass_damping = "40 1/s" }}
        blank = {{ size = ["100 mm", "10 mm"], edge_length = "5 mm" }}
        [material]
        {MD600}
        """,
        supports=supports,
    )
    x, y, z = sim.state.position
    wave = 0.5 * imperfection * 1.004e-3 * (1.0 + np.cos(2.0 * math.pi * x / length))
    sim.set_position(np.array([x, y, z + wave]))
    return sim


@hard_case("wrinkling_strip", THEME)
def wrinkling_strip(name: str, full: bool) -> Iterator[CaseResult]:
    """A clamped strip of MD600 is shortened by 1 %, with and without a seeded imperfection.

    Hard because the flat strip is unstable from a strain of 1e-5 on. With an imperfection, be it a
    nanometre, the end is the first wave under the critical stress 4π²D/(L²t), with the transverse
    shear after Engesser, 1/σ = L²t/(4π²D) + 1/C13, times 1 + δ/2L of the elastica. A perfectly flat
    strip has no reason to leave its plane; its fibres kink in the plane, at a higher stress, and
    it must come to rest there.
    """
    time, shortening, length, width, thickness = 0.75, 1e-3, 0.1, 0.01, 1.004e-3
    D = 38.0615e6 * thickness**3 / 12.0
    euler = 4.0 * math.pi**2 * D / (length**2 * thickness)
    critical = (1.0 + 0.5 * shortening / length) / (1.0 / euler + 1.0 / 0.1e6)
    for imperfection in (0.1, 1e-6):
        sim = shortened_strip(time, shortening, imperfection)
        sim.advance_to(0.9 * time)
        before = sim.state.support_impulse[1, 0]
        sim.advance_to(time)
        stress = (before - sim.state.support_impulse[1, 0]) / (0.1 * time * width * thickness)
        yield CaseResult(
            name,
            f"imperfection of {imperfection:g} t: stress against the critical one",
            100.0 * abs(stress / critical - 1.0),
            5.0,
            "%",
        )
    sim = shortened_strip(time, shortening, 0.0)
    sim.advance_to(time)
    energy = sim.energy()
    yield CaseResult(
        name,
        "perfectly flat: kinetic over internal energy at the end",
        100.0 * energy["kinetic"] / energy["internal"],
        0.1,
        "%",
    )
    yield CaseResult(
        name,
        "perfectly flat: energy balance error over the work",
        100.0 * abs(energy["balance_error"] / energy["external"]),
        0.1,
        "%",
    )
