"""Hard for the element: thin, stiff along the fibres, skewed, tapered, limp, sheared and turned."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence

import numpy as np
from scipy.optimize import brentq

from lcmchain.effects.supports import Support
from lcmchain.solver.simulation import Simulation
from lcmchain.verification.hard_cases.case import CaseResult, hard_case, stopped
from lcmchain.verification.hard_cases.sheets import (
    MD600,
    linear_fabric,
    nodes_at,
    outline_nodes,
    simulation,
    smooth,
)

THEME = "Elements"
CANTILEVER_ROOT = 1.8751040687119611  # cos x cosh x = -1


def cantilever_mode(x: np.ndarray, length: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the first mode of a clamped beam, 1 at its tip, and its slope [1/m]."""
    b = CANTILEVER_ROOT
    s = b * x / length
    c = (math.cosh(b) + math.cos(b)) / (math.sinh(b) + math.sin(b))
    mode = np.cosh(s) - np.cos(s) - c * (np.sinh(s) - np.sin(s))
    slope = b / length * (np.sinh(s) + np.sin(s) - c * (np.cosh(s) - np.cos(s)))
    return 0.5 * mode, 0.5 * slope


@hard_case("slenderness", THEME)
def slenderness(name: str, full: bool) -> Iterator[CaseResult]:
    """A cantilever of 10 elements vibrates at slenderness 1e2, 1e3 and 1e4.

    Hard because the bending strains are (t/L) of the displacements and their stiffness (t/L)² of
    that of the membrane: any parasitic membrane or shear strain of the mode (locking), and any
    digit lost in the difference of products that the strain is, stiffens the thin sheet. The
    amplitude is 1 mm, a hundred thicknesses of the thinnest sheet. C33 and C13 fall with (t/l)² so
    that the thickness does not govern the step; what the soft C13 takes off the frequency is
    Dunkerley's 1/ω² = 1/ω_b² + 1/ω_s².
    """
    length, edge, stiffness = 0.1, 0.01, 1e9
    for slender in (1e2, 1e3, 1e4):
        t = length / slender
        soft = 0.3 * stiffness * (t / edge) ** 2
        material = linear_fabric(1e3 * t, C12=500.0, C33=soft / 1e6, C13=soft / 1e6, B11=1000.0)
        density = 600.0 / 1.004
        bending2 = CANTILEVER_ROOT**4 * stiffness * t**2 / (12.0 * density * length**4)
        shear2 = (0.5 * math.pi / length) ** 2 * soft / density
        expected = 1.0 / math.sqrt(1.0 / bending2 + 1.0 / shear2)
        sim = simulation(
            f"""
            process = {{ time = "{2.0 * math.pi / expected} s" }}
            blank = {{ size = ["100 mm", "20 mm"], edge_length = "10 mm" }}
            [material]
            {material}
            """,
            supports=lambda X: [Support("clamp", nodes_at(X, 0, -0.05))],
        )
        X = sim.model.only_body().mesh.node_positions
        mode, slope = cantilever_mode(X[:, 0] + 0.05, length)
        speed = 1e-3 * expected
        sim.set_velocity(speed * np.array([-X[:, 2] * slope, 0.0 * mode, mode]))
        weight = sim.model.nodes.mass * mode
        half = first_return(sim, weight, math.pi / expected)
        yield CaseResult(
            name,
            f"slenderness {slender:.0e}: frequency of a cantilever against beam theory",
            100.0 * abs(math.pi / half / expected - 1.0),
            2.0,
            "%",
        )


def first_return(sim: Simulation, weight: np.ndarray, expected: float) -> float:
    """Return the time [s] at which the weighted deflection changes its sign."""
    start = sim.model.only_body().mesh.node_positions[:, 2]
    before = None
    for time in expected * np.arange(0.8, 1.5, 0.01):
        sim.advance_to(float(time))
        now = float(weight @ (sim.state.position[2] - start))
        if before is not None and now <= 0.0 < before[1]:
            return before[0] + (time - before[0]) * before[1] / (before[1] - now)
        before = (time, now)
    return math.nan


@hard_case("skew", THEME)
def skew(name: str, full: bool) -> Iterator[CaseResult]:
    """Parallelograms of 15 to 75 degrees bent to a constant curvature along the fibre.

    Hard because the natural strains of a skewed element mix all material components: the assumed
    strains must still hold nothing but the curvature. The energy is D κ²/2 per area.
    """
    worst = max(abs(bent_energy_ratio(skewed(angle)) - 1.0) for angle in (15, 30, 45, 60, 75))
    yield CaseResult(name, "bending energy of a constant curvature, exact", 100.0 * worst, 0.1, "%")


@hard_case("taper", THEME)
def taper(name: str, full: bool) -> Iterator[CaseResult]:
    """Trapezoids tapered in the plane to a third, and a thickness that grows by a half.

    Hard because covariant and material axes change over the element; the first-order change of the
    transformation is what keeps a constant curvature constant.
    """
    in_plane = abs(bent_energy_ratio(trapezoids) - 1.0)
    yield CaseResult(name, "bending energy of trapezoids, exact", 100.0 * in_plane, 1.0, "%")

    def wedge(X):
        return X * np.column_stack([np.ones((len(X), 2)), 1.0 + 5.0 * (X[:, 0] + 0.05)])

    through = abs(bent_energy_ratio(wedge, lambda x: (1.0 + 5.0 * (x + 0.05)) ** 3) - 1.0)
    yield CaseResult(
        name, "bending energy of a wedge (t³ integrated), exact", 100.0 * through, 1.0, "%"
    )


def skewed(degrees: float) -> Callable[[np.ndarray], np.ndarray]:
    slope = math.tan(math.radians(degrees))
    return lambda X: X + np.column_stack([slope * X[:, 1], 0.0 * X[:, 1], 0.0 * X[:, 1]])


def trapezoids(X: np.ndarray) -> np.ndarray:
    """Move every second line of nodes to and fro: edges of one side 1 to 3."""
    moved = X.copy()
    column = np.rint((X[:, 0] + 0.05) / 0.01).astype(int)
    row = np.rint((X[:, 1] + 0.01) / 0.01).astype(int)
    inside = (column > 0) & (column < 10)
    moved[:, 0] += np.where(inside, 0.0025 * (-1.0) ** (column + row), 0.0)
    return moved


def bent_energy_ratio(
    shape: Callable[[np.ndarray], np.ndarray],
    thickness3: Callable[[np.ndarray], np.ndarray] | None = None,
) -> float:
    """Return the energy of a strip bent by a small κ along x over the exact one.

    ``thickness3`` is (t/t0)³ as a function of x, 1 by default.
    """
    material = linear_fabric(1.0, C12=0.1, B11=40.0, B12=4.0)
    sim = simulation(
        f"""
        process = {{ time = "1 s" }}
        blank = {{ size = ["100 mm", "20 mm"], edge_length = "10 mm" }}
        [material]
        {material}
        """,
        shape=shape,
    )
    curvature = 1e-3
    X = sim.model.only_body().mesh.node_positions
    x, y, z = X.T
    sim.set_position(np.array([x - z * curvature * x, y, z + 0.5 * curvature * x**2]))
    D = 40e6 * 1e-9 / 12.0
    # three Gauss points per element along x, over both rows: exact for the cubic of a wedge
    points, weights = np.polynomial.legendre.leggauss(3)
    mesh = sim.model.only_body().mesh
    area = mesh.element_areas
    corner = mesh.mid_surface_positions[mesh.faces][..., 0]
    centre, half = corner.mean(axis=1), 0.005
    scale = thickness3 or (lambda x: np.ones_like(x))
    mean = 0.5 * (scale(centre[:, None] + half * points) @ weights)
    return sim.stored_energy() / (0.5 * D * curvature**2 * float(np.sum(area * mean)))


def catenary(length: float, span: float) -> tuple[float, float]:
    """Return sag [m] and end slope angle [rad] of an inextensible chain between level ends."""
    excess = length / span
    half = brentq(lambda u: math.sinh(u) - u * excess, 1e-9, 10.0)  # half the span over a
    return 0.5 * span / half * (math.cosh(half) - 1.0), math.atan(math.sinh(half))


LIMP_SPAN, LIMP_LENGTH, LIMP_CLOSING = 0.16, 0.2, 0.3


def limp_strip(
    supports: Callable[[np.ndarray], Sequence[Support]], element: str = ""
) -> Simulation:
    """Return a strip of MD600 with a millionth of its bending stiffness, under gravity."""
    bending = {
        "C11": 38.0615, "C22": 43.0668, "C33": 0.1, "C12": 4.2123, "C23": 0.1, "C13": 0.1,
    }  # fmt: skip
    entries = ", ".join(f'{key} = "{1e-6 * value} MPa"' for key, value in bending.items())
    return simulation(
        f"""
        process = {{ time = "600 ms", mass_damping = "40 1/s", gravity = true }}
        blank = {{ size = ["200 mm", "10 mm"], edge_length = "5 mm" }}
        element = {{ {element} }}
        [material]
        {MD600}
        bending = {{ {entries} }}
        """,
        supports=supports,
    )


def approaching_clamp(side: float, turning: bool = True) -> Callable[[float], np.ndarray]:
    """Return the motion of an end that closes the span and turns with the catenary's slope."""

    def motion(time):
        closed = smooth(time, LIMP_CLOSING) * (LIMP_LENGTH - LIMP_SPAN)
        angle = 0.0
        if turning and closed > 1e-9:
            angle = catenary(LIMP_LENGTH, LIMP_LENGTH - closed)[1]
        c, s = math.cos(angle), side * math.sin(angle)
        turn = np.array([[c, 0.0, -s], [0.0, 1.0, 0.0], [s, 0.0, c]])
        end = np.array([0.5 * side * LIMP_LENGTH, 0.0, 0.0])
        return np.column_stack([turn, end - turn @ end - [0.5 * side * closed, 0.0, 0.0]])

    return motion


@hard_case("limp_hanging", THEME)
def limp_hanging(name: str, full: bool) -> Iterator[CaseResult]:
    """A strip without bending stiffness (C^B x 1e-6) hangs between two clamps that approach.

    Hard because nothing but gravity gives the sheet a shape: the hourglass terms of bending vanish
    with C^B, and a sheet pushed together has no other resistance. The clamps turn with the slope of
    the catenary, which the strip must take.
    """
    sim = limp_strip(
        lambda X: [
            Support("left", nodes_at(X, 0, -0.1), motion=approaching_clamp(-1.0)),
            Support("right", nodes_at(X, 0, 0.1), motion=approaching_clamp(1.0)),
        ]
    )
    sim.advance_to(0.6)
    X = sim.model.only_body().mesh.node_positions
    sag = float(np.mean((X.T - sim.state.position)[2, nodes_at(X, 0, 0.0)]))
    expected = catenary(LIMP_LENGTH, LIMP_SPAN)[0]
    yield CaseResult(name, "sag against the catenary", 100.0 * abs(sag / expected - 1.0), 1.0, "%")


@hard_case("limp_pinned", THEME, reduced="--full: without as well")
def limp_pinned(name: str, full: bool) -> Iterator[CaseResult]:
    """The same strip pinned by the nodes of its lower face only.

    Hard because the eccentric pins load the sheet by a moment that it cannot carry: the directors
    of neighbouring nodes tilt to and fro through the whole strip (the transverse shear at the
    element centres does not see it). The shape means little then, but the energy must still be that
    which gravity puts in.
    """

    def supports(X):
        lower = X[:, 2] < 0.0
        return [
            Support(name, nodes[lower[nodes]], motion=approaching_clamp(side, turning=False))
            for name, side in (("left", -1.0), ("right", 1.0))
            for nodes in [nodes_at(X, 0, 0.1 * side)]
        ]

    sim = limp_strip(supports)
    sim.advance_to(0.6)
    energy = sim.energy()
    without = with_printed_cross_terms(supports) if full else ""
    yield CaseResult(
        name,
        "energy balance error over the work of gravity",
        100.0 * abs(energy["balance_error"] / energy["external"]),
        0.1,
        "%",
        without=without,
    )


def with_printed_cross_terms(supports: Callable[[np.ndarray], Sequence[Support]]) -> str:
    """Return what the cross terms of the paper do to the pinned strip."""
    printed = limp_strip(supports, "cross_terms = true")
    message = stopped(lambda: printed.advance_to(0.6))
    if message:
        return f"cross terms as printed: the guard stops the run at {1e3 * printed.time:.0f} ms"
    after = printed.energy()
    share = 100.0 * after["balance_error"] / after["external"]
    return f"cross terms as printed: {share:.1f} %"


@hard_case("simple_shear_and_turn", THEME)
def simple_shear_and_turn(name: str, full: bool) -> Iterator[CaseResult]:
    """Simple shear to 65 degrees while the whole sheet turns by 90, on a perturbed mesh.

    Hard because shear, the stretch of one fibre by 1.37 (fibre stress of thousands of MPa) and a
    large rotation come together. The edges are driven, the inside is free: the state must stay
    homogeneous and its energy that of the law, whatever the rotation.
    """
    slope, duration = math.tan(math.radians(65.0)), 20e-3

    def motion(time):
        part = smooth(time, duration)
        c, s = math.cos(0.5 * math.pi * part), math.sin(0.5 * math.pi * part)
        turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        shear = np.array([[1.0, slope * part, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
        return np.column_stack([turn @ shear, np.zeros(3)])

    sim = simulation(
        f"""
        process = {{ time = "{duration} s", mass_damping = "500 1/s" }}
        blank = {{ size = ["40 mm", "30 mm"], edge_length = "5 mm" }}
        [material]
        {MD600}
        """,
        supports=lambda X: [Support("frame", outline_nodes(X), motion=motion)],
        perturbation=0.1,
    )
    sim.advance_to(duration)
    E = np.array([0.0, 0.5 * slope**2, 0.0, slope, 0.0, 0.0])
    law = float(sim.model.only_body().material.membrane_energy(E)) * float(
        sim.model.only_body().geometry.volume.sum()
    )
    yield CaseResult(
        name,
        "strain energy against the law",
        100.0 * abs(sim.stored_energy() / law - 1.0),
        0.1,
        "%",
    )
    energy = sim.energy()
    yield CaseResult(
        name,
        "energy balance error over the work",
        100.0 * abs(energy["balance_error"] / energy["external"]),
        0.1,
        "%",
    )
