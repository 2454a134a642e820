"""Strong coupling of parts over fields: schemes, convergence, window size and history."""

from lcmchain.coupling.iteration.interface import (
    CoupledPart,
    Exchange,
    HasPlaces,
    PartFailed,
    Tolerance,
    fixed_stress_exchanges,
)

__all__ = [
    "CoupledPart",
    "Exchange",
    "HasPlaces",
    "PartFailed",
    "Tolerance",
    "fixed_stress_exchanges",
]
