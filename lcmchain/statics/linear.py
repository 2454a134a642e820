"""Linear analyses of a sheet: small displacements and natural frequencies."""

from __future__ import annotations

import numpy as np
from scipy.sparse.linalg import LinearOperator, eigsh

from lcmchain.elements.solid_shell.tangent import linearise
from lcmchain.model import Model
from lcmchain.statics.pair_system import PairSystem
from lcmchain.statics.problem import StaticProblem, require_supports


def linear_solution(problem: StaticProblem) -> np.ndarray:
    """Return the displacement (3, node_count) [m] of the linear theory at load factor 1."""
    system = PairSystem(problem.model, problem.held, problem.held_middle)
    start = np.zeros((3, problem.model.node_count))
    K = system.assemble(linearise(problem.model, start).stiffness)
    right = system.reduce(problem.external_forces(start))
    right = right - system.reduced_product(K, problem.prescribed)
    return system.expand(system.factorise(K).solve(right)) + problem.prescribed


def linear_frequencies(model: Model, held: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the lowest natural frequencies (count,) [Hz] and modes (count, 3, node_count).

    Masses are lumped at the nodes; ``held`` (3, node_count) are the supports.

    Raises
    ------
    InputError : supports that let the sheet move rigidly.
    """
    require_supports(model, held)
    system = PairSystem(model, held)
    K = system.assemble(linearise(model, np.zeros((3, model.node_count))).stiffness)
    factors = system.factorise(K)
    M = system.reduced_mass(model.nodes.mass)
    solver = LinearOperator(M.shape, matvec=factors.solve)
    K = system.reduced(K)
    start = np.ones(M.shape[0])  # not the random one: repeated runs give the same digits
    squares, shapes = eigsh(K, count, M=M, sigma=0.0, OPinv=solver, v0=start)
    order = np.argsort(squares)
    modes = np.array([system.expand(shape) for shape in shapes.T[order]])
    return np.sqrt(squares[order]) / (2.0 * np.pi), modes
