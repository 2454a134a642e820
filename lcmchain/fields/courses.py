"""Names of what a result tells of a ply that is laid in several courses."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import xarray as xr

#: Variables of the sheet: number of the course of a face, and gap of a node on a joint [m].
COURSE, JOINT_GAP = "course", "joint_gap"


def course_names(sheet: xr.Dataset) -> tuple[str, ...]:
    """Return the names of the courses of a sheet, by their number; empty without courses."""
    return tuple(sheet[COURSE].attrs["flag_meanings"].split()) if COURSE in sheet else ()
