"""Structural stage: from mapped fields to decks of CalculiX, and their results."""

from __future__ import annotations

from lcmchain.mapping.structure.chain import map_and_analyse
from lcmchain.mapping.structure.deck import require_places
from lcmchain.mapping.structure.report import StructureReport
from lcmchain.mapping.structure.solver import SolverError
from lcmchain.mapping.structure.stage import SolverOptions, analyse

__all__ = [
    "SolverError",
    "SolverOptions",
    "StructureReport",
    "analyse",
    "map_and_analyse",
    "require_places",
]
