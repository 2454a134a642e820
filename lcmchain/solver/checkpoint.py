"""Checkpoints: everything that a run needs to go on as if it had never stopped.

There are two files. The state is written anew each time. Saved frames are written once each, one
behind the other, so that a checkpoint takes the same time however many frames a run has saved. The
checkpoint says how many bytes of the frames are valid; what a killed run has left behind them is
cut off before the next frame.

The first line of the checkpoint names its format and the SHA-256 of the rest, which in turn holds
that of the frames: a checkpoint that differs in one bit from what was written is refused before
anything of it is read.
"""

from __future__ import annotations

import hashlib
import io
import json
import os
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from lcmchain.atomic import announce, replacing
from lcmchain.errors import InputError, OutputError
from lcmchain.provenance import Fingerprint, differing_keys
from lcmchain.solver.simulation import Snapshot
from lcmchain.state import State

FILE_NAME, FRAME_FILE_NAME = "checkpoint.npz", "checkpoint_frames.npy"
FORMAT = 10
_FIRST_WORDS = b"lcmchain checkpoint"


class FrameFile:
    """Appends frames to a file; ``count`` frames in ``length`` bytes are there so far."""

    def __init__(self, folder: Path, count: int = 0, length: int = 0) -> None:
        self.path = Path(folder) / FRAME_FILE_NAME
        self.count, self.length = count, length
        self._digest = hashlib.sha256()

    @property
    def sha256(self) -> str:
        """Hash of the valid bytes."""
        return self._digest.hexdigest()

    def append(self, frames: Sequence[dict[str, np.ndarray]]) -> None:
        """Write the arrays of further frames behind the valid part, in the order of their names.

        Raises
        ------
        OutputError : writing failed; the valid part is as before.
        """
        if not frames:
            return
        content = io.BytesIO()
        for frame in frames:
            for name in sorted(frame):
                np.save(content, frame[name], allow_pickle=False)
        announce(self.path)
        try:
            with open(self.path, "r+b" if self.length else "wb") as file:
                file.truncate(self.length)
                file.seek(self.length)
                file.write(content.getbuffer())
                file.flush()
                os.fsync(file.fileno())  # the checkpoint that counts these bytes comes after them
        except OSError as error:
            raise OutputError(error.strerror or str(error), file=self.path) from error
        self._digest.update(content.getbuffer())
        self.length += content.getbuffer().nbytes
        self.count += len(frames)

    def read(self, names: Sequence[str], sha256: str) -> list[dict[str, np.ndarray]]:
        """Read all frames, each with arrays of these names.

        Raises
        ------
        InputError : the file is absent, or not as it was written.
        """
        if self.count == 0:
            return []
        try:
            with open(self.path, "rb") as file:
                content = file.read(self.length)
        except OSError as error:
            raise InputError(
                f"the frames of the checkpoint cannot be read ({error.strerror}); run without "
                "--resume",
                file=self.path,
            ) from None
        self._digest = hashlib.sha256(content)
        if self.sha256 != sha256:
            raise InputError(
                "the frames of the checkpoint are damaged (their checksum does not fit); run "
                "without --resume",
                file=self.path,
            )
        arrays = io.BytesIO(content)
        return [
            {name: np.load(arrays, allow_pickle=False) for name in sorted(names)}
            for _ in range(self.count)
        ]


@dataclass(frozen=True)
class Checkpoint:
    """State, saved frames and bookkeeping of an unfinished run.

    ``fingerprint`` is that of the run (:func:`lcmchain.provenance.run_fingerprint`), ``wall_s``
    the computing time spent so far, ``step_history`` the steps made under each cause,
    ``frame_file`` where the first of the snapshots lie already. The scene's ``values`` tell which
    key of another scene differs. At the end of a stage, from which other runs may go on
    (:mod:`lcmchain.solver.stage_start`), it holds when the stages end [s], and a ``digest`` of
    the model so far.
    """

    fingerprint: Fingerprint
    state: State
    snapshots: list[Snapshot]
    wall_s: float
    step_history: dict[str, int]
    frame_file: FrameFile
    values: dict[str, Any] = field(default_factory=dict)
    stage_ends: tuple[float, ...] = ()
    digest: str = ""


def write_checkpoint(folder: Path, checkpoint: Checkpoint) -> Path:
    """Write ``checkpoint.npz`` into ``folder``, whole or not at all, and further frames."""
    snapshots, frame_file = checkpoint.snapshots, checkpoint.frame_file
    frame_file.append([snapshot.arrays for snapshot in snapshots[frame_file.count :]])
    header = {
        "fingerprint": checkpoint.fingerprint._asdict(),
        "wall_s": checkpoint.wall_s,
        "step_history": checkpoint.step_history,
        "times": [s.time for s in snapshots],
        "energies": [s.energy for s in snapshots],
        "frame_names": sorted(snapshots[0].arrays),
        "frame_bytes": frame_file.length,
        "frame_sha256": frame_file.sha256,
        "values": checkpoint.values,
        "stage_ends": checkpoint.stage_ends,
        "digest": checkpoint.digest,
    }
    arrays: dict[str, Any] = {
        f"state_{name}": array for name, array in checkpoint.state.as_dict().items()
    }
    content = io.BytesIO()
    np.savez(content, header=np.array(json.dumps(header)), **arrays)
    body = content.getbuffer()
    path = Path(folder) / FILE_NAME
    with replacing(path) as temporary, open(temporary, "wb") as file:
        digest = hashlib.sha256(body).hexdigest()
        file.write(_FIRST_WORDS + f" {FORMAT} {digest}\n".encode())
        file.write(body)
        file.flush()
        os.fsync(file.fileno())  # the one before goes with the name: this one must be on disk
    return path


def read_checkpoint(
    folder: Path,
    fingerprint: Fingerprint,
    *,
    of_other_scene: bool = False,
    values: dict[str, Any] | None = None,
) -> Checkpoint:
    """Read the checkpoint in ``folder`` of the run with this fingerprint.

    Parameters
    ----------
    of_other_scene : take that of another scene as well, with the same files and sources.
    values : of the scene of the run (:func:`lcmchain.provenance.written_values`), by which the
        error names the first key in which another scene differs.

    Raises
    ------
    InputError : there is none, it is damaged, or it belongs to another run: another scene, other
        mesh files, or other sources of lcmchain.
    """
    path = Path(folder) / FILE_NAME
    with np.load(io.BytesIO(_verified_content(path)), allow_pickle=False) as data:
        header = json.loads(str(data["header"]))
        found = Fingerprint(**header["fingerprint"])
        wanted = fingerprint._replace(scene=found.scene) if of_other_scene else fingerprint
        if found != wanted:
            way = "--from" if of_other_scene else "--resume, or into another folder"
            stored = header["values"]
            keys = list(differing_keys(stored, values)) if stored and values else []
            difference = found.difference(wanted, keys)
            raise InputError(
                f"the checkpoint was written for {difference}; run without {way}",
                file=path,
            )
        state = State.from_arrays(_named(data, "state_"))
    times = header["times"]
    frame_file = FrameFile(folder, len(times), header["frame_bytes"])
    frames = frame_file.read(header["frame_names"], header["frame_sha256"])
    snapshots = [Snapshot(*frame) for frame in zip(times, header["energies"], frames, strict=True)]
    return Checkpoint(
        found, state, snapshots, float(header["wall_s"]), dict(header["step_history"]), frame_file,
        header["values"], tuple(header["stage_ends"]), header["digest"],
    )  # fmt: skip


def _verified_content(path: Path) -> bytes:
    """Return what follows the first line of a checkpoint, byte for byte as it was written.

    Raises
    ------
    InputError : there is no such file, or it is not as it was written.
    """
    try:
        with open(path, "rb") as file:
            first_line = file.readline(200).split()
            content = file.read()
    except FileNotFoundError:
        raise InputError(
            "there is no checkpoint to resume from; run without --resume", file=path
        ) from None
    except OSError as error:
        raise InputError(f"the checkpoint cannot be read ({error.strerror})", file=path) from None
    if len(first_line) != 4 or first_line[:2] != _FIRST_WORDS.split():
        problem = "this is no checkpoint of lcmchain, or its first line is damaged"
    elif first_line[2] != str(FORMAT).encode():
        form = first_line[2].decode("ascii", errors="replace")
        problem = f"the checkpoint has format {form}, this program reads format {FORMAT}"
    elif first_line[3] != hashlib.sha256(content).hexdigest().encode():
        problem = "the checkpoint is damaged (its checksum does not fit)"
    else:
        return content
    raise InputError(f"{problem}; run without --resume", file=path)


def _named(data, prefix: str) -> dict[str, np.ndarray]:
    """Return the arrays whose name begins with ``prefix``, by the rest of it."""
    return {name[len(prefix) :]: data[name] for name in data.files if name.startswith(prefix)}


def remove_checkpoint(folder: Path) -> None:
    """Remove the checkpoint of a run that is complete."""
    for name in (FILE_NAME, FRAME_FILE_NAME):
        (Path(folder) / name).unlink(missing_ok=True)
