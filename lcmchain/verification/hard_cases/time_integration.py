"""Hard for the time integration: sudden loads, a million steps, steps close to the critical one."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import product

import numpy as np

from lcmchain.effects.supports import Support
from lcmchain.materials.law import Material
from lcmchain.materials.st_venant_kirchhoff import StVenantKirchhoff, orthotropic_stiffness
from lcmchain.solver.simulation import Simulation
from lcmchain.state import EXTERNAL
from lcmchain.verification import random_elements as make
from lcmchain.verification.hard_cases.case import CaseResult, hard_case
from lcmchain.verification.hard_cases.elements import cantilever_mode, skewed, trapezoids
from lcmchain.verification.hard_cases.sheets import MD600, nodes_at, simulation

THEME = "Time integration"


# --- sudden load ----------------------------------------------------------------------------------


@hard_case("sudden_load", THEME)
def sudden_load(name: str, full: bool) -> Iterator[CaseResult]:
    """Gravity comes on at once on a cantilever of MD600.

    Hard because a jump of the load excites all modes, and nothing damps them. Every mode must swing
    to twice its static deflection, never further, and the energy that gravity puts in must stay.
    """

    def cantilever(damping, time):
        return simulation(
            f"""
            process = {{ time = "{time} s", gravity = true, mass_damping = "{damping} 1/s" }}
            blank = {{ size = ["60 mm", "10 mm"], edge_length = "5 mm" }}
            [material]
            {MD600}
            """,
            supports=lambda X: [Support("clamp", nodes_at(X, 0, -0.03))],
        )

    def deflection(sim):
        X = sim.model.only_body().mesh.node_positions
        weight = sim.model.nodes.mass * cantilever_mode(X[:, 0] + 0.03, 0.06)[0]
        return float(weight @ (X[:, 2] - sim.state.position[2]))

    at_rest = cantilever(200.0, 0.2)
    at_rest.advance_to(0.2)
    static = deflection(at_rest)
    sim = cantilever(0.0, 0.3)
    swing, errors, work = [], [], []
    for time in np.linspace(0.0, 0.3, 301)[1:]:
        sim.advance_to(float(time))
        swing.append(deflection(sim))
        energy = sim.energy()
        errors.append(abs(energy["balance_error"]))
        work.append(energy["external"])
    yield CaseResult(
        name,
        "largest over static deflection of the first mode, 6 periods, against 2",
        100.0 * abs(max(swing) / static / 2.0 - 1.0),
        1.0,
        "%",
    )
    yield CaseResult(
        name,
        "energy balance error over the largest work of gravity",
        100.0 * max(errors) / max(work),
        0.1,
        "%",
    )


# --- long runs ------------------------------------------------------------------------------------


@hard_case("million_steps", THEME, reduced="100,000 steps; --full: one million")
def million_steps(name: str, full: bool) -> Iterator[CaseResult]:
    """A free sheet of 3 x 2 elements of MD600 spins and vibrates in all its modes.

    Hard because any force without a potential, and any drift of the time integration, adds up. The
    highest modes make the balance of single steps waver by 0.1 %; the drift is the difference of
    its means over the first and the last tenth of the run, over the energy of the vibration.
    """
    steps = 1_000_000 if full else 100_000
    sim = simulation(
        f"""
        process = {{ time = "100 s" }}
        blank = {{ size = ["15 mm", "10 mm"], edge_length = "5 mm" }}
        [material]
        {MD600}
        """
    )
    X = sim.model.only_body().mesh.node_positions
    noise = np.random.default_rng(0).normal(scale=0.2, size=X.shape)
    noise -= noise.mean(axis=0)
    vibration = 0.5 * float(np.sum(sim.model.nodes.mass * noise.T**2))
    sim.set_velocity((noise + np.cross([150.0, 250.0, 400.0], X)).T)
    errors = []

    def look(sim):
        if sim.state.step_count % (steps // 1000) < 50:
            errors.append(sim.energy()["balance_error"])

    sim.advance_to(steps * sim.model.step_safety * sim.critical_step(), look)
    tenth = len(errors) // 10
    drift = abs(float(np.mean(errors[-tenth:]) - np.mean(errors[:tenth])))
    yield CaseResult(name, f"energy drift in {steps:,} steps", 100.0 * drift / vibration, 0.1, "%")


# --- the stable step ------------------------------------------------------------------------------


def kicked(
    shape: Callable[[np.ndarray], np.ndarray] | None,
    safety: float,
    steps: int,
    perturbation: float = 0.0,
) -> tuple[Simulation, float]:
    """Return a free sheet after random velocities at a part of the step, and its drift [%]."""
    sim = simulation(
        f"""
        process = {{ time = "10 s" }}
        blank = {{ size = ["100 mm", "20 mm"], edge_length = "10 mm" }}
        [material]
        {MD600}
        """,
        shape=shape,
        step_safety=safety,
        perturbation=perturbation,
    )
    noise = np.random.default_rng(0).normal(scale=0.05, size=sim.state.velocity.shape)
    sim.set_velocity(noise)
    total = float(sim.state.work[EXTERNAL])
    duration, errors = steps * safety * sim.critical_step(), []
    for part in np.linspace(0.0, 1.0, 21)[1:]:
        sim.advance_to(float(part * duration))
        errors.append(sim.energy()["balance_error"])
    return sim, 100.0 * float(np.ptp(errors)) / total


@hard_case("close_to_critical", THEME)
def close_to_critical(name: str, full: bool) -> Iterator[CaseResult]:
    """Free sheets of distorted elements vibrate at 0.95 of the estimated critical step.

    Hard because the highest modes of a badly shaped element sit right at the limit; an estimate
    that is too long by 5 % makes them grow without bound within some hundred steps.
    """
    meshes = {
        "rectangles": (None, 0.0),
        "75° parallelograms": (skewed(75.0), 0.0),
        "trapezoids": (trapezoids, 0.0),
        "perturbed by 20 %": (None, 0.2),
    }
    for mesh, (shape, perturbation) in meshes.items():
        _, drift = kicked(shape, 0.95, 20_000, perturbation)
        yield CaseResult(
            name, f"{mesh}: energy drift in 20,000 steps at 0.95 critical", drift, 0.1, "%"
        )


@hard_case("beyond_critical", THEME)
def beyond_critical(name: str, full: bool) -> Iterator[CaseResult]:
    """The same rectangles at 1.1 of the critical step, which is exact for them.

    Outside what the method can do: within 50 steps no value is a number any more. The run must go
    back, halve its step for good, and say so.
    """
    sim, drift = kicked(None, 1.1, 20_000)
    found = " ".join(sim.warnings())
    yield CaseResult(
        name,
        "a step of 1.1 critical: halved once, with a warning",
        float(found.count("half the step cured it")) if sim.state.step_factor == 0.5 else 0.0,
        1.0,
        at_least=True,
        text=found.split("; half")[0],
    )
    yield CaseResult(name, "its energy drift in 40,000 half steps", drift, 0.1, "%")


def random_families(
    rng: np.random.Generator, flat: int, curved: int
) -> Iterator[tuple[str, list, list, Material]]:
    """Yield (name, references, deformed nodes, material): flat elements of each family, and curved.

    Flat ones and curved ones come apart: each kind takes code of its own.
    """
    kinds: list[slice] = [slice(flat)] * (flat > 0) + [slice(flat, None)]

    def references(thickness=make.THICKNESS):
        return [make.flat_reference(rng, thickness=thickness) for _ in range(flat)] + [
            make.curved_reference(rng, warp=rng.uniform(0.02, 0.2), thickness=thickness)
            for _ in range(curved)
        ]

    for compaction, shear in product((1.15, 0.9, 0.7, 0.5), (0.0, 40.0, -75.0)):
        elements = references()
        x = [
            make.deformed(
                rng,
                *element,
                gradient=make.sheared(np.radians(shear), compaction, rng.uniform(0.997, 1.01)),
                warp=rng.uniform(0.0, 0.15),
            )
            for element in elements
        ]
        for kind in kinds:
            name = f"fabric, thickness {compaction:g}, shear {shear:g}°"
            yield name, elements[kind], x[kind], make.md600()
    C = orthotropic_stiffness(60e9, 20e9, 10e9, 0.25, 0.3, 0.35, 5e9, 4e9, 3e9)
    for material, thickness, stretch in (
        (make.isotropic(0.3), 1e-3, 0.03),
        (make.isotropic(0.45), 1e-4, 0.03),
        (make.isotropic(0.0), 1e-2, 0.1),
        (StVenantKirchhoff(C, thickness=1e-3, density=1500.0), 1e-3, 0.05),
        (StVenantKirchhoff(C, 0.04 * C, thickness=1e-3, density=1500.0), 1e-3, 0.05),
        (make.coupled(rng), make.THICKNESS, 0.1),
        (make.coupled(rng), make.THICKNESS, 0.1),
        (make.coupled(rng, equal=True), make.THICKNESS, 0.1),
    ):
        elements = references(thickness)
        x = [make.deformed(rng, *element, stretch=stretch) for element in elements]
        for kind in kinds:
            yield f"full stiffness, {1e3 * thickness:g} mm", elements[kind], x[kind], material


@hard_case(
    "estimated_step", THEME, reduced="2,000 curved elements; --full: 10,000, half of them flat"
)
def estimated_step(name: str, full: bool) -> Iterator[CaseResult]:
    """The estimated critical step of random distorted elements in random states.

    Hard because the estimate has to know the tangent, the geometric stiffness and the shape. It
    must never be longer than the true one (from the eigenvalues of the tangent), which no safety
    factor could repair, and not much shorter, which would waste time.
    """
    ratios: dict[str, list[np.ndarray]] = {}
    rng = np.random.default_rng(0)
    flat, curved = (250, 250) if full else (0, 100)
    for family, references, x, material in random_families(rng, flat, curved):
        bound, true = make.bounds_and_frequencies(references, x, material)
        ratios.setdefault(family, []).append(true / bound)
    every = np.concatenate([np.concatenate(parts) for parts in ratios.values()])
    means = {family: float(np.mean(np.concatenate(parts))) for family, parts in ratios.items()}
    yield CaseResult(
        name,
        f"largest estimated over true critical step, {every.size:,} elements",
        float(every.max()),
        1.0 + 1e-6,
    )
    worst = min(means, key=means.__getitem__)
    yield CaseResult(
        name,
        f"mean of estimated over true step, worst family ({worst})",
        means[worst],
        0.5,
        at_least=True,
    )
