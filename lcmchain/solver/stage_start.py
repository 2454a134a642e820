"""Going on from a stage of another run, whose scene has other stages behind it.

A run that has ended with a stage leaves a checkpoint. Another scene may go on from it if all that
has worked until then is the same: its own tables but for the later stages, and the model that was
made of them. What depends on all stages together, as the contact stiffness that is found for the
smallest gap between tools, is compared too. The state is then laid out for the stages of the scene.
"""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import Any

import numpy as np

from lcmchain.errors import InputError
from lcmchain.model import Model
from lcmchain.provenance import Fingerprint, differing_keys, written_values
from lcmchain.scene.scene import Scene
from lcmchain.scene.stages import LISTS
from lcmchain.solver.checkpoint import Checkpoint, FrameFile
from lcmchain.state import SAMPLES, State

#: Option that names the folder of the other run.
FROM = "--from"
#: Arrays of a state that have rows for stages or samples, and the axis of these.
BY_STAGE = {"rest": 0, "tool_stopped": 1, "samples": 0}


def values_until(values: dict[str, Any], stages: int) -> dict[str, Any]:
    """Return the part of :func:`written_values` that works in the first stages.

    Entries that are at work in some stages alone say in which of these.
    """
    found = {**values, "stages": values["stages"][:stages]}
    found["process"] = {k: v for k, v in values["process"].items() if k != "frames"}
    names = [stage["name"] for stage in found["stages"]]
    for name in LISTS:
        found[name] = [
            {**entry, "stages": [s for s in names if s in (entry["stages"] or names)]}
            for entry in values.get(name, ())
        ]
    return found


def model_digest(model: Model, stages: int) -> str:
    """Return a hash of the numbers that a model has computed with in its first stages."""
    digest = hashlib.sha256()
    for nodes in (model.nodes.mass, model.nodes.area, model.nodes.offset):
        digest.update(np.ascontiguousarray(nodes).tobytes())
    for stage in model.stages[:stages]:
        tables = (stage.tools, stage.environment, stage.grippers, stage.supports)
        for table in (table for table in tables if table is not None):
            for value in table:
                if value is not None:
                    digest.update(np.ascontiguousarray(value).tobytes())
        digest.update(np.array([stage.start, stage.end, stage.averaging or 0.0]).tobytes())
    return digest.hexdigest()


def require_border(checkpoint: Checkpoint, scene: Scene, folder: Path) -> int:
    """Return how many stages a checkpoint has behind it, all of which this scene has as well.

    Raises
    ------
    InputError : it lies within a stage or at the end of the process, or something that has worked
        until then is another in the scene; names the key.
    """
    if not scene.stages:
        raise InputError("goes on from a stage, but the scene has no [[stages]]", key=FROM)
    values = checkpoint.values
    ends = [end for end in checkpoint.stage_ends if end <= checkpoint.state.time]
    if not ends or ends[-1] != checkpoint.state.time:
        raise InputError(
            f"the run in {folder} has come to {1e3 * checkpoint.state.time:.4g} ms, which is not "
            "the end of a stage; let it end with one by --until-stage",
            key=FROM,
        )
    own, stages = written_values(scene), len(ends)
    if stages >= len(own["stages"]):
        raise InputError(
            f"the run in {folder} has made {stages} stages, and the scene has no further one",
            key=FROM,
        )
    differing = list(differing_keys(values_until(values, stages), values_until(own, stages)))
    if differing == ["history_interval"]:
        raise InputError(
            "is found from the time of the process, which the later stages change; give it in both "
            f"scenes, as in that of {folder}",
            key="output.history_interval",
        )
    if differing:
        more = f", and {len(differing) - 1} more" if len(differing) > 1 else ""
        raise InputError(
            f"is another in the scene of {folder}{more}: what works until the end of "
            f'"{own["stages"][stages - 1]["name"]}" must be the same; change the stages behind it, '
            f"or run the scene from the start without {FROM}",
            key=differing[0],
        )
    return stages


def started_state(checkpoint: Checkpoint, model: Model, stages: int, folder: Path) -> State:
    """Return the state at a border, laid out for a model with other stages behind it.

    Raises
    ------
    InputError : the models differ in what they have computed with until then.
    """
    if model_digest(model, stages) != checkpoint.digest:
        raise InputError(
            f"stages before the start are computed otherwise than in {folder}: something that is "
            "found for all stages together is another, as contact.penalty and contact.depth by the "
            f"smallest gap between tools; give them in both scenes, or run without {FROM}",
            key=FROM,
        )
    state, before = State.at_rest(model), checkpoint.state
    for name, array in state.as_dict().items():
        given = getattr(before, name)
        if name in BY_STAGE:
            kept = stages if name != "samples" else int(before.counters[SAMPLES])
            rows = [slice(None)] * array.ndim
            rows[BY_STAGE[name]] = slice(0, kept)
            if given[tuple(rows)].shape == array[tuple(rows)].shape:
                array[tuple(rows)] = given[tuple(rows)]
                continue
        elif given.shape == array.shape:
            array[:] = given
            continue
        raise InputError(
            f"the state of {folder} has {name} of the shape {given.shape}, and this scene "
            f"{array.shape}; run without {FROM}",
            key=FROM,
        )
    return state


def started(
    checkpoint: Checkpoint,
    scene: Scene,
    model: Model,
    fingerprint: Fingerprint,
    folders: tuple[Path, Path],
) -> Checkpoint:
    """Return the checkpoint of another run as one of the run of this scene, at its first step.

    Parameters
    ----------
    folders : of the other run, and of this one, whose frames are written anew.
    """
    stages = require_border(checkpoint, scene, folders[0])
    return Checkpoint(
        fingerprint,
        started_state(checkpoint, model, stages, folders[0]),
        checkpoint.snapshots,
        checkpoint.wall_s,
        checkpoint.step_history,
        FrameFile(folders[1]),
    )
