"""Straight and twisted cantilevers in linear theory, MacNeal and Harder (1985)."""

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
