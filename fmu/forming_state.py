"""The state of a forming unit: of the simulation, of the coupling, and the frames saved so far."""

from __future__ import annotations

from dataclasses import asdict, fields
from typing import TYPE_CHECKING, Any

import numpy as np

from lcmchain.coupling.solids.explicit import SavedForming
from lcmchain.errors import InputError
from lcmchain.fmu.saved_state import PartState
from lcmchain.solver.simulation import Snapshot, StepControl
from lcmchain.state import State

if TYPE_CHECKING:
    from lcmchain.fmu.forming import FormingPart


# What a simulation keeps itself.
_OF_SIMULATION = ("state", "control")


def capture(part: FormingPart) -> PartState:
    """Return a copy of the state; what is never changed in place is shared."""
    state = part.simulation.state
    arrays = {f"state_{name}": array.copy() for name, array in state.as_dict().items()}
    arrays["before"] = part.before
    values: dict[str, Any] = {
        "critical_step": part.critical_step,
        "step": part.step,
        "control": asdict(part.simulation.control),
        "frame_time": [frame.time for frame in part.frames],
        "frame_energy": [frame.energy for frame in part.frames],
    }
    for number, frame in enumerate(part.frames):
        arrays |= {f"frame_{number}_{name}": array for name, array in frame.arrays.items()}
    if part.wet is not None:
        for name, value in _of_coupling(part.wet.save()).items():
            (arrays if isinstance(value, np.ndarray) else values)[f"wet_{name}"] = value
    return PartState(values, arrays)


def reinstate(part: FormingPart, saved: PartState) -> None:
    """Go back to a captured state.

    Raises
    ------
    InputError : it is that of another model.
    """
    values, arrays = saved.values, saved.arrays
    try:
        state = State.from_arrays(_named(arrays, "state_"))
        frames = tuple(
            Snapshot(float(time), dict(energy), _named(arrays, f"frame_{number}_"))
            for number, (time, energy) in enumerate(
                zip(values["frame_time"], values["frame_energy"], strict=True)
            )
        )
        control = StepControl(**values["control"])
        control.history = dict(control.history)
        before, step, critical = arrays["before"], values["step"], values["critical_step"]
        wet = None if part.wet is None else _wet(state, control, saved)
    except (KeyError, TypeError, ValueError) as error:
        raise InputError(f"the saved state is not that of a forming unit ({error})") from None
    if before.shape != part.simulation.state.position.shape:
        raise InputError("the saved state belongs to another model")
    if part.wet is None or wet is None:
        part.simulation.restore(state)
        part.simulation.control = control
    else:
        part.wet.restore(wet)
    part.before, part.step, part.critical_step = before, float(step), float(critical)
    part.frames = frames


def _wet(state: State, control: StepControl, saved: PartState) -> SavedForming:
    held = {**saved.arrays, **saved.values}
    names = [entry.name for entry in fields(SavedForming) if entry.name not in _OF_SIMULATION]
    return SavedForming(state, control, **{name: held[f"wet_{name}"] for name in names})


def _of_coupling(saved: SavedForming) -> dict[str, Any]:
    """What a part of a coupling keeps beside the state of its simulation."""
    return {
        entry.name: getattr(saved, entry.name)
        for entry in fields(saved)
        if entry.name not in _OF_SIMULATION
    }


def _named(arrays: dict[str, np.ndarray], prefix: str) -> dict[str, np.ndarray]:
    return {name[len(prefix) :]: a for name, a in arrays.items() if name.startswith(prefix)}
