"""Strong coupling of parts over fields: schemes, convergence, window size and history.

::

    parts, exchanges ─▶ sweep: answers ─▶ attempt: do they agree? ─▶ system: next window ─▶ history
                          ▲                      │ not yet
                          └── schemes: inputs ◀──┘

- ``interface`` : what a part offers (:class:`CoupledPart`), what two parts exchange
  (:class:`Exchange`), and when it counts as converged.
- ``sweep`` : one evaluation of all parts over a window.
- ``schemes`` : the order of the parts, and how the next inputs follow from their answers.
- ``attempt`` : evaluates the parts until all fields agree, or says which does not.
- ``system`` : advances in windows of time. It is a part itself, so that systems nest.
- ``history`` : all iterations and windows as data, ``plot`` : their picture. ``checkpoint`` : saved
  states in a file.
- ``consolidation`` : Terzaghi's column as two parts, the standard problem. On it ``study`` compares
  the schemes over stiffness and permeability, and ``hard_cases`` checks them.
"""

from lcmchain.coupling.iteration.attempt import NotConverged, NotSettled
from lcmchain.coupling.iteration.history import History
from lcmchain.coupling.iteration.interface import (
    CoupledPart,
    Exchange,
    HasPlaces,
    Jumps,
    PartFailed,
    Port,
    Tolerance,
    fixed_stress_exchanges,
)
from lcmchain.coupling.iteration.schemes import (
    Scheme,
    aitken,
    fixed_point,
    gauss_seidel,
    iqn_ils,
    iqn_mvj,
    jacobi,
)
from lcmchain.coupling.iteration.system import CoupledSystem, WindowControl

__all__ = [
    "CoupledPart",
    "CoupledSystem",
    "Exchange",
    "HasPlaces",
    "History",
    "Jumps",
    "NotConverged",
    "NotSettled",
    "PartFailed",
    "Port",
    "Scheme",
    "Tolerance",
    "WindowControl",
    "aitken",
    "fixed_point",
    "fixed_stress_exchanges",
    "gauss_seidel",
    "iqn_ils",
    "iqn_mvj",
    "jacobi",
]
