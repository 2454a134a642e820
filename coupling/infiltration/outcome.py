"""Why a filling ended, in words."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from lcmchain.coupling.infiltration.driven_flow import Stage
    from lcmchain.coupling.infiltration.filling import Filling
    from lcmchain.coupling.infiltration.situation import Situation


def share_in_words(share: float) -> str:
    """Say which share of the pores is filled; never 100 % where some are not."""
    if share < 0.9995:
        return f"only {share:.1%} of the pores are filled"
    left = 100.0 * (1.0 - share)
    if left < 1e-6:
        return "the pores are filled but for round-off"
    return f"all but {left:.1g} % of the pores are filled"


def idle_outcome(filling: Filling, situation: Situation, stage: Stage) -> tuple[str, str]:
    """Return outcome and message of a filling in which nothing moves any more."""
    state = filling.state
    time = f"{state.time:.6g} s"
    if state.full.all():
        return "filled", f"all pores are full after {time}"
    share = share_in_words(filling.filled_share)
    gelled = filling.liquid.gelled(state)
    if gelled.any():
        place = filling.mesh.points[gelled].mean(axis=0)
        where = ", ".join(f"{x:.6g}" for x in place)
        return "gelled", (
            f"the resin has gelled and the front stands still since {time} at the latest; {share}, "
            f"{int(gelled.sum())} nodes around ({where}) m have gelled; fill faster, with more "
            "gates or pressure, or cooler"
        )
    if not situation.gates:
        closed = ", ".join(gate.name for gate in filling.supply.gates)
        film = ", the film gives no more" if filling.film is not None else ""
        ended = f"there is no gate{film} after {time}"
        if closed:
            ended = f"no gate is open after {time} ({closed}){film}"
        return "no_source", f"{ended} and the resin stands still; {share}"
    if not any(gate.ready for gate in situation.gates):
        return "no_source", f"no gate has a pressure above the air's after {time}; {share}"
    dry = np.flatnonzero(~state.full)
    where = ", ".join(f"{x:.6g}" for x in filling.mesh.points[dry].mean(axis=0))
    return "trapped", (
        f"the front stands still since {time}; {share}, {len(dry)} nodes around ({where}) m stay "
        "dry: the air there holds the resin back, or the gates' pressure does not exceed the vents'"
    )
