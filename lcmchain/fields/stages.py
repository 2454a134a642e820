"""Stages of the process in a result: the stage of each frame, and the springback."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import accumulate
from typing import TYPE_CHECKING, Any

import numpy as np

from lcmchain.fields.netcdf_file import ROOT
from lcmchain.fields.saved import HISTORY
from lcmchain.fields.sheet import sheet_positions
from lcmchain.fields.ugrid import TIME, UgridMesh, Variable
from lcmchain.quantities.fields import FIELDS
from lcmchain.scene.stages import plies_there, stage_at
from lcmchain.state import REST_LEFT, REST_PEAK, REST_SCALE, REST_STOPS, REST_TIME

if TYPE_CHECKING:
    import xarray as xr

    from lcmchain.model import Model
    from lcmchain.scene import Scene
    from lcmchain.state import State

#: Variables of the group ``/history``: of every frame, and of every stage.
STAGE, STAGE_NAME, STAGE_END = "stage", "stage_name", "stage_end"


def with_stages(scene: Scene, datasets: dict[str, xr.Dataset]) -> dict[str, xr.Dataset]:
    """Return the groups of ``forming.nc`` with their stages; as they are without any.

    ``/history`` gets ``stage``, the number of the stage of each frame, and the end of every stage.
    A frame at the border of two stages belongs to the first one. Sheets that were there before a
    stage that ends at rest get its ``springback``.
    """
    if not scene.stages:
        return datasets
    history = datasets[HISTORY].copy()
    names = [stage.name for stage in scene.stages]
    times = history[TIME].values
    numbers = np.array([stage_at(scene, time) for time in times])
    history[STAGE] = stage_variable((TIME,), numbers, names)
    history[STAGE_NAME] = STAGE_NAME, np.array(names), {"long_name": "name of the stage"}
    ends = np.array(list(accumulate(stage.time for stage in scene.stages)))
    history[STAGE_END] = STAGE_NAME, ends, {"units": "s", "long_name": "end of the stage"}
    groups = {**datasets, HISTORY: history}
    closed = _frame_before_rest(scene, times)
    if closed is None:
        return groups
    there = plies_there(scene, times[[closed]])
    waiting = [name for name, is_there in there.items() if not is_there[0]]
    for name, group in datasets.items():
        mesh = _mesh_of(group)
        # a ply that is laid down afterwards had no shape then, nor had the sheet of all plies
        if waiting and name.strip("/") in ("", *waiting):
            continue
        if mesh is not None:
            groups[name] = _with_springback(group, mesh, closed)
    return groups


def stage_variable(
    dimensions: tuple[str, ...], numbers: np.ndarray, names: Sequence[str]
) -> Variable:
    """Return the numbers of stages as a variable that says their names."""
    attributes: dict[str, Any] = {
        "long_name": "stage of the process",
        "flag_values": np.arange(len(names), dtype=np.int8),
        "flag_meanings": " ".join(names),
    }
    return dimensions, numbers.astype(np.int8), attributes


def _frame_before_rest(scene: Scene, times: np.ndarray) -> int | None:
    """Return the frame from which springback is measured; None before the sheet is released."""
    borders = [0.0, *accumulate(stage.time for stage in scene.stages)]
    resting = [number for number, stage in enumerate(scene.stages) if stage.rest]
    if not resting or times[-1] <= borders[resting[-1]] * (1.0 + 1e-9):
        return None
    closed, names = scene.stages[resting[-1]].springback_from, [s.name for s in scene.stages]
    end = borders[resting[-1] if closed is None else names.index(closed) + 1]
    return int(np.searchsorted(times, end + 1e-9 * borders[-1], side="right")) - 1


def _mesh_of(group: xr.Dataset) -> str | None:
    """Return the name of the mid-surface of a group of a sheet, None for any other group."""
    for name, variable in group.variables.items():
        if variable.attrs.get("cf_role") == "mesh_topology":
            return str(name) if variable.attrs.get("topology_dimension") == 2 else None
    return None


def _with_springback(group: xr.Dataset, mesh: str, closed: int) -> xr.Dataset:
    before = sheet_positions(group, closed)
    values = np.zeros(group["displacement_x"].shape)
    for frame in range(closed + 1, len(values)):
        values[frame] = springback(before, sheet_positions(group, frame))
    group = group.copy()
    group["springback"] = UgridMesh(mesh).on_nodes(
        values, FIELDS["springback"].attributes("springback")
    )
    return group


def springback(before: np.ndarray, after: np.ndarray) -> np.ndarray:
    """Return how far points have moved, without the motion of all of them as a rigid body.

    Parameters
    ----------
    before, after : (n, 3) [m].

    Returns
    -------
    (n,) [m], for the rigid motion with the least sum of their squares (Kabsch 1976).
    """
    start, end = before - before.mean(axis=0), after - after.mean(axis=0)
    left, _, right = np.linalg.svd(start.T @ end)
    turn = np.diag([1.0, 1.0, np.sign(np.linalg.det(left @ right))])
    return np.linalg.norm(start @ left @ turn @ right - end, axis=1)


def stage_summary(model: Model, state: State, datasets: Mapping[str, xr.Dataset]) -> dict[str, Any]:
    """Return what ``summary.json`` says of stages; nothing without any.

    Returns
    -------
    ``stages``: of every stage that has begun ``name``, ``start_s``, ``end_s`` and the ``tools`` at
    work; where plies are laid down later the ``plies`` that are there; of one that ends at rest
    ``rest`` with ``reached_s``, when it was reached, or None, ``energy_part``, the last peak of the
    kinetic energy over what was stored (of a swing that the stage has cut off, no less than the
    peak before it), ``wanted``, the part below which the sheet is at rest, ``stops``, and whether
    the stage ``ended``.
    ``springback_max_m``, ``springback_mean_m`` of the last frame, where there is one.
    """
    if not model.stages:
        return {}
    entries = []
    for number, stage in enumerate(model.stages[: model.stage + 1]):
        entry: dict[str, Any] = {
            "name": stage.name,
            "start_s": stage.start,
            "end_s": min(stage.end, state.time),
            "tools": [name for name, works in zip(model.tool_names, stage.tools_at_work) if works],
        }
        if stage.absent is not None:
            entry["plies"] = [b.name for b in model.bodies if not stage.absent[b.first_node]]
        if stage.rest_energy is not None:
            rest = state.rest[number]
            reached = float(rest[REST_TIME])
            peak = float(rest[REST_PEAK])
            if reached == 0.0:  # the swing since the last stop is not over
                peak = max(peak, float(rest[REST_LEFT]))
            entry["rest"] = {
                "reached_s": reached if reached > 0.0 else None,
                "energy_part": peak / float(rest[REST_SCALE]) if rest[REST_SCALE] > 0.0 else None,
                "wanted": stage.rest_energy,
                "stops": int(rest[REST_STOPS]),
                "ended": bool(state.time >= stage.end * (1.0 - 1e-12)),
            }
        entries.append(entry)
    summary: dict[str, Any] = {"stages": entries}
    root = datasets[ROOT]
    if "springback" in root:
        last = root["springback"].values[-1]
        summary["springback_max_m"] = float(np.nanmax(last))
        summary["springback_mean_m"] = float(np.nanmean(last))
    return summary


def last_frames(history: xr.Dataset) -> list[tuple[str, int]]:
    """Return the name of every stage that has frames, and the last one of them."""
    if STAGE not in history:
        return []
    of_frames = history[STAGE].values
    names = [str(name) for name in history[STAGE_NAME].values]
    last = []
    for number, name in enumerate(names):
        frames = np.flatnonzero(of_frames == number)
        if frames.size:
            last.append((name, int(frames[-1])))
    return last


def borders(history: xr.Dataset) -> list[tuple[str, float]]:
    """Return the name of every stage and its end [ms]; nothing without stages."""
    if STAGE not in history:
        return []
    ends = 1e3 * history[STAGE_END].values
    return [(str(name), float(end)) for name, end in zip(history[STAGE_NAME].values, ends)]
