"""Checkpoint of a whole co-simulation: all that it needs to go on as if it had never stopped."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path

from lcmchain.coupling.cosimulation.assembly import Assembly
from lcmchain.coupling.cosimulation.part import SerialisedUnit, Spent
from lcmchain.coupling.cosimulation.recorder import Recorder
from lcmchain.coupling.iteration.checkpoint import (
    flattened,
    read_archive,
    restored,
    write_archive,
)
from lcmchain.coupling.iteration.history import IterationRecord, WindowRecord
from lcmchain.errors import InputError

CHECKPOINT = "cosimulation_checkpoint.npz"
RECORDS = {record.__name__: record for record in (IterationRecord, WindowRecord, SerialisedUnit)}
_FORM = "lcmchain cosimulation 1"
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
    write_archive(path, _FORM, header, {f"array_{k}": array for k, array in enumerate(arrays)})


def restore_checkpoint(path: Path, assembly: Assembly, recorder: Recorder) -> float:
    """Bring system and recorder to a checkpoint; return the time spent before it [s].

    Raises
    ------
    InputError : there is none, it is damaged, or it belongs to other units or settings.
    """
    header, found = read_archive(path, _FORM, "simulate without --resume")
    _require_same(header["fingerprint"], fingerprint_of(assembly), path)
    arrays = [found[f"array_{number}"] for number in range(header["count"])]
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
