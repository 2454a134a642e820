"""The message of a window that did not converge: which field, where, and by how much."""

from __future__ import annotations

from lcmchain.coupling.iteration.interface import Exchange
from lcmchain.coupling.iteration.measures import Judgement
from lcmchain.coupling.iteration.sweep import Sweep
from lcmchain.errors import SimulationError


class NotConverged(SimulationError):
    """A window whose exchanged fields do not agree after the allowed iterations.

    Parameters
    ----------
    message : in words.
    exchange : name of the exchange that is worst.
    value : number of its worst value on the target's mesh.
    residual, limit : reached and allowed, in the field's unit.
    """

    def __init__(
        self, message: str, *, exchange: str, value: int, residual: float, limit: float
    ) -> None:
        self.exchange, self.value = exchange, value
        self.residual, self.limit = residual, limit
        super().__init__(message)


class NotSettled(SimulationError):
    """A window in which what changes in jumps does not come to rest after the allowed iterations.

    Parameters
    ----------
    time, size : begin and size of the window [s].
    changing : what the last iteration has changed, in words.
    """

    def __init__(self, time: float, size: float, iterations: int, changing: list[str]) -> None:
        self.changing = changing
        super().__init__(
            f"what changes in jumps does not come to rest in {iterations} iterations of the window "
            f"of {size:g} s from {time:g} s: {'; '.join(changing)}"
        )


def not_converged(
    scheme: str,
    time: float,
    size: float,
    iterations: int,
    most_iterations: int,
    sweep: Sweep,
    judgements: list[Judgement],
) -> NotConverged:
    """Return the error of a window that begins at ``time``; its worst exchange is named first."""

    def excess(number: int) -> float:
        judgement = judgements[number]
        return judgement.residual / judgement.limit if judgement.limit > 0.0 else float("inf")

    failing = [i for i, judgement in enumerate(judgements) if not judgement.converged]
    failing.sort(key=lambda i: -excess(i))
    worst = failing[0]
    judgement, exchange = judgements[worst], sweep.exchanges[worst]
    place = _place_text(sweep, exchange, judgement.worst)
    others = [sweep.exchanges[i].name for i in failing[1:]]
    also = f" Also not converged: {', '.join(others)}." if others else ""
    diverged = "did not converge" if iterations == most_iterations else "diverged"
    message = (
        f"the coupling {diverged} ({scheme}) in {iterations} iterations of the window of "
        f"{size:g} s from {time:g} s: {exchange.name} still changes by {judgement.residual:.3g} "
        f"where {judgement.limit:.3g} is allowed ({excess(worst):.3g} times), most at value "
        f"{judgement.worst}{place} by {judgement.worst_residual:.3g}.{also} Likely cause: the "
        "parts answer to each other more strongly than the scheme can follow. Remedies: IQN-ILS in "
        "place of a relaxation, the fixed-stress split between solid and fluid, more iterations; "
        "smaller windows (WindowControl(smallest=...)) where the fields answer to each other the "
        "less the shorter a window is, which the pressure of an incompressible fluid does not"
    )
    return NotConverged(
        message,
        exchange=exchange.name,
        value=judgement.worst,
        residual=judgement.residual,
        limit=judgement.limit,
    )


def _place_text(sweep: Sweep, exchange: Exchange, value: int) -> str:
    """Return the place of a value in millimetres; the target's mesh knows it, else the source's."""
    sides = [(exchange.target, exchange.input)]
    if exchange.mapping is None:
        sides.append((exchange.source, exchange.field))
    for part, field in sides:
        places = sweep.places(part, field)
        if places is not None and value < len(places):
            x, y, z = 1e3 * places[value]
            return f" near ({x:.2f}, {y:.2f}, {z:.2f}) mm"
    return ""
