"""Checkpoint of a whole co-simulation: all that it needs to go on as if it had never stopped.

The first line names the format and the SHA-256 of the rest: a file that differs in one bit from
what was written is refused before anything of it is read.
"""

from __future__ import annotations

import hashlib
import io
import json
import os
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from lcmchain.atomic import replacing
from lcmchain.coupling.cosimulation.assembly import Assembly
from lcmchain.coupling.cosimulation.part import SerialisedUnit, Spent
from lcmchain.coupling.cosimulation.recorder import Recorder
from lcmchain.coupling.iteration.history import IterationRecord, WindowRecord
from lcmchain.coupling.iteration.saved_tree import flattened, restored
from lcmchain.errors import InputError

CHECKPOINT = "cosimulation_checkpoint.npz"
FORMAT = 1
RECORDS = {record.__name__: record for record in (IterationRecord, WindowRecord, SerialisedUnit)}
_FIRST_WORDS = b"lcmchain cosimulation"
_SYSTEM = "settings of the system"


def fingerprint_of(assembly: Assembly) -> dict[str, str]:
    """Return hashes of what decides the numbers, by what they are of."""
    units = {f'unit "{name}"': part.sha256 for name, part in assembly.parts.items()}
    return {**units, _SYSTEM: assembly.system.digest()}


def write_checkpoint(path: Path, assembly: Assembly, recorder: Recorder, wall_s: float) -> None:
    """Write the state between two windows, whole or not at all.

    Raises
    ------
    PartFailed : a unit cannot write its state.
    """
    saved = assembly.coupled.save()
    saved["parts"] = {
        name: assembly.parts[name].serialised(state) for name, state in saved["parts"].items()
    }
    spent = {name: asdict(part.spent) for name, part in assembly.parts.items()}
    tree, arrays = flattened({"system": saved, "recorder": recorder.save(), "spent": spent,
                              "wall_s": wall_s})  # fmt: skip
    header = {"fingerprint": fingerprint_of(assembly), "tree": tree, "count": len(arrays)}
    named: dict[str, Any] = {f"array_{number}": array for number, array in enumerate(arrays)}
    content = io.BytesIO()
    np.savez(content, header=np.array(json.dumps(header)), **named)
    body = content.getbuffer()
    with replacing(path) as temporary, open(temporary, "wb") as file:
        digest = hashlib.sha256(body).hexdigest()
        file.write(_FIRST_WORDS + f" {FORMAT} {digest}\n".encode())
        file.write(body)
        file.flush()
        os.fsync(file.fileno())


def restore_checkpoint(path: Path, assembly: Assembly, recorder: Recorder) -> float:
    """Bring system and recorder to a checkpoint; return the time spent before it [s].

    Raises
    ------
    InputError : there is none, it is damaged, or it belongs to other units or settings.
    """
    with np.load(io.BytesIO(_verified(path)), allow_pickle=False) as data:
        header = json.loads(str(data["header"]))
        _require_same(header["fingerprint"], fingerprint_of(assembly), path)
        arrays = [data[f"array_{number}"] for number in range(header["count"])]
        kept = restored(header["tree"], arrays, RECORDS)
    assembly.coupled.restore(kept["system"])
    recorder.restore(kept["recorder"])
    for name, part in assembly.parts.items():
        part.spent = Spent(**kept["spent"][name])
    assembly.lines.refresh()
    return kept["wall_s"]


def _require_same(found: dict[str, str], wanted: dict[str, str], path: Path) -> None:
    other = [what for what in {**wanted, **found} if found.get(what) != wanted.get(what)]
    if other:
        told = ", ".join(
            f"{what} ({_short(found, what)} then, {_short(wanted, what)} now)" for what in other
        )
        raise InputError(
            f"the checkpoint was written with something else: {told}; go on with the same units "
            "and settings, or simulate without --resume",
            file=path,
        )


def _short(hashes: dict[str, str], what: str) -> str:
    return f"SHA-256 {hashes[what][:12]}" if what in hashes else "absent"


def _verified(path: Path) -> bytes:
    try:
        with open(path, "rb") as file:
            first = file.readline(200)
            body = file.read()
    except FileNotFoundError:
        raise InputError(
            "there is no checkpoint to go on from; simulate without --resume", file=path
        ) from None
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror}", file=path) from None
    wanted = hashlib.sha256(body).hexdigest().encode()
    if first.split() != [*_FIRST_WORDS.split(), str(FORMAT).encode(), wanted]:
        raise InputError(
            "this is no checkpoint of this version, or it is damaged; simulate without --resume",
            file=path,
        )
    return body
