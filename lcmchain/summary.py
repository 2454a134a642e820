"""What ``summary.json`` says about a finished forming run; other reports take it from here."""

from __future__ import annotations

import math
import os
import socket
from collections.abc import Mapping, Sequence
from datetime import datetime
from itertools import accumulate
from typing import TYPE_CHECKING, Any

import numpy as np

from lcmchain import __version__
from lcmchain.check import run_effects
from lcmchain.check.tool_strokes import tools_never_touched
from lcmchain.effects.process.mass_scaling import added_mass
from lcmchain.fields.courses import joint_widths
from lcmchain.fields.loads import gripper_loads, tool_stops
from lcmchain.fields.stack import plies_of
from lcmchain.judgements.contact import (
    hidden_compaction,
    hidden_compaction_warnings,
    penetration_warnings,
    ply_depth_warnings,
    stop_warnings,
)
from lcmchain.judgements.crossings import joint_warnings
from lcmchain.judgements.fields import fibre_strain_measures, fibre_strain_warnings, field_warnings
from lcmchain.judgements.quasi_static import (
    balance_warning,
    idle_energy,
    process_time_needed,
    quasi_static_measures,
    quasi_static_warnings,
    rest_warnings,
    snap_warnings,
    still_moving_warning,
)
from lcmchain.quantities.fields import NO_THICKNESS
from lcmchain.results import RUNNING
from lcmchain.scene import left_out_of, rung_of
from lcmchain.scene.pace import slowing_entry
from lcmchain.solver.remedies import stiffer_contact
from lcmchain.state import HALVINGS, SHEET_TIME, State
from lcmchain.thresholds import LARGEST_PENETRATION, TOUCHED_PART

if TYPE_CHECKING:
    import xarray as xr

    from lcmchain.materials.law import Material
    from lcmchain.model import Model
    from lcmchain.scene import Scene
    from lcmchain.solver.simulation import Simulation


def run_head(scene: Scene, simulation: Simulation, run_fingerprint: str) -> dict:
    """Return what ``summary.json`` says from the start of a run on.

    Parameters
    ----------
    run_fingerprint : of :class:`lcmchain.provenance.Fingerprint`, all that decides the numbers.
    """
    model = simulation.model
    return scene_head(scene, run_fingerprint, model.element_count, model.node_count)


def scene_head(scene: Scene, run_fingerprint: str, element_count: int, node_count: int) -> dict:
    """Return what ``summary.json`` says of any forming run from its start on."""
    return {
        "lcmchain_version": __version__,
        "title": scene.title,
        "state": RUNNING,
        "run": {
            "process": os.getpid(),
            "host": socket.gethostname(),
            "started": datetime.now().astimezone().isoformat(sep=" ", timespec="seconds"),
        },
        "scene_sha256": scene.source.sha256,
        "run_fingerprint": run_fingerprint,
        "model": rung_of(scene),
        "left_out": left_out_of(scene),
        "element_count": element_count,
        "node_count": node_count,
        "process_time_s": scene.process.time,
    }


def run_summary(
    scene: Scene,
    simulation: Simulation,
    snapshots: Sequence,
    datasets: Mapping[str, xr.Dataset],
    *,
    wall_s: float,
    compile_s: float,
    threads: int,
    warnings: Sequence[str] = (),
) -> dict:
    """Return what ``summary.json`` says of the fields, before any mapping.

    Parameters
    ----------
    scene : the scene; ``scene_sha256`` is the hash of its text, empty without one.
    simulation : at its end, be it that of the process or a guard's.
    snapshots : of all frames, the last one of what the summary speaks of.
    datasets : groups of ``forming.nc`` made of them.
    wall_s, compile_s : time spent in the time loop and on compiling [s].
    threads : of the compiled loops.
    warnings : found while the model was built.
    """
    # Imported when there are fields: a run need not wait for xarray before its first step.
    from lcmchain.fields.dataset import HISTORY
    from lcmchain.fields.stages import stage_summary
    from lcmchain.fields.summary import field_summary, punch_index, stack_summary

    model, state = simulation.model, simulation.state
    history = datasets[HISTORY]
    punch = punch_index(history) if history.sizes["tool"] else None
    needed = process_time_needed(model)
    idle = idle_energy(model)
    touched = TOUCHED_PART if scene.time_is_found else 0.0
    formed = snapshots[
        _formed_frame(
            scene,
            [snapshot.time for snapshot in snapshots],
            [snapshot.energy["external"] for snapshot in snapshots],
            [snapshot.energy["internal"] for snapshot in snapshots],
        )
    ]
    measures = quasi_static_measures(
        history, formed.energy, punch, idle, touched, until=formed.time
    )
    summary = {
        "step_count": state.step_count,
        "wall_s": wall_s,
        "compile_s": compile_s,
        "threads": threads,
        "us_per_element_step": 1e6 * wall_s / max(state.step_count * model.element_count, 1),
        "energy": snapshots[-1].energy,
        **energy_measures([snapshot.energy for snapshot in snapshots], idle),
        **measures,
        "process_time_needed_s": needed.as_dict(),
        **_pace(model, state),
        **field_summary(datasets),
        **stack_summary(datasets),
        **tool_stops(model, state),
        **_joints(datasets, model),
        **_grippers(datasets[HISTORY]),
        "penetration_max_m": dict(
            zip(model.tool_names, state.penetration_max.tolist(), strict=True)
        ),
        **_penalty_needed(model, state),
        **stage_summary(model, state, datasets),
        **hidden_compaction(model, snapshots),
        "step_control": dict(simulation.control.history),
        "step_halvings": int(state.counters[HALVINGS]),
        **added_mass(model),
        **fibre_strain_measures(datasets["/"], scene),
        "effects": [effect.name for effect in run_effects(scene, model.whole) if effect.active],
        "effects_switched": {switched.key: switched.setting for switched in scene.switched},
    }
    remarks = [
        *warnings,
        *tools_never_touched(model, state, snapshots),
        *_field_warnings(datasets, model),
        *balance_warning(summary, scene),
        *still_moving_warning(summary, slowing_entry(scene)),
        *penetration_warnings(summary, scene.stack.least_thickness),
        *ply_depth_warnings(summary),
        *hidden_compaction_warnings(summary),
        *quasi_static_warnings(measures, scene, needed),
        *snap_warnings(summary.get("tool_loads", {}), scene),
        *fibre_strain_warnings(summary),
        *rest_warnings(summary),
        *stop_warnings(model, state),
    ]
    in_own_words = [scene.stack.in_own_words(text) for text in remarks]
    return summary | {"warnings": list(dict.fromkeys(in_own_words)), "mapping": {}}


#: Part of the largest stored energy that tools which open take back: forming has ended before.
TAKEN_BACK = 0.5


def _formed_frame(
    scene: Scene, times: Sequence[float], work: Sequence[float], stored: Sequence[float]
) -> int:
    """Return the number of the frame in which forming has ended.

    Stages at the end in which the sheet comes to rest take all vibrations out of it, and with them
    what it has stored: none of that is in the forces that formed it. Tools that open take their
    work back: what damping has taken is no part of the rest, and their way back no stroke.

    times [s], work, stored [J] : of the frames; work of all that acts from outside, and energy that
        the sheets have stored.
    """
    ends = list(accumulate(stage.time for stage in scene.stages))
    formed = [end for end, stage in zip(ends, scene.stages, strict=True) if not stage.rest]
    last = formed[-1] if formed else math.inf
    frame = max(sum(time <= last * (1.0 + 1e-9) for time in times), 1) - 1
    most = int(np.argmax(work[: frame + 1]))
    if work[most] - work[frame] > TAKEN_BACK * max(stored[: frame + 1]):
        return most
    return frame


def _field_warnings(datasets: Mapping[str, xr.Dataset], model: Model) -> list[str]:
    """Return where the fields of each sheet leave the range of the model, with its name."""

    def told(sheet: xr.Dataset, material: Material) -> list[str]:
        return field_warnings(sheet, material) + joint_warnings(sheet, material.thickness)

    if len(model.bodies) == 1:
        return told(datasets["/"], model.bodies[0].material)
    return [
        f"{name}: {text}"
        for body, (name, groups) in zip(model.bodies, plies_of(datasets), strict=True)
        for text in told(groups["/"], body.material)
        if text != NO_THICKNESS  # told of the scene's elements
    ]


def _joints(datasets: Mapping[str, xr.Dataset], model: Model) -> dict[str, Any]:
    """Return how wide the joints of plies in courses are; nothing without any."""
    if len(model.bodies) == 1:
        found = [joint.as_dict() for joint in joint_widths(datasets["/"])]
    else:
        found = [
            {"ply": name, **joint.as_dict()}
            for name, groups in plies_of(datasets)
            for joint in joint_widths(groups["/"])
        ]
    return {"joints": found} if found else {}


def _grippers(history: xr.Dataset) -> dict[str, Any]:
    """Return the loads of the grippers; nothing without any."""
    loads = gripper_loads(history)
    return {"gripper_loads": loads} if loads else {}


def _pace(model: Model, state: State) -> dict[str, Any]:
    """Return what was found for a process without a time."""
    pace = model.whole.pace
    if pace is None:
        return {}
    found = {"fastest_time_s": pace.time, "sheet_time_s": float(state.clock[SHEET_TIME])}
    return {"pace": found}


def _penalty_needed(model: Model, state: State) -> dict[str, str]:
    """Return the scene entry for a contact stiffness where nodes lie too deep in a tool."""
    limit = LARGEST_PENETRATION * min(body.material.thickness for body in model.bodies)
    if not (state.penetration_max > limit).any():
        return {}
    return {"contact_penalty_needed": stiffer_contact(model, state)}


def energy_measures(energies: Sequence[Mapping[str, float]], idle: float = 0.0) -> dict[str, float]:
    """Return how the energies of the frames compare with the internal one, hourglass included.

    ``balance_error_max`` is relative to the largest internal energy of all frames, the kinetic
    energy to the internal energy of its own frame. Where the sheet was never ``strained``, because
    its internal energy stayed below ``idle`` [J], the kinetic ratios are 0, and the balance error
    is relative to the largest part of the balance (:func:`_balance_scale`).
    """
    internal = np.array([energy["internal"] + energy["hourglass"] for energy in energies])
    kinetic = np.array([energy["kinetic"] for energy in energies])
    error = np.array([energy["balance_error"] for energy in energies])
    strained = internal > idle
    ratio = np.divide(kinetic, internal, out=np.zeros_like(kinetic), where=strained)
    scale = _balance_scale(energies, float(internal.max()), idle)
    return {
        "strained": bool(strained.any()),
        "balance_error_max": float(np.abs(error).max()) / scale if scale else 0.0,
        "kinetic_to_internal_max": float(ratio.max()),
        "kinetic_to_internal_end": float(ratio[-1]),
    }


def _balance_scale(energies: Sequence[Mapping[str, float]], internal: float, idle: float) -> float:
    """Return what the error of the balance is compared with [J]; 0 where nothing happened.

    It is the largest internal energy. A sheet that was never strained may be moved and touched
    even so, and its balance may be wrong: then it is the largest energy of any kind, be it work,
    motion, contact or damping. Below ``idle`` all of them are rounding.
    """
    if internal > idle:
        return internal
    largest = max(
        abs(value)
        for energy in energies
        for name, value in energy.items()
        if name != "balance_error"
    )
    return largest if largest > idle else 0.0
