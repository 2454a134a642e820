"""Where a result leaves what fibres, material law and the contact with tools allow, in words."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from lcmchain.effects.contact_depth import nominal_pressure
from lcmchain.fields.sheet import sheet_areas, sheet_faces, sheet_positions
from lcmchain.materials.features.pressure_table import PressureTable
from lcmchain.materials.features.shear_compaction import coupling_of
from lcmchain.materials.law import Material
from lcmchain.quantities.readable import millimetres
from lcmchain.thresholds import LARGEST_HIDDEN_FORCE, LARGEST_HIDDEN_THICKNESS
from lcmchain.tools.distance import gaps
from lcmchain.tools.table import yields

if TYPE_CHECKING:
    import xarray as xr

    from lcmchain.model import Model
    from lcmchain.solver.simulation import Snapshot


# --- fibres and material law ----------------------------------------------------------------------


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


# --- what the depth of nodes in the tools hides of the compaction ---------------------------------
# Two tools that close to a gap leave a sheet thicker by the depths of its nodes in both of them. A
# law of compaction that stiffens turns a few hundredths of the thickness into a large part of the
# pressure. Tools that a force guides are left out: under a given force the thickness does not
# depend on how deep they stand.


def hidden_compaction(model: Model, snapshots: Sequence[Snapshot]) -> dict[str, float]:
    """Return what depths hide in the frame in which the sheet between tools is pressed most.

    Returns
    -------
    ``hidden_thickness_part`` : by how much the sheet between tools is too thick, in parts of its
    thickness, weighted with the pressure. ``hidden_force_part`` : by how much the force over its
    thickness would be larger without the depths, by the law of the material, in parts of it. Both
    are absent where no frame has a sheet between two tools with prescribed motions.
    """
    tools = np.flatnonzero(~yields(model.tools)).tolist()
    bodies = [body for body in model.bodies if body.mesh.has_thickness]
    if len(tools) < 2 or not bodies:
        return {}
    force, found = 0.0, {}
    for snapshot in snapshots:
        depth = _depths(model, tools, snapshot)
        for body in bodies:
            pressed, measures = _of_body(body, snapshot.position, depth)
            if pressed > force:
                force, found = pressed, measures
    return found


def _depths(model: Model, tools: Sequence[int], snapshot: Snapshot) -> np.ndarray:
    """Return how deep nodes with contact lie in their tool (node_count,) [m], -inf for the others.

    Depths that are driven to zero lie on both sides of it.
    """
    depth, at_work = np.full(model.node_count, -np.inf), model.tools_at_work(snapshot.time)
    for tool in tools:
        if not at_work[tool]:
            continue
        travel = float(snapshot.tool_travel[tool])
        gap = gaps(model.tools, tool, snapshot.position, travel)
        gap -= model.nodes.offset - model.tools.initial_overlap[tool]
        depth = np.maximum(depth, -gap)
    return np.where(snapshot.contact_force > 0.0, depth, -np.inf)


def _of_body(body: Any, positions: np.ndarray, depth: np.ndarray) -> tuple[float, dict]:
    """Return the force over the thickness between tools [N], and what depths hide of it."""
    elements = body.mesh.elements + body.first_node
    bottom, top = depth[elements[:, :4]], depth[elements[:, 4:]]
    at_rest = body.material.thickness
    # A node further away than that is pushed by another tool: one that a force guides.
    least = -0.5 * at_rest
    between = (bottom > least).all(axis=1) & (top > least).all(axis=1)
    if not between.any():
        return 0.0, {}
    corners = positions[elements[between]]
    area, thickness = _area_and_thickness(corners)
    hidden = bottom[between].mean(axis=1) + top[between].mean(axis=1)
    pressure = nominal_pressure(body.material, thickness / at_rest)
    truly = nominal_pressure(body.material, (thickness - hidden) / at_rest)
    force = float(area @ pressure)
    if not force > 0.0:
        return 0.0, {}
    return force, {
        "hidden_thickness_part": float((area * pressure) @ (hidden / thickness)) / force,
        "hidden_force_part": float(area @ truly) / force - 1.0,
    }


def _area_and_thickness(corners: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return area [m²] and thickness [m] of elements (count, 8, 3) at their centres."""
    middle = 0.5 * (corners[:, :4] + corners[:, 4:])
    normal = 0.5 * np.cross(middle[:, 2] - middle[:, 0], middle[:, 3] - middle[:, 1])
    area = np.linalg.norm(normal, axis=1)
    director = corners[:, 4:].mean(axis=1) - corners[:, :4].mean(axis=1)
    return area, np.einsum("ei,ei->e", director, normal) / area


def hidden_compaction_warnings(summary: Mapping[str, Any]) -> Iterator[str]:
    """Say where the pressure between tools is not that of the law at their gap."""
    thickness = summary.get("hidden_thickness_part", 0.0)
    force = summary.get("hidden_force_part", 0.0)
    if thickness > LARGEST_HIDDEN_THICKNESS or force > LARGEST_HIDDEN_FORCE:
        yield hidden_text(thickness, force) + '; set contact.depth = "zero"'


def hidden_text(thickness: float, force: float) -> str:
    """Say how much of thickness and force the depths in the tools hide."""
    return (
        f"between tools the sheet is {100.0 * thickness:.2g} % too thick, and at their gap the law "
        f"gives {100.0 * force:.2g} % more pressure, since nodes reach into the tools"
    )
