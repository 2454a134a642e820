"""The state of a forming unit at a communication point, for rollback and for storing it."""

from __future__ import annotations

import io
import json
from dataclasses import dataclass
from typing import Any

import numpy as np

from lcmchain.fingerprint import Fingerprint
from lcmchain.solver.simulation import Snapshot
from lcmchain.state import State


@dataclass(frozen=True)
class SavedState:
    """Everything of a unit that a rollback brings back.

    Parameters
    ----------
    guid : of the unit, so that the state of another one is refused.
    fingerprint : of what decides the numbers, so that a state is not resumed with other mesh files
        or other sources of lcmchain, which the guid does not tell apart.
    state : of the simulation, None before initialization.
    critical_step : stable time step [s].
    values : of parameters and inputs, by name.
    start_time : of the experiment [s].
    frames : saved for ``forming.nc`` so far.
    failure : what stopped the last step, empty if it went well.
    """

    guid: str
    fingerprint: Fingerprint
    state: State | None
    critical_step: float
    values: dict[str, float | int | bool | str]
    start_time: float
    frames: tuple[Snapshot, ...]
    failure: str

    def to_bytes(self) -> bytes:
        """Return the state as the content of an ``npz`` file; the same state gives equal bytes."""
        header = {
            "guid": self.guid,
            "fingerprint": self.fingerprint._asdict(),
            "critical_step": self.critical_step,
            "values": self.values,
            "start_time": self.start_time,
            "failure": self.failure,
            "frame_time": [frame.time for frame in self.frames],
            "frame_energy": [frame.energy for frame in self.frames],
        }
        arrays: dict[str, Any] = {"header": np.array(json.dumps(header))}
        if self.state is not None:
            arrays |= {f"state_{name}": array for name, array in self.state.as_dict().items()}
        for number, frame in enumerate(self.frames):
            arrays |= {f"frame_{number}_{name}": array for name, array in frame.arrays.items()}
        buffer = io.BytesIO()
        np.savez(buffer, **arrays)
        return buffer.getvalue()

    @classmethod
    def from_bytes(cls, content: bytes) -> SavedState:
        """Read what :meth:`to_bytes` wrote."""
        with np.load(io.BytesIO(content), allow_pickle=False) as data:
            header = json.loads(str(data["header"]))
            arrays = _named(data, "state_")
            frames = tuple(
                Snapshot(time, energy, _named(data, f"frame_{number}_"))
                for number, (time, energy) in enumerate(
                    zip(header["frame_time"], header["frame_energy"], strict=True)
                )
            )
        return cls(
            guid=header["guid"],
            fingerprint=Fingerprint(**header["fingerprint"]),
            state=State.from_arrays(arrays) if arrays else None,
            critical_step=header["critical_step"],
            values=header["values"],
            start_time=header["start_time"],
            frames=frames,
            failure=header["failure"],
        )


def _named(data, prefix: str) -> dict[str, np.ndarray]:
    return {name[len(prefix) :]: data[name] for name in data.files if name.startswith(prefix)}
