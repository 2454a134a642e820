"""Pressures in and on a sheet, as one interaction of the time loop.

The pressure of a fluid in the pores (:mod:`lcmchain.effects.pore_pressure`) and those on the faces
(:mod:`lcmchain.effects.face_pressure`) write to one array of loads on the corners of the elements;
the nodes sum them up once. In a stack the fluid has one pressure in each column through all plies.
"""

from __future__ import annotations

from typing import NamedTuple

from lcmchain.effects.face_pressure import FacePressure, RegionalPressure
from lcmchain.effects.pore_pressure import PoreColumns
from lcmchain.elements.pressed_elements import PressedElements


class PorePressures(NamedTuple):
    """Pressures in the pores alone."""

    pore: PressedElements


class FacePressures(NamedTuple):
    """Pressures on the faces alone."""

    face: FacePressure | RegionalPressure


class BothPressures(NamedTuple):
    """Pressures in the pores and on the faces."""

    pore: PressedElements
    face: FacePressure | RegionalPressure


class ColumnPressures(NamedTuple):
    """Pressures in the columns of a stack alone."""

    pore: PressedElements
    columns: PoreColumns


class ColumnAndFacePressures(NamedTuple):
    """Pressures in the columns of a stack and on its faces."""

    pore: PressedElements
    columns: PoreColumns
    face: FacePressure | RegionalPressure


Pressures = PorePressures | FacePressures | BothPressures | ColumnPressures | ColumnAndFacePressures


def pressures_of(
    pore: PressedElements | None,
    columns: PoreColumns | None,
    face: FacePressure | RegionalPressure | None,
) -> Pressures | None:
    """Return the interaction of a model's pressures, or None without any."""
    if pore is not None and columns is not None:
        if face is None:
            return ColumnPressures(pore, columns)
        return ColumnAndFacePressures(pore, columns, face)
    if pore is not None:
        return PorePressures(pore) if face is None else BothPressures(pore, face)
    return None if face is None else FacePressures(face)
