"""Structural stage: from mapped fields to decks of CalculiX, and their results.

    mapped_file.py  plies of textile in every cell        mesh.py  nodes, elements and places
       ▼                                                     │
    stiffness.py ─▶ sections.py  material of every cell      │
       └───────────────┬─────────────────────────────────────┘
                       ▼
                    deck.py ─▶ calculix.py  runs it, reads what it leaves
                                  ▼
                    results.py  on cells and nodes, in netCDF and VTU
                    report.py  in numbers, and as a picture

stage.py does it from the mapped file, or from the forming result, to the report.
"""

from __future__ import annotations

from lcmchain.mapping.structure.calculix import SolverError
from lcmchain.mapping.structure.deck import require_places
from lcmchain.mapping.structure.report import StructureReport
from lcmchain.mapping.structure.stage import SolverOptions, analyse, map_and_analyse

__all__ = [
    "SolverError",
    "SolverOptions",
    "StructureReport",
    "analyse",
    "map_and_analyse",
    "require_places",
]
