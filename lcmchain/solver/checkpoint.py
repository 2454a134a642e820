"""Checkpoints: everything that a run needs to go on as if it had never stopped."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from lcmchain.atomic import replacing
from lcmchain.errors import InputError
from lcmchain.solver.simulation import Snapshot
from lcmchain.state import State

FILE_NAME = "checkpoint.npz"
FORMAT = 2


@dataclass(frozen=True)
class Checkpoint:
    """State, saved frames and bookkeeping of an unfinished run.

    ``wall_s`` is the computing time spent so far, ``step_history`` the steps made under each cause.
    """

    scene_sha256: str
    state: State
    snapshots: list[Snapshot]
    wall_s: float
    step_history: dict[str, int]


def write_checkpoint(folder: Path, checkpoint: Checkpoint) -> Path:
    """Write ``checkpoint.npz`` into ``folder``, whole or not at all."""
    header = {
        "format": FORMAT,
        "scene_sha256": checkpoint.scene_sha256,
        "wall_s": checkpoint.wall_s,
        "step_history": checkpoint.step_history,
        "times": [s.time for s in checkpoint.snapshots],
        "energies": [s.energy for s in checkpoint.snapshots],
    }
    arrays = {f"state_{name}": array for name, array in checkpoint.state.as_dict().items()}
    arrays |= {
        "frame_position": np.array([s.position for s in checkpoint.snapshots]),
        "frame_tool_travel": np.array([s.tool_travel for s in checkpoint.snapshots]),
        "frame_tool_force": np.array([s.tool_force for s in checkpoint.snapshots]),
    }
    path = Path(folder) / FILE_NAME
    with replacing(path) as temporary:
        np.savez(temporary, header=np.array(json.dumps(header)), **arrays)
    return path


def read_checkpoint(folder: Path, scene_sha256: str) -> Checkpoint:
    """Read the checkpoint in ``folder``.

    Raises
    ------
    InputError : there is none, it cannot be read, or it belongs to another scene.
    """
    path = Path(folder) / FILE_NAME
    if not path.is_file():
        raise InputError("there is no checkpoint to resume from; run without --resume", file=path)
    try:
        with np.load(path, allow_pickle=False) as data:
            header = json.loads(str(data["header"]))
            if header["format"] != FORMAT:
                raise ValueError(f"format {header['format']} instead of {FORMAT}")
            state = State(**{key[6:]: data[key] for key in data.files if key.startswith("state_")})
            frames = zip(
                header["times"],
                data["frame_position"],
                data["frame_tool_travel"],
                data["frame_tool_force"],
                header["energies"],
                strict=True,
            )
            snapshots = [Snapshot(*frame) for frame in frames]
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise InputError(f"this is no readable checkpoint ({error})", file=path) from None
    if header["scene_sha256"] != scene_sha256:
        raise InputError(
            "the checkpoint belongs to another scene (or to other --set values); run without "
            "--resume, or into another folder",
            file=path,
        )
    return Checkpoint(
        scene_sha256, state, snapshots, float(header["wall_s"]), dict(header["step_history"])
    )


def remove_checkpoint(folder: Path) -> None:
    """Remove the checkpoint of a run that is complete."""
    (Path(folder) / FILE_NAME).unlink(missing_ok=True)
