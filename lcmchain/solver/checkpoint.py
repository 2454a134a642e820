"""Checkpoints: everything that a run needs to go on as if it had never stopped.

The state is written anew each time, the frames once each (:mod:`lcmchain.solver.frame_file`): a
checkpoint takes the same time however many frames a run has saved.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import numpy as np

from lcmchain.atomic import replacing
from lcmchain.errors import InputError
from lcmchain.fingerprint import Fingerprint
from lcmchain.solver.frame_file import FILE_NAME as FRAME_FILE_NAME
from lcmchain.solver.frame_file import FrameFile
from lcmchain.solver.simulation import Snapshot
from lcmchain.state import State

FILE_NAME = "checkpoint.npz"
FORMAT = 5


@dataclass(frozen=True)
class Checkpoint:
    """State, saved frames and bookkeeping of an unfinished run.

    ``fingerprint`` is that of the run (:func:`lcmchain.fingerprint.run_fingerprint`), ``wall_s``
    the computing time spent so far, ``step_history`` the steps made under each cause,
    ``frame_file`` where the first of the snapshots lie already.
    """

    fingerprint: Fingerprint
    state: State
    snapshots: list[Snapshot]
    wall_s: float
    step_history: dict[str, int]
    frame_file: FrameFile


def write_checkpoint(folder: Path, checkpoint: Checkpoint) -> Path:
    """Write ``checkpoint.npz`` into ``folder``, whole or not at all, and further frames."""
    snapshots, frame_file = checkpoint.snapshots, checkpoint.frame_file
    frame_file.append([snapshot.arrays for snapshot in snapshots[frame_file.count :]])
    header = {
        "format": FORMAT,
        "fingerprint": checkpoint.fingerprint._asdict(),
        "wall_s": checkpoint.wall_s,
        "step_history": checkpoint.step_history,
        "times": [s.time for s in snapshots],
        "energies": [s.energy for s in snapshots],
        "frame_names": sorted(snapshots[0].arrays),
        "frame_bytes": frame_file.length,
    }
    arrays: dict[str, Any] = {
        f"state_{name}": array for name, array in checkpoint.state.as_dict().items()
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
            state = State.from_arrays(_named(data, "state_"))
            times = header["times"]
            frame_file = FrameFile(folder, len(times), header["frame_bytes"])
            frames = frame_file.read(header["frame_names"])
            snapshots = [
                Snapshot(*frame) for frame in zip(times, header["energies"], frames, strict=True)
            ]
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
        found, state, snapshots, float(header["wall_s"]), dict(header["step_history"]), frame_file
    )


def _named(data, prefix: str) -> dict[str, np.ndarray]:
    """Return the arrays whose name begins with ``prefix``, by the rest of it."""
    return {name[len(prefix) :]: data[name] for name in data.files if name.startswith(prefix)}


def remove_checkpoint(folder: Path) -> None:
    """Remove the checkpoint of a run that is complete."""
    for name in (FILE_NAME, FRAME_FILE_NAME):
        (Path(folder) / name).unlink(missing_ok=True)
