"""Fields of a forming unit between the elements and its interface."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from lcmchain.coupling.solids.stack import largest_ply
from lcmchain.errors import InputError
from lcmchain.fmu.forming.variables import FLUID_OUTPUTS, PORE_PRESSURE
from lcmchain.fmu.variables import Outputs, quoted
from lcmchain.mapping.interface import Interface
from lcmchain.mesh.sheet_mesh import NO_NODE, SheetMesh

#: Fields of which a patch has the sum over its elements; of all others it has the mean by area.
SUMMED = ("volume", "volume_rate", "volume_rate_slope", "area", "area_rate")


def interface_of(meshes: Sequence[SheetMesh], count: int) -> Interface:
    """Return the interface of undeformed plies: ``count`` patches, 0 for their elements.

    Raises
    ------
    InputError : patches of several plies are asked for, or fewer than the blank has loose pieces.
    """
    sheets = [np.ascontiguousarray(mesh.mid_surface(mesh.node_positions)) for mesh in meshes]
    if len(meshes) == 1:
        return Interface.of_mesh(sheets[0], meshes[0].sheet_faces, count)
    if count:
        raise InputError(
            f"groups the elements of one sheet, but the scene names {len(meshes)} plies, whose "
            "fields are exchanged one by one; leave it out",
            key="--interface",
        )
    faces, first = [], 0
    for mesh, points in zip(meshes, sheets, strict=True):
        own = mesh.sheet_faces
        own = np.pad(own, ((0, 0), (0, 4 - own.shape[1])), constant_values=NO_NODE)
        faces.append(np.where(own == NO_NODE, NO_NODE, own + first))
        first += len(points)
    ply = np.repeat(np.arange(len(meshes)), [mesh.element_count for mesh in meshes])
    return Interface.of_mesh(np.concatenate(sheets), np.concatenate(faces), part=ply)


def faces_of_plies(names: Sequence[str], meshes: Sequence[SheetMesh]) -> dict[str, np.ndarray]:
    """Return the entry of every face of a stack, -1 without, of fields on a part of the faces.

    Fields of a ply are named by how their variables begin, those of a fluid by their names: it has
    one pressure in each column through the stack, on the faces of the largest ply. Of one sheet
    all fields lie on all faces.
    """
    if len(meshes) == 1:
        return {}
    counts = [mesh.element_count for mesh in meshes]
    ply, entry = (
        np.repeat(np.arange(len(meshes)), counts),
        np.concatenate([np.arange(count) for count in counts]),
    )
    faces = {f"{quoted(name)}.": np.where(ply == k, entry, -1) for k, name in enumerate(names)}
    columns = np.where(ply == largest_ply(meshes), entry, -1)
    return faces | dict.fromkeys((PORE_PRESSURE, *(f[0] for f in FLUID_OUTPUTS)), columns)


def at_interface(interface: Interface, outputs: Outputs, step: float) -> Outputs:
    """Return outputs with their fields brought from the elements to the patches.

    Sums are kept, and ``fluid_thickness`` stays volume over area, which its rate over the last
    ``step`` [s] follows.
    """
    if not interface.is_coarse:
        return outputs
    values = {
        name: _up(name, interface)(value)
        if isinstance(value, np.ndarray) and value.ndim == 1
        else value
        for name, value in outputs.items()
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
