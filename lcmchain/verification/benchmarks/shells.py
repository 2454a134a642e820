"""Curved shells in linear theory: Scordelis-Lo roof, pinched cylinder, hemisphere with a hole."""

from __future__ import annotations

import math

import numpy as np

from lcmchain.scene import Element
from lcmchain.statics import StaticProblem, linear_solution
from lcmchain.verification.benchmarks.meshes import (
    AS_PUBLISHED,
    X,
    Y,
    Z,
    cylinder_sector,
    hemisphere_quarter,
    isotropic_model,
    options_of,
)
from lcmchain.verification.benchmarks.result import BenchmarkResult

MACNEAL_HARDER = "MacNeal, Harder 1985"

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
