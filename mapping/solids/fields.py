"""Fields of solid cells that follow from the thickness of the solid itself."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from lcmchain.errors import InputError
from lcmchain.mapping.averages import contents_of_cells
from lcmchain.mapping.sheet import Sheet
from lcmchain.mapping.target import TargetMesh
from lcmchain.mapping.weights import MappingWeights

#: Attributes of the fields that a mapping onto solids adds.
ATTRIBUTES: dict[str, dict[str, Any]] = {
    "solid_thickness": {
        "units": "m",
        "long_name": "thickness of the solid mesh itself",
        "comment": "volume by area along the normals of the sheet, through all cells of a column",
    },
    "thickness_difference": {
        "units": "1",
        "long_name": "thickness of the solid mesh over that of the formed textile, minus one",
    },
}


def solid_scalars(
    sheet: Sheet,
    weights: MappingWeights,
    averages: Mapping[str, np.ndarray],
    density: float | None,
) -> dict[str, np.ndarray]:
    """Fields of solid cells in which the thickness of the solid counts, each of shape (C,).

    The fibre mass of a cell is what its part of the columns holds; by the cell's volume it is the
    fibre volume fraction, and times the thickness of the solid the areal mass. Both therefore
    sum to the mass of the covered sheet over the volume, or the area, of all cells. A cell that
    reaches beyond the sheet holds less, one that lies beyond it nothing.

    Parameters
    ----------
    averages : means of the fields over the cells; names that are not among them are not made.
    density : of the fibres [kg/m3]; where the faces do not agree on one, the fibre volume of each
        is that of its thickness and fibre volume fraction.
    """
    solid = np.where(weights.mapped, weights.solid_thickness, np.nan)
    found = {}
    if "thickness" in averages:
        formed = np.where(weights.mapped, averages["thickness"], np.nan)
        found = {
            "thickness": formed,
            "solid_thickness": solid,
            "thickness_difference": solid / formed - 1.0,
        }
    if "areal_fibre_mass" not in averages:
        return found
    mass = _contents(sheet, weights, sheet.scalars["areal_fibre_mass"])
    with np.errstate(invalid="ignore", divide="ignore"):  # of a cell without the ply
        found["areal_fibre_mass"] = mass / weights.cell_area
        if density is not None:
            found["fibre_volume_fraction"] = mass / (density * weights.cell_area * solid)
        elif {"fibre_volume_fraction", "thickness"} <= averages.keys():
            per_area = sheet.scalars["thickness"] * sheet.scalars["fibre_volume_fraction"]
            volume = _contents(sheet, weights, per_area)
            found["fibre_volume_fraction"] = volume / (weights.cell_area * solid)
    return found


def require_thickness(target: TargetMesh, fields: Mapping[str, np.ndarray], limit: float) -> None:
    """Refuse a solid that is thicker or thinner than the formed textile.

    Parameters
    ----------
    fields : mapped scalars, each of shape (C,).
    limit : largest relative difference of the thicknesses, 1.

    Raises
    ------
    InputError : names the worst cell, both thicknesses and what to do.
    """
    if "thickness_difference" not in fields:
        return
    formed, solid = fields["thickness"], fields["solid_thickness"]
    difference = np.abs(fields["thickness_difference"])
    difference = np.where(np.isfinite(difference), difference, 0.0)
    beyond = int(np.sum(difference > limit))
    if not beyond:
        return
    worst = int(np.argmax(difference))
    more = "thicker" if solid[worst] > formed[worst] else "thinner"
    own, wanted = (f"{1e3 * values[worst]:.3g} mm" for values in (solid, formed))
    raise InputError(
        f"the solid mesh is up to {100.0 * difference[worst]:.3g} % {more} than the formed textile "
        f"(cell {worst}: {own} against {wanted}; {beyond} of {target.cell_count} cells differ by "
        f"more than {100.0 * limit:.3g} %). Mesh the part with the formed thickness, {wanted} "
        "there, or raise thickness_limit on purpose: the fibre volume fraction is then that of the "
        "formed fibre mass in the thickness of the solid",
        file=target.file,
    )


def _contents(sheet: Sheet, weights: MappingWeights, per_area: np.ndarray) -> np.ndarray:
    """What each cell holds of a content per area of the faces, shape (C,); nan where unmapped."""
    return np.where(weights.mapped, contents_of_cells(sheet.surface, weights, per_area), np.nan)
