"""Checkpoints: everything that a run needs to go on as if it had never stopped."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from zipfile import BadZipFile

import numpy as np

from lcmchain.atomic import replacing
from lcmchain.errors import InputError
from lcmchain.fingerprint import Fingerprint
from lcmchain.solver.simulation import Snapshot
from lcmchain.state import State

FILE_NAME = "checkpoint.npz"
FORMAT = 3


@dataclass(frozen=True)
class Checkpoint:
    """State, saved frames and bookkeeping of an unfinished run.

    ``fingerprint`` is that of the run (:func:`lcmchain.fingerprint.run_fingerprint`), ``wall_s``
    the computing time spent so far, ``step_history`` the steps made under each cause.
    """

    fingerprint: Fingerprint
    state: State
    snapshots: list[Snapshot]
    wall_s: float
    step_history: dict[str, int]


def write_checkpoint(folder: Path, checkpoint: Checkpoint) -> Path:
    """Write ``checkpoint.npz`` into ``folder``, whole or not at all."""
    header = {
        "format": FORMAT,
        "fingerprint": checkpoint.fingerprint._asdict(),
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


def read_checkpoint(folder: Path, fingerprint: Fingerprint) -> Checkpoint:
    """Read the checkpoint in ``folder`` of the run with this fingerprint.

    Raises
    ------
    InputError : there is none, it cannot be read, or it belongs to another run: another scene,
        other mesh files, or other sources of lcmchain.
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
            found = Fingerprint(**header["fingerprint"])
    except (OSError, EOFError, BadZipFile, ValueError, KeyError, TypeError) as error:
        raise InputError(f"this is no readable checkpoint ({error})", file=path) from None
    if found != fingerprint:
        raise InputError(
            f"the checkpoint was written for {found.difference(fingerprint)}; run without "
            "--resume, or into another folder",
            file=path,
        )
    return Checkpoint(
        found, state, snapshots, float(header["wall_s"]), dict(header["step_history"])
    )


def remove_checkpoint(folder: Path) -> None:
    """Remove the checkpoint of a run that is complete."""
    (Path(folder) / FILE_NAME).unlink(missing_ok=True)
