"""Corrupted checkpoints: bytes of either file flipped, cut, swapped, or those of another run."""

from __future__ import annotations

import random
import shutil
import zipfile
from pathlib import Path

import numpy as np
from contract import Case
from mutations import mutated_bytes

from lcmchain.model import build_model
from lcmchain.provenance import Fingerprint
from lcmchain.scene import Scene
from lcmchain.solver import checkpoint as checkpoints
from lcmchain.solver.checkpoint import (
    FRAME_FILE_NAME,
    Checkpoint,
    FrameFile,
    read_checkpoint,
    write_checkpoint,
)
from lcmchain.solver.simulation import Snapshot
from lcmchain.state import State

RUN = Fingerprint("scene", "files", "sources")
FILES = (checkpoints.FILE_NAME, FRAME_FILE_NAME)
_SCENE = {
    "process": {"time": "10 ms"},
    "blank": {"size": ["40 mm", "40 mm"], "edge_length": "10 mm"},
    "material": {"preset": "MD600"},
}


def prepare(folder: Path) -> None:
    """Write two sound checkpoints of the same run, with other numbers."""
    model = build_model(Scene.model_validate(_SCENE))
    for number, name in enumerate(("sound", "other")):
        state = State.at_rest(model)
        numbers = np.random.default_rng(number)
        for array in state.as_dict().values():
            array[...] = numbers.integers(1, 200, array.shape)
        frames = [
            Snapshot(0.1 * k, {"internal": float(k)}, {n: a + k for n, a in state.frame().items()})
            for k in range(3)
        ]
        (folder / name).mkdir()
        write_checkpoint(
            folder / name,
            Checkpoint(RUN, state, frames, 12.5, {"waves": 7}, FrameFile(folder / name)),
        )


def make(rng: random.Random, folder: Path) -> Case:
    """Corrupt one of the files of a checkpoint, and return the reading of it."""
    work = folder / "work"
    shutil.rmtree(work, ignore_errors=True)
    shutil.copytree(folder / "sound", work)
    path = work / rng.choice(FILES)
    kind = rng.choice(
        ["bytes", "bytes", "bytes", "gone", "empty", "other", "names", "folder", "member"]
    )
    must_refuse = kind in ("gone", "empty", "other", "names", "folder")
    if kind == "bytes":
        path.write_bytes(mutated_bytes(rng, path.read_bytes())[0])
    elif kind in ("gone", "folder"):
        path.unlink()
        if kind == "folder":
            path.mkdir()
    elif kind == "empty":
        path.write_bytes(b"")
    elif kind == "other":  # one file of another checkpoint
        shutil.copy(folder / "other" / path.name, path)
    elif kind == "names":
        first, second = (work / name for name in FILES)
        content = first.read_bytes()
        shutil.copy(second, first)
        second.write_bytes(content)
    else:
        _drop_member(rng, work / FILES[0])
    return Case(
        (), f"{path.name}: {kind}", [path, work / FILES[0]], work, must_refuse,
        call=lambda: read_checkpoint(work, RUN), check=lambda: _complaint(folder / "sound", work),
    )  # fmt: skip


def _drop_member(rng: random.Random, path: Path) -> None:
    """Leave one array out of an archive, or put it there under the name of another."""
    with zipfile.ZipFile(path) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    name, other = rng.sample(sorted(members), 2)
    content = members.pop(name)
    if rng.random() < 0.5:
        members[name] = members[other]
        members[other] = content
    with zipfile.ZipFile(path, "w") as archive:
        for member, data in members.items():
            archive.writestr(member, data)


def _complaint(sound: Path, corrupted: Path) -> str | None:
    """Say what differs in a checkpoint that was accepted."""
    first, second = read_checkpoint(sound, RUN), read_checkpoint(corrupted, RUN)
    one, two = first.state.as_dict(), second.state.as_dict()
    if one.keys() != two.keys():
        return "other arrays"
    for name, array in one.items():
        if not np.array_equal(array, two[name], equal_nan=True):
            return f"other numbers in {name}"
    for a, b in zip(first.snapshots, second.snapshots, strict=True):
        if (a.time, a.energy) != (b.time, b.energy):
            return "another time or energy"
        if any(not np.array_equal(values, b.arrays[name]) for name, values in a.arrays.items()):
            return "another frame"
    return None
