"""Scene tables of infiltration: what fills, from where, through what, and when it ends.

::

    laws: permeability of the textile; viscosity, cure and temperature of the resin
    boundaries: gates and vents; what presses on the part (bag, tools at a gap, press)
        └──▶ case: Infiltration, with preform, regions, film, flow medium

They stand here and not in the package that computes the flow: that package is built on the core,
which holds the scene and never imports what is built on it.
"""

from lcmchain.scene.infiltration.boundaries import Gate, Vent
from lcmchain.scene.infiltration.case import (
    FlowMedium,
    Infiltration,
    OwnPermeability,
    Preform,
    RaceTrack,
    Region,
    ResinFilm,
)

__all__ = [
    "FlowMedium",
    "Gate",
    "Infiltration",
    "OwnPermeability",
    "Preform",
    "RaceTrack",
    "Region",
    "ResinFilm",
    "Vent",
]
