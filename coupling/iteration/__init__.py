"""Strong coupling of parts over fields: schemes, convergence, window size and history."""

from lcmchain.coupling.iteration.failure import NotConverged, NotSettled
from lcmchain.coupling.iteration.history import History
from lcmchain.coupling.iteration.interface import (
    CoupledPart,
    Exchange,
    HasPlaces,
    Jumps,
    PartFailed,
    Tolerance,
    fixed_stress_exchanges,
)
from lcmchain.coupling.iteration.ports import Port
from lcmchain.coupling.iteration.schemes import (
    Scheme,
    aitken,
    fixed_point,
    gauss_seidel,
    iqn_ils,
    iqn_mvj,
    jacobi,
)
from lcmchain.coupling.iteration.system import CoupledSystem
from lcmchain.coupling.iteration.windows import WindowControl

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
