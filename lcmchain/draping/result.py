"""The result of draping in the form of a forming run: datasets, and what a summary says."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from lcmchain.draping.courses import joints_of
from lcmchain.draping.drape import Draped
from lcmchain.draping.surface import ASKER, end_travel
from lcmchain.effects.effect import Effect
from lcmchain.fields import FrameSeries, LaidSheet, field_summary, laid_datasets
from lcmchain.fields.courses import course_field, gap_field
from lcmchain.fields.dataset import SHEET, SHEET_MESH
from lcmchain.fields.derived import derive_fields
from lcmchain.fields.sheet import COURSE, JOINT_GAP
from lcmchain.fields.wrinkles import LOCKING, RISK, nearness_of_locking
from lcmchain.judgements.fields import field_warnings
from lcmchain.scene import Scene
from lcmchain.tools.table import turning

if TYPE_CHECKING:
    import xarray as xr

#: Said of the face fields that a net does not know.
CONSTANT_VOLUME = (
    "kinematic draping: inextensible fibres; thickness t0/cos(shear angle) at constant volume, so "
    "that the fibre volume fraction stays that of the flat fabric"
)


def draped_datasets(scene: Scene, draped: Draped) -> dict[str, xr.Dataset]:
    """Return the groups of ``forming.nc``: the flat blank at time 0, draped at the process's end.

    The volume of the fabric does not change: the thickness grows as the area shrinks, t = t0 A0/A,
    which is t0/cos γ of inextensible fibres, and v_f stays v_f0. ``areal_fibre_mass`` gives v_f at
    any other thickness t, as in a closed mould: mass/(fibre density · t).

    Raises
    ------
    SimulationError : the net could not be laid to its end.
    """
    draped.require_whole()
    mesh, material = draped.mesh, scene.only_ply(ASKER).material.build()
    positions = np.stack([mesh.node_positions, draped.positions])
    areas = mesh.areas(positions)
    given = {"thickness": material.thickness * areas[0] / areas}
    if material.fibre_density is not None:
        fraction = material.areal_mass / (material.fibre_density * material.thickness)
        given["fibre_volume_fraction"] = np.full_like(areas, fraction)
    if scene.output.wrinkle_risk:  # of the parts a net knows this one
        angles = (draped.locking_angle,)
        risk = nearness_of_locking(derive_fields(mesh, material, positions), angles)
        given |= {RISK: risk, LOCKING: risk}
    frames = FrameSeries(
        time=np.array([0.0, scene.process.time]),
        positions=positions,
        tool_travel=_travels(scene, draped),
        tool_force=np.full((2, len(scene.tools), 3), np.nan),
        tool_names=tuple(tool.name for tool in scene.tools),
        tool_turns=turning(draped.tools),
    )
    attributes = {"state": "complete", "comment": CONSTANT_VOLUME}
    groups = laid_datasets(scene, LaidSheet(mesh, material), frames, given, attributes=attributes)
    if draped.courses:
        groups[SHEET] = _with_courses(groups[SHEET], draped)
    return groups


def _with_courses(sheet: xr.Dataset, draped: Draped) -> xr.Dataset:
    """Add the number of the course to every face, and the gap of the joints to their nodes."""
    gap = np.full((2, draped.mesh.node_count), np.nan)
    for joint in joints_of(draped.courses):
        gap[0, joint.nodes], gap[1, joint.nodes] = joint.nominal, joint.gap
    names = [net.name for net in draped.courses]
    course = SHEET_MESH.on_cells(*course_field(np.tile(draped.course_of_face, (2, 1)), names))
    joint_gap = SHEET_MESH.on_nodes(*gap_field(gap))
    return sheet.assign({COURSE: course, JOINT_GAP: joint_gap})


def draping_effect(draped: Draped) -> Effect:
    """Return what is computed, as one of the effects of a run."""
    nets = f"{len(draped.nets)} courses, each " if draped.courses else ""
    return Effect(
        "kinematic draping", True, f"{nets}a net of inextensible fibres on {draped.surface}"
    )


def draping_summary(scene: Scene, draped: Draped, datasets: dict[str, xr.Dataset]) -> dict:
    """Return what ``summary.json`` says of the draped fields, before any mapping."""
    found = {**field_summary(datasets)}
    return found | {
        "step_count": 0,
        "wall_s": draped.wall_s,
        "draping": draped_in_numbers(scene, draped),
        "warnings": field_warnings(datasets["/"], scene.only_ply(ASKER).material.build()),
        "mapping": {},
    }


def draped_in_numbers(scene: Scene, draped: Draped) -> dict[str, Any]:
    """Return seed, surface, start and locking of a net in plain values."""
    found = {
        "surface": draped.surface,
        "seed_m": draped.seed.tolist(),
        "seed_place_m": draped.place.tolist(),
        "pre_shear_rad": scene.draping.pre_shear,
        "steered": any(net.start.line is not None for net in draped.nets),
        "net_nodes": int(sum(net.net_status.size for net in draped.nets)),
        "locking_angle_rad": draped.locking_angle,
        "locked_part_of_area": draped.locked_part(),
    }
    if draped.courses:
        found["courses"] = [net.name for net in draped.courses]
        found["joints"] = [
            {
                "below": joint.below,
                "above": joint.above,
                "flat_gap_m": joint.nominal,
                "gap_min_m": None if joint.extremes is None else joint.extremes[0],
                "gap_max_m": None if joint.extremes is None else joint.extremes[1],
            }
            for joint in joints_of(draped.courses)
        ]
    return found


def locking_warnings(draped: Draped) -> list[str]:
    """Say how much of the sheet is sheared beyond the angle at which it counts as locked."""
    part = draped.locked_part()
    if part == 0.0:
        return []
    return [
        f"{part:.2%} of the area is sheared beyond {np.degrees(draped.locking_angle):.3g} deg "
        "(draping.locking_angle, else material.membrane.locking_angle, else 60 deg), where fabrics "
        "lock: they wrinkle or slip there, which a net cannot show"
    ]


def _travels(scene: Scene, draped: Draped) -> np.ndarray:
    """Return the travel of every tool at the start and at the end [m], (2, T).

    Tools that move under a load stay where they are: their travel is not known.
    """
    count = len(scene.tools)
    times = (0.0, scene.process.time)
    return np.array(
        [[end_travel(draped.tools, tool, time) for tool in range(count)] for time in times]
    ).reshape(2, count)
