"""What a co-simulation has cost and how it went, for ``summary.json`` and as a table."""

from __future__ import annotations

import os
import platform
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any

from lcmchain import __version__
from lcmchain.coupling.cosimulation.assembly import Assembly
from lcmchain.coupling.cosimulation.recorder import Recorder, final_values

if TYPE_CHECKING:
    from rich.table import Table


def summary_of(assembly: Assembly, recorder: Recorder, wall_s: float) -> dict[str, Any]:
    """Return the summary without its state, in plain values."""
    system, coupled = assembly.system, assembly.coupled
    history = coupled.history
    return {
        "lcmchain_version": __version__,
        "title": system.title,
        "system_sha256": system.digest(),
        "scheme": history.scheme,
        "time_reached_s": coupled.time,
        "stop_time_s": system.stop_time,
        "wall_s": wall_s,
        "window_count": len(history.accepted),
        "restart_count": history.restarts,
        "iteration_count": sum(window.iterations for window in history.windows),
        "mean_iterations": history.mean_iterations if history.accepted else None,
        "initial_loops": assembly.loops,
        "units": {name: _unit(part) for name, part in assembly.parts.items()},
        "connections": [link.name for link in assembly.links],
        "final_values": {name: _plain(value) for name, value in final_values(recorder).items()},
        "warnings": list(assembly.remarks),
        "run": {
            "process": os.getpid(),
            "host": platform.node(),
            "date": datetime.now(UTC).isoformat(timespec="seconds"),
        },
    }


def _unit(part: Any) -> dict[str, Any]:
    spent, description = part.spent, part.description
    return {
        "fmu": part.file.name,
        "fmu_sha256": part.sha256,
        "model_name": description.model_name,
        "fmi_version": description.fmi_version,
        "generation_tool": description.generation_tool,
        "process": "own" if part.apart else "shared",
        "step_count": spent.step_count,
        "save_count": spent.save_count,
        "rollback_count": spent.rollback_count,
        "discarded_step_count": spent.discard_count,
        "seconds": {
            "instantiation": spent.instantiation,
            "initialisation": spent.initialisation,
            "steps": spent.steps,
            "values": spent.exchange,
            "states": spent.states,
        },
    }


def _plain(value: Any) -> Any:
    return value.item() if hasattr(value, "item") else value


def cost_table(summary: dict[str, Any]) -> Table:
    """Return steps, rollbacks and times of the units as a table for the terminal."""
    from rich.table import Table

    table = Table(title=_headline(summary), title_justify="left")
    table.add_column("unit")
    for name in ("steps", "rollbacks", "begin [s]", "steps [s]", "values [s]", "states [s]"):
        table.add_column(name, justify="right")
    rest = summary["wall_s"]
    for name, unit in summary["units"].items():
        seconds = unit["seconds"]
        begin = seconds["instantiation"] + seconds["initialisation"]
        rest -= sum(seconds.values()) - begin
        table.add_row(
            name, f"{unit['step_count']:,}", f"{unit['rollback_count']:,}", f"{begin:.3f}",
            *(f"{seconds[key]:.3f}" for key in ("steps", "values", "states")),
        )  # fmt: skip
    table.add_row("master", "", "", "", f"{max(rest, 0.0):.3f}", "", "")
    return table


def _headline(summary: dict[str, Any]) -> str:
    windows = summary["window_count"]
    text = f"{summary['scheme']}: {windows:,} windows to {summary['time_reached_s']:g} s"
    if summary["iteration_count"] > windows:
        text += f", {summary['iteration_count']:,} iterations"
    if summary["restart_count"]:
        text += f", {summary['restart_count']:,} windows repeated"
    return text
