"""Quasi-static equilibrium of a sheet of the elements that the explicit solver has.

    StaticProblem ─────▶ linear: PairSystem ─┬─▶ linear_solution, linear_frequencies
    (supports, loads)    (unknowns, tangent) └─▶ newton: equilibrium at a load factor
                                                   └─▶ paths: solve (load steps), trace (arcs)

Files are named after these; ``problem.py`` also has the one call of the compiled element kernel.
"""

from lcmchain.statics.linear import PairSystem, linear_frequencies, linear_solution
from lcmchain.statics.paths import StaticStep, solve, trace
from lcmchain.statics.problem import DirectorCouples, StaticProblem, nodal_forces

__all__ = [
    "DirectorCouples",
    "PairSystem",
    "StaticProblem",
    "StaticStep",
    "linear_frequencies",
    "linear_solution",
    "nodal_forces",
    "solve",
    "trace",
]
