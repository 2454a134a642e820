"""Fields of a forming unit between the elements and its interface."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from lcmchain.mapping.interface import Interface
from lcmchain.mesh.sheet_mesh import SheetMesh

#: Name of its file in the resources of a unit.
INTERFACE_FILE = "interface.nc"

#: What a patch holds the sum of; of all else it has the mean by area.
SUMMED = ("volume", "volume_rate", "volume_rate_slope", "area", "area_rate")


def interface_of(mesh: SheetMesh, count: int) -> Interface:
    """Return the interface of an undeformed blank: ``count`` patches, 0 for its elements.

    Raises
    ------
    InputError : fewer patches than the blank has loose pieces.
    """
    points = np.ascontiguousarray(mesh.mid_surface(mesh.node_positions))
    return Interface.of_mesh(points, mesh.sheet_faces, count)


def at_interface(interface: Interface, found: Mapping[str, Any], step: float) -> dict[str, Any]:
    """Return outputs with their fields brought from the elements to the patches.

    Sums are kept, and ``fluid_thickness`` stays volume over area, which its rate over the last
    ``step`` [s] follows.
    """
    if not interface.is_coarse:
        return dict(found)
    values = {
        name: _up(name, interface)(value) if np.ndim(value) == 1 else value
        for name, value in found.items()
    }
    if "fluid_thickness" in values and {"volume", "area"} <= values.keys():
        volume, area = values["volume"], values["area"]
        before = (volume - step * values["volume_rate"]) / (area - step * values["area_rate"])
        values["fluid_thickness"] = volume / area
        values["fluid_thickness_rate"] = (volume / area - before) / (step or 1.0)
    return values


def _up(name: str, interface: Interface) -> Callable[[np.ndarray], np.ndarray]:
    if name == "pore_resistance":  # of elements side by side, each with its part of the rate
        return lambda values: _side_by_side(values, interface)
    return interface.fields.total if name in SUMMED else interface.fields.mean


def _side_by_side(resistance: np.ndarray, interface: Interface) -> np.ndarray:
    acting = resistance > 0.0
    conductance = np.divide(1.0, resistance, out=np.zeros_like(resistance), where=acting)
    total = interface.fields.total(conductance)
    return np.divide(1.0, total, out=np.zeros_like(total), where=total > 0.0)
