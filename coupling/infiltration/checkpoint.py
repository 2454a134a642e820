"""Checkpoint of a filling: all that it needs to go on as if it had never stopped.

The first line names the format and the SHA-256 of the rest: a file that differs in one bit from
what was written is refused before anything of it is read.
"""

from __future__ import annotations

import hashlib
import io
import json
import os
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np

from lcmchain.atomic import replacing
from lcmchain.coupling.filling_part import SavedFilling
from lcmchain.coupling.infiltration.results import FillingRecord
from lcmchain.coupling.infiltration.state import DrySpot, FillingState
from lcmchain.coupling.iteration.history import IterationRecord, WindowRecord
from lcmchain.coupling.iteration.saved_tree import flattened, restored
from lcmchain.coupling.solids.explicit import SavedForming
from lcmchain.coupling.solids.local import SavedCompaction
from lcmchain.errors import InputError
from lcmchain.solver.simulation import StepControl
from lcmchain.state import State

FORMAT = 4
#: Records that a saved state is made of.
RECORDS = {
    record.__name__: record
    for record in (
        FillingState, DrySpot, SavedFilling, SavedCompaction, SavedForming, State, StepControl,
        IterationRecord, WindowRecord,
    )
}  # fmt: skip
_FIRST_WORDS = b"lcmchain filling"


def write_checkpoint(
    path: Path, fingerprint: dict[str, str], state: Any, record: FillingRecord
) -> None:
    """Write state and record, whole or not at all.

    fingerprint : hashes of what decides the numbers, by what they are of.
    state : what a filling, or the mould that closes on it, saves.
    """
    tree, kept = flattened(state)
    header: dict[str, Any] = {"fingerprint": fingerprint, "state": tree}
    arrays: dict[str, Any] = {f"state_{number}": array for number, array in enumerate(kept)}
    header["array_count"] = len(kept)
    for entry in fields(FillingRecord):
        arrays[f"record_{entry.name}"] = np.array(getattr(record, entry.name))
    content = io.BytesIO()
    np.savez(content, header=np.array(json.dumps(header)), **arrays)
    body = content.getbuffer()
    with replacing(path) as temporary, open(temporary, "wb") as file:
        digest = hashlib.sha256(body).hexdigest()
        file.write(_FIRST_WORDS + f" {FORMAT} {digest}\n".encode())
        file.write(body)
        file.flush()
        os.fsync(file.fileno())


def read_checkpoint(path: Path, fingerprint: dict[str, str]) -> tuple[Any, FillingRecord]:
    """Read the checkpoint of the filling with this fingerprint.

    Raises
    ------
    InputError : there is none, it is damaged, or it belongs to another filling.
    """
    with np.load(io.BytesIO(_verified(path)), allow_pickle=False) as data:
        header = json.loads(str(data["header"]))
        found = header["fingerprint"]
        other = [word for word in fingerprint if found.get(word) != fingerprint[word]]
        if other:
            raise InputError(
                f"the checkpoint was written for another {' and another '.join(other)}; fill "
                "without --resume, or into another folder",
                file=path,
            )
        kept = [data[f"state_{number}"] for number in range(header["array_count"])]
        state = restored(header["state"], kept, RECORDS)
        record = FillingRecord(
            **{e.name: _listed(data[f"record_{e.name}"]) for e in fields(FillingRecord)}
        )
    return state, record


def _verified(path: Path) -> bytes:
    try:
        with open(path, "rb") as file:
            first = file.readline(200)
            body = file.read()
    except FileNotFoundError:
        raise InputError(
            "there is no checkpoint to go on from; fill without --resume", file=path
        ) from None
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror}", file=path) from None
    words = first.split()
    wanted = hashlib.sha256(body).hexdigest().encode()
    if words != [*_FIRST_WORDS.split(), str(FORMAT).encode(), wanted]:
        raise InputError(
            "this is no checkpoint of this version, or it is damaged; fill without --resume",
            file=path,
        )
    return body


def _listed(values: np.ndarray) -> list:
    """A list of the numbers, or of the arrays, that were kept."""
    return values.tolist() if values.ndim == 1 else list(values)
