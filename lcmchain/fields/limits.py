"""Where the fields of a result leave what fibres and material law allow, in words."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from lcmchain.fields.sheet import sheet_areas, sheet_faces, sheet_positions
from lcmchain.materials.law import Material
from lcmchain.materials.pressure_table import PressureTable
from lcmchain.materials.shear_compaction import coupling_of
from lcmchain.quantities.places import millimetres

if TYPE_CHECKING:
    import xarray as xr

#: Fibre volume fraction above which round fibres can hardly be packed (hexagonal: 0.907).
LARGEST_FIBRE_VOLUME_FRACTION = 0.9


def packing_warnings(sheet: xr.Dataset, material: Material) -> list[str]:
    """Say where fibres were packed more densely than they can be, in any frame.

    A sheet without a thickness is taken with its initial one.
    """
    if material.fibre_density is None:
        return []
    if "fibre_volume_fraction" in sheet:
        fraction = sheet["fibre_volume_fraction"].values
    else:
        full = material.fibre_density * material.thickness
        fraction = sheet["areal_fibre_mass"].values / full
    over = np.any(fraction > LARGEST_FIBRE_VOLUME_FRACTION, axis=0)
    if not over.any():
        return []
    frame, worst = map(int, np.unravel_index(np.argmax(fraction), fraction.shape))
    angle = np.degrees(np.abs(sheet["shear_angle"].values[frame, worst]))
    thickness = (
        f"thickness {1e3 * sheet['thickness'].values[frame, worst]:.3f} mm"
        if "thickness" in sheet
        else "at the initial thickness"
    )
    return [
        f"the fibre volume fraction exceeds {LARGEST_FIBRE_VOLUME_FRACTION:g} in "
        f"{_share(sheet, over)}, up to {fraction[frame, worst]:.2f} {_where(sheet, frame, worst)} "
        f"(shear angle {angle:.1f} deg, {thickness}), more than fibres can "
        "be packed to: the compaction law does not know the shear"
    ]


def shear_range_warnings(sheet: xr.Dataset, material: Material) -> list[str]:
    """Say where the sheet was sheared beyond the range in which its law was measured."""
    if material.shear_range is None:
        return []
    angle = np.abs(sheet["shear_angle"].values)
    over = (angle > material.shear_range).any(axis=0)
    if not over.any():
        return []
    frame, worst = map(int, np.unravel_index(np.argmax(angle), angle.shape))
    return [
        f"the shear angle exceeds {np.degrees(material.shear_range):.3g} deg, up to which the "
        f"shear law was measured, in {_share(sheet, over)}, up to "
        f"{np.degrees(angle[frame, worst]):.1f} deg {_where(sheet, frame, worst)}: the law is "
        "extrapolated there, and neither the angle nor force, thickness and wrinkles that depend "
        "on it rest on a test; measure further, or state where the fabric locks "
        "(material.membrane.locking_angle)"
    ]


def compaction_range_warnings(sheet: xr.Dataset, material: Material) -> list[str]:
    """Say where the sheet left the table by which its shear and compaction are coupled."""
    table = coupling_of(material)
    if not isinstance(table, PressureTable) or "thickness" not in sheet:
        return []
    angle = np.abs(sheet["shear_angle"].values)
    stretch = sheet["thickness"].values / material.thickness
    sheared = angle > table.last_angle
    over = (sheared | table.beyond(stretch, np.sin(angle))).any(axis=0)
    if not over.any():
        return []
    return [
        f"{_share(sheet, over)} left the table of material.compaction.table, which ends at "
        f"{np.degrees(table.last_angle):.3g} deg of shear and {table.thinnest:.3g} of the free "
        f"thickness: {_share(sheet, sheared.any(axis=0))} by the shear, up to "
        f"{np.degrees(angle.max()):.1f} deg. Pressures are extrapolated there; measure further"
    ]


def _share(sheet: xr.Dataset, over: np.ndarray) -> str:
    """Return how many elements and how much of the undeformed area, in words."""
    areas = sheet_areas(sheet, 0)
    count = int(over.sum())
    elements = "element" if count == 1 else "elements"
    return f"{count} {elements} ({areas[over].sum() / areas.sum():.2%} of the area)"


def _where(sheet: xr.Dataset, frame: int, element: int) -> str:
    corners = np.unique(sheet_faces(sheet)[element])
    place = millimetres(sheet_positions(sheet, frame)[corners].mean(axis=0), 1)
    time = 1e3 * float(sheet["time"].values[frame])
    return f"in element {element} at {place} at {time:.4g} ms"
