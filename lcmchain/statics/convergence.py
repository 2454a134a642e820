"""When an iteration has found equilibrium: the state of balance, and the two conditions on it.

Forces: what is out of balance is small beside loads and reactions, or no more than the round-off of
the internal forces, below which no iteration gets. Energy: the last correction did little work
beside the first one of the step or, where a small step starts within the tolerance already, beside
the work of all forces so far or that of the round-off. Each condition alone can deceive: a soft
sheet moves far under a small force, a stiff one stands still under a large one.

Round-off is measured. Internal forces do not depend on where the sheet is, so those of the same
shape moved aside differ by nothing else. In thin sheets it is far above the machine's precision:
the thickness is a small difference of large coordinates.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from lcmchain.statics.forces import nodal_forces
from lcmchain.statics.pair_system import PairSystem
from lcmchain.statics.problem import StaticProblem

# Out-of-balance force over loads and reactions.
FORCE_TOLERANCE = 1e-6
# Energy of the last correction over that of the first one of the step.
ENERGY_TOLERANCE = 1e-8
# Energy of the last correction over the work of all forces: 1e-6 of the displacements.
WORK_TOLERANCE = 1e-12
# Out-of-balance forces up to this multiple of the measured round-off are taken for round-off.
ROUND_OFF_MARGIN = 2.0
# By how much of its size the sheet is moved aside to measure it: no round numbers.
ASIDE = np.array([[0.371], [0.613], [-0.437]])


class Balance(NamedTuple):
    """Forces of a state and what they are measured by.

    residual : (3, node_count) loads less internal forces [N]; at supports less their reaction.
    free : norm of its part on the unknowns [N]; scale : norms of loads and reactions [N].
    round_off : norm of the round-off of the internal forces on the unknowns [N].
    work : of all forces on the displacements, without regard to signs [J].
    """

    residual: np.ndarray
    free: float
    scale: float
    round_off: float
    work: float

    @property
    def relative(self) -> float:
        """Out-of-balance force over loads and reactions; 0 without any."""
        return self.free / self.scale if self.scale else 0.0

    @property
    def within_round_off(self) -> bool:
        return self.free <= ROUND_OFF_MARGIN * self.round_off


def balance(
    problem: StaticProblem, system: PairSystem, displacement: np.ndarray, factor: float, size: float
) -> Balance:
    """Return the balance of forces of a displacement (3, node_count) [m] at a load factor.

    ``size`` [m] is that of the sheet.
    """
    external = factor * problem.external_forces(displacement)
    internal = nodal_forces(problem.model, displacement)
    aside = nodal_forces(problem.model, displacement + size * ASIDE)
    residual = external - internal
    return Balance(
        residual,
        free=float(np.linalg.norm(system.reduce(residual))),
        scale=float(np.linalg.norm(external) + np.linalg.norm(residual)),
        round_off=float(np.linalg.norm(system.reduce(aside - internal))),
        work=float(abs(internal * displacement).sum()),
    )


def in_equilibrium(
    after: Balance,
    correction: np.ndarray,
    energy: float,
    first_energy: float,
    force_tolerance: float,
) -> bool:
    """Tell whether a correction has led to equilibrium.

    Parameters
    ----------
    after : balance that it led to.
    correction : of the unknowns.
    energy, first_energy : work of the forces that were out of balance on this correction and on the
        first one of the step [J].
    force_tolerance : of the out-of-balance force over loads and reactions.
    """
    if not (after.free <= force_tolerance * after.scale or after.within_round_off):
        return False
    least_energy = ROUND_OFF_MARGIN * after.round_off * np.linalg.norm(correction)
    return bool(
        energy <= ENERGY_TOLERANCE * first_energy
        or energy <= WORK_TOLERANCE * after.work
        or energy <= least_energy
    )
