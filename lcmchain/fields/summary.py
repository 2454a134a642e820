"""Numbers that sum a forming result up: fibre mass, extrema and forces."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from lcmchain.fields.between_plies import ContactOfFaces
from lcmchain.fields.dataset import HISTORY, SHEET
from lcmchain.fields.loads import has_histories, tool_loads
from lcmchain.fields.sheet import fibre_strains, node_areas, sheet_areas, vector
from lcmchain.fields.stack import film_names, plies_of
from lcmchain.fields.wrinkles import EXPECTED, RISK
from lcmchain.interfaces.in_frames import APART
from lcmchain.quantities.fields import FIELDS, LEAST, SIZE

if TYPE_CHECKING:
    import xarray as xr


def fibre_mass(sheet: xr.Dataset, frame: int = -1) -> float:
    """Return the fibre mass of the sheet [kg]: ``areal_fibre_mass`` times area, over all faces.

    A face has the area 4 |a1 × a2| at its centre, half the cross product of its diagonals, which
    is also the measure in ``areal_fibre_mass``: the mass is the initial one up to round-off.
    """
    return float(np.nansum(sheet["areal_fibre_mass"].values[frame] * sheet_areas(sheet, frame)))


def field_summary(
    datasets: Mapping[str, xr.Dataset], *, punch: str | None = None, frame: int = -1
) -> dict[str, Any]:
    """Return the extrema of a frame under the names of ``summary.json``.

    Parameters
    ----------
    datasets : groups of the result.
    punch : tool whose largest force is reported; by default the tool of that name, else the one
        with the longest travel.
    frame : saved frame, the last one by default.

    Returns
    -------
    The ``extrema`` of the fields (``thickness_min_m``; ``shear_angle_max_rad``, a magnitude, ...),
    ``fibre_strain_max`` (magnitude; of fibres that buckle in tension alone), ``wrinkle_risk_max``
    and ``wrinkle_risk_part``, the part of the area with a risk of at least 1, ``fibre_mass_kg``,
    ``fibre_mass_error`` (relative to the first frame), ``punch_force_max_N``, the largest mean over
    a twentieth of the process (of a result without histories, the largest of the frames), and with
    histories ``punch_force_quoted_N``, the figure to quote, ``punch_force_peak_N`` of a single
    step, ``punch``, which tool that is, and ``tool_loads``
    (:func:`lcmchain.fields.loads.tool_loads`); without those that the result does not have.
    """
    history = datasets[HISTORY]
    summary = _sheet_summary(datasets[SHEET], frame)
    if has_forces(history):
        summary |= _forces(history, datasets[SHEET], punch_index(history, punch))
    return summary


def _sheet_summary(sheet: xr.Dataset, frame: int) -> dict[str, Any]:
    """Return the extrema and the fibre mass of a sheet, or of all sheets of the root group."""
    last = sheet.isel(time=frame)
    # a sheet of a stack may lack a field that others have
    summary: dict[str, Any] = {}
    for name, field in FIELDS.items():
        for kind in field.extrema if name in last else ():
            summary[field.extremum(kind)] = _extremum(last[name], kind)
    if "areal_fibre_mass" in last:  # a film has no fibres
        mass = fibre_mass(sheet, frame)
        summary |= {
            "fibre_strain_max": float(np.nanmax(fibre_strains(last))),
            "fibre_mass_kg": mass,
            "fibre_mass_error": mass / fibre_mass(sheet, 0) - 1.0,
        }
    if RISK in last:
        risk = np.nan_to_num(last[RISK].values)  # nan on the films of a stack
        areas = sheet_areas(sheet, 0)
        summary["wrinkle_risk_max"] = float(risk.max())
        summary["wrinkle_risk_part"] = float(areas[risk >= EXPECTED].sum() / areas.sum())
    return summary


def _extremum(values: xr.DataArray, kind: str) -> float:
    """Return the least or most, or the largest magnitude, of what is a number."""
    if kind == SIZE:
        return float(np.abs(values).max())
    return float(values.min() if kind == LEAST else values.max())


def _forces(history: xr.Dataset, sheet: xr.Dataset, punch: int) -> dict[str, Any]:
    if not has_histories(history):
        return {"punch_force_max_N": float(tool_force_magnitude(history)[:, punch].max())}
    loads = tool_loads(history, sheet)
    of_punch = loads[str(history["tool"].values[punch])]
    return {
        "punch": str(history["tool"].values[punch]),
        "punch_force_max_N": of_punch["force_max_N"],
        "punch_force_quoted_N": of_punch["force_quoted_N"],
        "punch_force_peak_N": of_punch["force_peak_N"],
        "tool_loads": loads,
    }


def stack_summary(datasets: Mapping[str, xr.Dataset], *, frame: int = -1) -> dict[str, Any]:
    """Return the extrema of every ply and of the stack under the names of ``summary.json``.

    Parameters
    ----------
    datasets : groups of the result.
    frame : saved frame, the last one by default.

    Returns
    -------
    ``plies``, by name the entries of :func:`field_summary` that a ply has of its own, and
    ``stack`` with ``ply_count`` and names of ``films``, which count in none of the others,
    ``thickness_min_m``, ``thickness_max_m``, ``fibre_mass_kg`` and
    the largest fibre volume fraction: those of all plies over each other. Where plies touch both
    have ``ply_pressure_max_Pa``, ``slip_max_m``, ``slip_path_max_m`` and ``sliding_part``, and
    ``stack`` has ``ply_depth``, the largest depth of a node in another ply, of all frames. Nothing
    for one sheet.
    """
    sheets = {name: groups[SHEET] for name, groups in plies_of(datasets)}
    plies = {
        name: _sheet_summary(sheet, frame) | _between_plies([sheet], frame)
        for name, sheet in sheets.items()
    }
    if not plies:
        return {}
    last = datasets[SHEET].isel(time=frame)
    films = film_names(datasets[SHEET])
    stack: dict[str, Any] = {"ply_count": len(plies) - len(films)}
    if films:
        stack["films"] = list(films)
    if "stack_thickness" in last:
        thickness = last["stack_thickness"].where(last["stack_ply_count"] > 0)
        stack["thickness_min_m"] = float(thickness.min())
        stack["thickness_max_m"] = float(last["stack_thickness"].max())
    if "stack_fibre_volume_fraction" in last:
        stack["fibre_volume_fraction_max"] = float(last["stack_fibre_volume_fraction"].max())
    stack["fibre_mass_kg"] = sum(ply.get("fibre_mass_kg", 0.0) for ply in plies.values())
    stack |= _between_plies(list(sheets.values()), frame)
    stack |= _deepest_in_plies(sheets)
    return {"stack": stack, "plies": plies}


def _between_plies(sheets: Sequence[xr.Dataset], frame: int) -> dict[str, float]:
    """Return the largest pressure and slip between plies, on both faces of some of them.

    ``sliding_part`` is that of the area that touches another ply in the last step of the frame.
    """
    contact = ContactOfFaces()
    for sheet in sheets:
        if "ply_contact_top" not in sheet:
            continue
        area = node_areas(sheet, frame)
        for side in ("top", "bottom"):
            pressure, path, state = (
                sheet[f"{name}_{side}"].values[frame]
                for name in ("ply_pressure", "slip_path", "ply_contact")
            )
            contact.add(pressure, vector(sheet, f"slip_{side}", frame), path, state, area)
    return contact.measures()


def _deepest_in_plies(sheets: Mapping[str, xr.Dataset]) -> dict[str, Any]:
    """Return where a node is deepest in another ply that it touches, of all frames and faces.

    ``part`` is the depth over the initial thickness of the thinner ply. ``depth_m``, the ply of the
    node, the one that it is in, and the time come with it. A node without a force lies beside a rim
    and does not count.
    """
    thickness = {
        name: float(sheet["thickness"].values[0].max())
        for name, sheet in sheets.items()
        if "thickness" in sheet
    }
    deepest: dict[str, Any] = {}
    for name, sheet in sheets.items():
        for side in ("top", "bottom"):
            if f"ply_gap_{side}" not in sheet or name not in thickness:
                continue
            faced = sheet[f"faced_ply_{side}"]
            flags = np.atleast_1d(faced.attrs["flag_values"]).tolist()
            touches = sheet[f"ply_contact_{side}"].values != APART
            depth = np.where(touches, -sheet[f"ply_gap_{side}"].values, 0.0)
            for number, other in zip(flags, faced.attrs["flag_meanings"].split(), strict=True):
                if other not in thickness:
                    continue
                into = np.where(faced.values == number, np.nan_to_num(depth), 0.0)
                at, _ = np.unravel_index(np.argmax(into), into.shape)
                part = float(into.max()) / min(thickness[name], thickness[other])
                if part > deepest.get("part", -1.0):
                    deepest = {
                        "part": part,
                        "depth_m": float(into.max()),
                        "ply": name,
                        "into": other,
                        "time_s": float(sheet["time"].values[at]),
                    }
    return {"ply_depth": deepest} if deepest else {}


def has_forces(history: xr.Dataset) -> bool:
    """Tell whether there are tools whose forces are known."""
    return bool(np.isfinite(tool_force_magnitude(history)).any())


def punch_index(history: xr.Dataset, punch: str | None = None) -> int:
    """Return the tool called ``punch``, else the one with the longest travel.

    Where none travels it is the one that turns farthest.
    """
    names = [str(name) for name in history["tool"].values]
    if punch is not None:
        return names.index(punch)
    if "punch" in names:
        return names.index("punch")
    ways = np.abs(history["tool_travel"].values).max(axis=0)
    if not ways.any() and "tool_angle" in history:
        ways = np.abs(history["tool_angle"].values).max(axis=0)
    return int(np.argmax(ways))


def tool_force_magnitude(history: xr.Dataset) -> np.ndarray:
    """Return the magnitude of the force on each tool [N], shape (frame_count, tool_count)."""
    return np.linalg.norm(vector(history, "tool_force"), axis=-1)
