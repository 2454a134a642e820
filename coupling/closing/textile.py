"""The textile of a formed part as cells that are pressed: its law, thickness and present area."""

from __future__ import annotations

from typing import Any

import numpy as np

from lcmchain.coupling.infiltration.formed_part import FormedPart
from lcmchain.coupling.solids.compaction_law import CellCompaction
from lcmchain.coupling.solids.stack_compaction import PressedPly, StackCompaction
from lcmchain.errors import InputError
from lcmchain.mapping.plies import SHARE
from lcmchain.materials.features.pressure_table import PressureTable
from lcmchain.materials.features.shear_compaction import coupling_of, free_stretch
from lcmchain.materials.law import Material, couples_shear
from lcmchain.scene.reading.single_tables import formed_material, formed_plies

#: A ply that covers all of a cell but for rounding covers all of it.
WHOLE = 1.0 - 1e-9


def compaction_of(part: FormedPart) -> CellCompaction | StackCompaction:
    """Return the compaction law of a part's cells, that of the scene that formed it.

    A cell that was sheared has more fibres per area, and bears a pressure as a sheet of smaller
    area does. Plies of a stack have a law each. What laws remember of the forming (their permanent
    set) is not known here.

    Raises
    ------
    InputError : the file does not hold its scene, or has a ply that its scene does not have.
    """
    text = part.dataset.attrs.get("scene")
    if not text:
        raise InputError(
            "does not hold the scene that formed it, whose compaction law a closure needs; start "
            "from a forming result of lcmchain run, or a file mapped from one",
            file=part.file,
        )
    fraction, thickness = part.cell("fibre_volume_fraction"), part.cell("thickness")
    if part.ply_names:
        return _of_stack(part, str(text), thickness)
    material = at_rest(formed_material(str(text)))
    return of_cells(material, material.fibre_density * fraction * thickness)


def at_rest(table: Any) -> Any:
    """Return the law of a material's table that is only pressed: without shear, bending, rates."""
    for states, without in (
        ("resists_rates", "without_rates"),
        ("shear_rubs", "without_shear_friction"),
        ("bending_rubs", "without_bending_friction"),
        ("bending_resists_rates", "without_viscous_bending"),
    ):
        if getattr(table, states):
            table = getattr(table, without)()
    return table.build()


def _of_stack(part: FormedPart, text: str, thickness: np.ndarray) -> StackCompaction:
    """Return the law of plies on each other.

    Of a ply that covers a part of a cell of a mesh there is as much less in all of the cell: the
    mapping takes it for a ply that is thinner by that part.
    """
    tables = formed_plies(text)
    names = part.ply_names
    shares = np.stack([np.nan_to_num(part.cell(f"{SHARE}{name}")) for name in names])
    own = np.stack([part.cell(f"{name}_thickness") for name in names])
    cover = np.where(shares > 0.0, shares / own, 0.0)
    cover = cover / cover.max(axis=0)
    cover = np.where(cover >= WHOLE, 1.0, cover)
    plies = []
    for name, share, covered in zip(names, shares, cover, strict=True):
        if name not in tables:
            raise InputError(
                f'has the ply "{name}", but the scene in it has only {", ".join(tables)}; the '
                "compaction law of a ply is that of the scene: form the stack again",
                file=part.file,
            )
        cells = np.flatnonzero(covered > 0.0)
        material = at_rest(tables[name])
        fraction = part.cell(f"{name}_fibre_volume_fraction")
        areal_mass = material.fibre_density * fraction * share * thickness
        law = of_cells(material, areal_mass[cells], covered[cells])
        plies.append(PressedPly(name, law, cells))
    return StackCompaction(plies, len(thickness))


def of_cells(
    material: Material, areal_mass: np.ndarray, covered: np.ndarray | float = 1.0
) -> CellCompaction:
    """Return the law of cells with so many fibres (C,) [kg/m²], of which a sheet covers a part.

    Fibres that keep their length leave a sheared cell cos γ of its area. Where the thickness knows
    the shear, its law is that of a sheet that is thicker by 1/cos^β γ, on an area as much larger.
    A table does not scale like that: its law is asked at the shear of every cell.
    """
    area = material.areal_mass / areal_mass
    thicker, shear = np.ones(len(areal_mass)), None
    if couples_shear(material):
        shear = np.sqrt(np.maximum(1.0 - area**2, 0.0))
        thicker = free_stretch(material, shear)
    return CellCompaction(
        material,
        material.thickness * covered * thicker,
        area_stretch=covered * area * thicker,
        shear=shear if isinstance(coupling_of(material), PressureTable) else None,
    )
