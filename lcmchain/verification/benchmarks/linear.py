"""Beams, plates and shells in linear theory, by MacNeal and Harder (1985) unless said otherwise."""

from __future__ import annotations

import math

import numpy as np

from lcmchain.scene import Element
from lcmchain.statics import StaticProblem, linear_frequencies, linear_solution
from lcmchain.verification.benchmarks.meshes import (
    AS_PUBLISHED,
    NO_SHEAR_ROW,
    Sheet,
    X,
    Y,
    Z,
    cylinder_sector,
    hemisphere_quarter,
    isotropic_model,
    options_of,
    parameters,
    rectangle,
    sheet,
    twisted_strip,
)
from lcmchain.verification.benchmarks.result import BenchmarkResult

MACNEAL_HARDER = "MacNeal, Harder 1985"

LENGTH, DEPTH, THICKNESS = 6.0, 0.2, 0.1
# tip displacement under a unit load; the unit couple's is a rotation
STRAIGHT = {"extension": 3.0e-5, "in-plane": 0.1081, "out-of-plane": 0.4321, "twist": 0.03208}
# Value over reference of an independent linear implementation of the element as published.
STRAIGHT_EXPECTED = {
    ("rectangle", "extension"): 0.986,
    ("trapezoid", "extension"): 0.986,
    ("parallelogram", "extension"): 0.986,
    ("rectangle", "out-of-plane"): 0.979,
    ("trapezoid", "out-of-plane"): 0.962,
    ("parallelogram", "out-of-plane"): 0.977,
}
IN_PLANE_EXPECTED = {6: 0.093, 12: 0.284, 24: 0.606, 48: 0.854, 96: 0.952}
IN_PLANE_NO_SHEAR_ROW_EXPECTED = {6: 0.884, 12: 0.892, 24: 0.954, 48: 0.979, 96: 0.988}
DISTORTED_IN_PLANE_EXPECTED = {
    ("trapezoid", True): 0.026,
    ("parallelogram", True): 0.032,
    ("trapezoid", False): 0.039,
    ("parallelogram", False): 0.167,
}

# (thickness, load) -> displacement in the direction of the load at the tip, and what the
# independent implementation gives for 12, 24 and 48 elements along the beam
TWISTED = {
    ("thick", "in-plane"): (0.005424, {12: 0.991, 24: 0.995, 48: 0.997}),
    ("thick", "out-of-plane"): (0.001754, {12: 0.918, 24: 0.973, 48: 0.990}),
    ("thin", "in-plane"): (0.005256, {12: 0.977, 24: 0.991, 48: 0.995}),
    ("thin", "out-of-plane"): (0.001294, {12: 0.974, 24: 0.993, 48: 0.996}),
}


def straight_beam(shape: str, n1: int, n2: int) -> Sheet:
    """Mesh the straight beam with elements of a ``shape``: distorted ones have edges at 45°."""
    if shape == "rectangle":
        return rectangle(LENGTH, DEPTH, THICKNESS, n1, n2)
    s, t = parameters(n1, n2)
    shift = np.full(n1 + 1, 1.0) if shape == "parallelogram" else (-1.0) ** np.arange(n1 + 1)
    shift[[0, -1]] = 0.0  # the ends are straight
    x = LENGTH * s + DEPTH * (t - 0.5) * shift[:, None]
    middle = np.stack([x, DEPTH * t, 0 * s], axis=-1)
    return sheet(middle, np.broadcast_to([0.0, 0.0, 1.0], middle.shape), THICKNESS)


def straight_cantilever(
    load: str, shape: str = "rectangle", n1: int = 6, n2: int = 1, element: Element = AS_PUBLISHED
) -> BenchmarkResult:
    """Slender beam under a unit load or couple at its tip."""
    mesh = straight_beam(shape, n1, n2)
    model = isotropic_model(mesh, 1e7, 0.3, element)
    tip = mesh.grid[-1]
    held = mesh.held((mesh.grid[0], [X, Y, Z]))
    if load == "twist":
        forces = mesh.pair_loads(tip[[0, -1]], np.outer([-1.0, 1.0], [0.0, 0.0, 1.0 / DEPTH]))
    else:
        axis = {"extension": X, "in-plane": Y, "out-of-plane": Z}[load]
        forces = mesh.edge_load(tip, np.eye(3)[axis])
    u = mesh.middle(linear_solution(StaticProblem(model=model, held=held, forces=forces)), tip)
    value = (u[-1, Z] - u[0, Z]) / DEPTH if load == "twist" else u[:, axis].mean()
    expected = _expected(load, shape, n1, n2, element)
    return BenchmarkResult(
        f"straight beam, {load}",
        f"{shape} {mesh.mesh}",
        options_of(element),
        value,
        STRAIGHT[load],
        MACNEAL_HARDER,
        expected,
    )


def _expected(load, shape, n1, n2, element):
    """Return what the independent implementation gives for the straight beam, or None."""
    if element not in (AS_PUBLISHED, NO_SHEAR_ROW):
        return None
    kept = element == AS_PUBLISHED
    if load == "in-plane" and shape == "rectangle":
        return (IN_PLANE_EXPECTED if kept else IN_PLANE_NO_SHEAR_ROW_EXPECTED).get(n1)
    if (n1, n2) != (6, 1):
        return None
    if load == "in-plane":
        return DISTORTED_IN_PLANE_EXPECTED[shape, kept]
    return STRAIGHT_EXPECTED.get((shape, load)) if kept else None


def twisted_beam(
    thickness: str, load: str, n1: int, element: Element = AS_PUBLISHED
) -> BenchmarkResult:
    """Beam twisted by 90° under a tip load along (in-plane) or across its width at the tip."""
    t, P = {"thick": (0.32, 1.0), "thin": (0.0032, 1e-6)}[thickness]
    mesh = twisted_strip(12.0, 1.1, t, 0.5 * math.pi, n1, n1 // 6)
    model = isotropic_model(mesh, 29e6, 0.22, element)
    tip = mesh.grid[-1]
    axis = {"in-plane": Z, "out-of-plane": Y}[load]  # the width of the tip lies along z
    forces = mesh.edge_load(tip, P * np.eye(3)[axis])
    held = mesh.held((mesh.grid[0], [X, Y, Z]))
    u = linear_solution(StaticProblem(model=model, held=held, forces=forces))
    reference, expected = TWISTED[thickness, load]
    return BenchmarkResult(
        f"twisted beam t = {t}, {load}",
        mesh.mesh,
        options_of(element),
        mesh.middle(u, tip[len(tip) // 2])[axis],
        reference,
        MACNEAL_HARDER if thickness == "thick" else "Altair OptiStruct OS-V:0700, FinEtools",
        expected.get(n1) if element == AS_PUBLISHED else None,
    )


def cantilever_frequency(n1: int = 16, element: Element = AS_PUBLISHED) -> BenchmarkResult:
    """Lowest bending frequency [Hz] of a slender cantilever against beam theory."""
    E, length, thickness, density = 1.2e6, 10.0, 0.1, 3.1314e-4
    mesh = rectangle(length, 1.0, thickness, n1, 1)
    model = isotropic_model(mesh, E, 0.0, element, density=density)
    frequencies, _ = linear_frequencies(model, mesh.held((mesh.grid[0], [X, Y, Z])), 1)
    bending, mass = E * thickness**2 / 12.0, density  # per unit of the cross-section
    exact = 1.8751040687**2 / (2.0 * math.pi * length**2) * math.sqrt(bending / mass)
    return BenchmarkResult(
        "cantilever frequency",
        mesh.mesh,
        options_of(element),
        float(frequencies[0]),
        exact,
        "Euler-Bernoulli beam",
    )


# --- clamped square plate, from thick to very thin ------------------------------------------------


# deflection of the centre over P L²/D and q L⁴/D, Kirchhoff plate (series)
COEFFICIENTS = {"point": 0.0056046, "uniform": 0.00126532}
# Value over reference of an independent linear implementation of the element as published, by
# (load, slenderness) and the elements along the edge of a quarter.
EXPECTED = {
    ("point", 100): {2: 0.855, 4: 0.963, 8: 0.993, 16: 1.002, 32: 1.005},
    ("point", 1000): {4: 0.961, 8: 0.990, 16: 0.998, 32: 1.001},
    ("uniform", 100): {2: 0.947, 4: 0.987, 8: 0.998, 16: 1.001, 32: 1.001},
    ("uniform", 1000): {4: 0.986, 8: 0.996, 16: 0.999, 32: 1.000},
}


def clamped_plate(
    load: str, slenderness: int, count: int, element: Element = AS_PUBLISHED
) -> BenchmarkResult:
    """Deflection of the centre under a central force ("point") or a pressure ("uniform")."""
    length, E, nu = 100.0, 1e7, 0.3
    thickness = length / slenderness
    mesh = rectangle(0.5 * length, 0.5 * length, thickness, count, count)
    model = isotropic_model(mesh, E, nu, element)
    grid = mesh.grid
    held = mesh.held(
        (grid[0], [X]), (grid[:, 0], [Y]), (grid[-1], [X, Y, Z]), (grid[:, -1], [X, Y, Z])
    )
    rigidity = E * thickness**3 / (12.0 * (1.0 - nu**2))
    if load == "point":
        forces = mesh.pair_loads([grid[0, 0]], [0.0, 0.0, 0.25 * rigidity / length**2])
    else:
        forces = np.zeros((3, model.node_count))
        forces[Z] = 0.5 * model.nodes.area * rigidity / length**4
    u = linear_solution(StaticProblem(model=model, held=held, forces=forces))
    return BenchmarkResult(
        f"clamped plate L/t = {slenderness:g}, {load} load",
        mesh.mesh,
        options_of(element),
        float(mesh.middle(u, grid[0, 0])[Z]),
        COEFFICIENTS[load],
        "series of the Kirchhoff plate",
        EXPECTED.get((load, slenderness), {}).get(count) if element == AS_PUBLISHED else None,
    )


# --- Scordelis-Lo roof, pinched cylinder, hemisphere with a hole ----------------------------------


# Value over reference by the elements along an edge, from an independent linear implementation of
# the element as published: material tangent in the hourglass terms, in-plane shear row kept.
SCORDELIS_LO = {4: 0.948, 8: 0.974, 16: 0.989, 32: 0.994}
PINCHED_CYLINDER = {4: 0.379, 8: 0.745, 16: 0.927, 32: 0.987}
HEMISPHERE = {4: 1.031, 8: 0.995, 16: 0.990, 32: 0.993}


def scordelis_lo(count: int, element: Element = AS_PUBLISHED) -> BenchmarkResult:
    """Roof under its own weight on end diaphragms; sag of the free edge at midspan."""
    mesh = cylinder_sector(25.0, 25.0, 0.25, math.radians(40.0), count, count)
    model = isotropic_model(mesh, 4.32e8, 0.0, element)
    grid = mesh.grid  # second index: from the free edge to the crown
    held = mesh.held((grid[0], [X, Z]), (grid[-1], [Y]), (grid[:, -1], [X]))
    weight = np.zeros((3, model.node_count))
    weight[Z] = -0.5 * 90.0 * model.nodes.area
    u = linear_solution(StaticProblem(model=model, held=held, forces=weight))
    sag = -mesh.middle(u, grid[-1, 0])[Z]
    return BenchmarkResult(
        "Scordelis-Lo roof",
        mesh.mesh,
        options_of(element),
        sag,
        0.3024,
        MACNEAL_HARDER,
        SCORDELIS_LO.get(count) if element == AS_PUBLISHED else None,
    )


def pinched_cylinder(count: int, element: Element = AS_PUBLISHED) -> BenchmarkResult:
    """Cylinder with end diaphragms between two opposite forces; deflection under the force."""
    mesh = cylinder_sector(300.0, 300.0, 3.0, 0.5 * math.pi, count, count)
    model = isotropic_model(mesh, 3e6, 0.3, element)
    grid = mesh.grid
    held = mesh.held((grid[0], [X, Z]), (grid[-1], [Y]), (grid[:, -1], [X]), (grid[:, 0], [Z]))
    loads = mesh.pair_loads([grid[-1, -1]], [0.0, 0.0, -0.25])
    u = linear_solution(StaticProblem(model=model, held=held, forces=loads))
    return BenchmarkResult(
        "pinched cylinder",
        mesh.mesh,
        options_of(element),
        -mesh.middle(u, grid[-1, -1])[Z],
        1.82488e-5,
        "series solution, as in FinEtools",
        PINCHED_CYLINDER.get(count) if element == AS_PUBLISHED else None,
    )


def hemisphere(count: int, element: Element = AS_PUBLISHED) -> BenchmarkResult:
    """Hemisphere with an 18° hole under alternating radial forces at the equator."""
    mesh = hemisphere_quarter(10.0, 0.04, math.radians(18.0), count, count)
    model = isotropic_model(mesh, 6.825e7, 0.3, element)
    grid = mesh.grid
    held = mesh.held((grid[0], [Y]), (grid[-1], [X]))
    held[Z, grid[count // 2, 0]] = True  # one node: a pair would hold the rotation there too
    loads = mesh.pair_loads(grid[[0, -1], 0], [[1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
    u = linear_solution(StaticProblem(model=model, held=held, forces=loads))
    return BenchmarkResult(
        "hemisphere with an 18° hole",
        mesh.mesh,
        options_of(element),
        mesh.middle(u, grid[0, 0])[X],
        0.0940,
        MACNEAL_HARDER,
        HEMISPHERE.get(count) if element == AS_PUBLISHED else None,
    )
