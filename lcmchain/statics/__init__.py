"""Quasi-static equilibrium of a sheet: Newton's method, arc length, linear analyses."""

from lcmchain.statics.arc_length import trace
from lcmchain.statics.control import StaticStep
from lcmchain.statics.forces import nodal_forces
from lcmchain.statics.linear import linear_frequencies, linear_solution
from lcmchain.statics.pair_system import PairSystem
from lcmchain.statics.problem import DirectorCouples, StaticProblem
from lcmchain.statics.steps import solve

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
