"""Which tools came to a stop of the press, or were stopped by a force, and which were not."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from lcmchain.state import STOPPED_TIME, STOPPED_TRAVEL

if TYPE_CHECKING:
    from lcmchain.model import Model
    from lcmchain.state import State
    from lcmchain.tools.table import ToolTable


def tables_of_tools(model: Model) -> list[ToolTable]:
    """Return the tools of every stage, or those of a process without stages."""
    return [stage.tools for stage in model.stages] or [model.tools]


def has_stops(model: Model) -> bool:
    """Tell whether a guided tool has a stop."""
    return any(bool(np.isfinite(tools.stop).any()) for tools in tables_of_tools(model))


def tool_stops(model: Model, state: State) -> dict[str, Any]:
    """Return what ``summary.json`` says of tools that were stopped; nothing where none was.

    Returns
    -------
    ``tool_stops``: by the name of the tool a list, in which each entry has ``time_s`` and
    ``travel_m``, when and where it was stopped first, and in a process with stages the ``stage``.
    """
    found: dict[str, list[dict[str, Any]]] = {}
    for tool, name in enumerate(model.tool_names):
        for number, stopped in enumerate(state.tool_stopped[tool]):
            if np.isfinite(stopped[STOPPED_TIME]):
                entry: dict[str, Any] = {"stage": model.stages[number].name} if model.stages else {}
                entry["time_s"] = float(stopped[STOPPED_TIME])
                entry["travel_m"] = float(stopped[STOPPED_TRAVEL])
                found.setdefault(name, []).append(entry)
    return {"tool_stops": found} if found else {}


def stop_warnings(model: Model, state: State) -> Iterator[str]:
    """Say which strokes went their whole way without the force that was to end them."""
    for number, tools in enumerate(tables_of_tools(model)):
        for tool in np.flatnonzero(np.isfinite(tools.until_force)).tolist():
            over = state.time >= tools.stroke_end[tool] * (1.0 - 1e-12)
            if over and np.isinf(state.tool_stopped[tool, number, STOPPED_TIME]):
                name = model.tool_names[tool]
                stage = f"stages.{model.stages[number].name}.motions.{name}" if model.stages else ""
                yield (
                    f"{name} went its whole stroke of {1e3 * abs(tools.stroke_distance[tool]):.4g} "
                    f"mm, and the sheet never pressed against it with "
                    f"{tools.until_force[tool]:.4g} N; give a longer distance or a smaller "
                    f"until_force in {stage or f'tools.{name}.motion'}"
                )
