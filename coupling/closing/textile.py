"""The textile of a formed part as cells that are pressed: its law, thickness and present area."""

from __future__ import annotations

import numpy as np

from lcmchain.coupling.infiltration.formed_part import FormedPart
from lcmchain.coupling.solids.compaction_law import CellCompaction
from lcmchain.errors import InputError
from lcmchain.scene.origin import formed_material


def compaction_of(part: FormedPart) -> CellCompaction:
    """Return the compaction law of a part's cells, that of the scene that formed it.

    A cell that was sheared has more fibres per area, and bears a pressure as a sheet of smaller
    area does. What laws remember of the forming (their permanent set) is not known here.

    Raises
    ------
    InputError : the file does not hold its scene, or the part is made of several sheets.
    """
    text = part.dataset.attrs.get("scene")
    if not text:
        raise InputError(
            "does not hold the scene that formed it, whose compaction law a closure needs; start "
            "from a forming result of lcmchain run, or a file mapped from one",
            file=part.file,
        )
    if part.ply_names:
        raise InputError(
            f"is a stack of {len(part.ply_names)} plies; a closure presses a single sheet, whose "
            "one compaction law tells how thick it becomes: leave the closure out",
            file=part.file,
        )
    material = formed_material(str(text)).build()
    fraction, thickness = part.cell("fibre_volume_fraction"), part.cell("thickness")
    areal_mass = material.fibre_density * fraction * thickness
    return CellCompaction(
        material,
        np.full(len(thickness), material.thickness),
        area_stretch=material.areal_mass / areal_mass,
    )
