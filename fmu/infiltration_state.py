"""The state of an infiltration unit: the filling, its last inputs, and what was kept of its way."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from lcmchain.coupling.filling_part import SavedFilling
from lcmchain.coupling.infiltration.flow.state import DrySpot, FillingState
from lcmchain.coupling.iteration.checkpoint import flattened, restored
from lcmchain.errors import InputError
from lcmchain.fmu.infiltration_variables import FRONT
from lcmchain.fmu.saved_state import PartState

if TYPE_CHECKING:
    from lcmchain.fmu.infiltration import InfiltrationPart

RECORDS = {record.__name__: record for record in (SavedFilling, FillingState, DrySpot)}


def capture(part: InfiltrationPart) -> PartState:
    """Return a copy of the state; what is never changed in place is shared."""
    tree, kept = flattened(part.fluid.save())
    arrays = {f"filling {number}": array for number, array in enumerate(kept)}
    arrays |= {f"record {name}": array for name, array in part.record.arrays().items()}
    arrays["vented_rate"] = part.vented_rate
    return PartState({"tree": tree, "ended": list(part.ended)}, arrays)


def reinstate(part: InfiltrationPart, saved: PartState) -> None:
    """Go back to a captured state.

    Raises
    ------
    InputError : it is that of another filling.
    """
    mine, kept = flattened(part.fluid.save())
    arrays = _named(saved.arrays, "filling ")
    try:
        found = [arrays[str(number)] for number in range(len(arrays))]
        state = restored(saved.values["tree"], found, RECORDS)
        outcome, message = saved.values["ended"]
        FRONT[outcome]
        fits = isinstance(state, SavedFilling) and _shapes(state) == _shapes(
            restored(mine, kept, RECORDS)
        )
        vented = saved.arrays["vented_rate"]
        if not fits or vented.shape != part.vented_rate.shape:
            raise ValueError("it belongs to another part")
        part.record.take(_named(saved.arrays, "record "))
    except (KeyError, TypeError, ValueError, IndexError, AttributeError) as error:
        raise InputError(f"the saved state is not that of a filling ({error})") from None
    part.fluid.restore(state)
    part.ended, part.vented_rate = (str(outcome), str(message)), vented


def _shapes(saved: SavedFilling) -> dict[str, tuple[int, ...]]:
    """Shapes of all arrays whose number of values is that of the part."""
    own = {
        name: values.shape
        for name, values in vars(saved.state).items()
        if isinstance(values, np.ndarray)
    }
    own |= {f"input {name}": values.shape for name, values in saved.inputs.items()}
    pressures = {"mean": saved.mean_pressure.shape, "resisted": saved.resisted.shape}
    return own | pressures


def _named(arrays: dict[str, np.ndarray], prefix: str) -> dict[str, np.ndarray]:
    return {name[len(prefix) :]: a for name, a in arrays.items() if name.startswith(prefix)}
