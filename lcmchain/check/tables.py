"""Tables of the check for a terminal."""

from __future__ import annotations

from typing import TYPE_CHECKING

from lcmchain.check.effects_of_run import Effect
from lcmchain.check.expected_cost import Estimate
from lcmchain.check.quasi_static import PERIODS, ProcessTime
from lcmchain.check.tools_at_start import OVERLAP_TOLERANCE, InitialGap
from lcmchain.quantities.durations import duration_text
from lcmchain.scene import Process

if TYPE_CHECKING:
    from rich.table import Table


def _table(title: str, *columns: str) -> Table:
    from rich import box
    from rich.table import Table

    table = Table(title=title, title_justify="left", box=box.SIMPLE_HEAD, pad_edge=False)
    for column in columns:
        table.add_column(column, overflow="fold")
    return table


def _text(content: str):
    from rich.text import Text

    return Text(content)  # brackets in scene values are no markup


def entry_table(title: str, entries: list[tuple[str, str]]) -> Table:
    """Keys of a scene and their values."""
    table = _table(title, "key", "value")
    for key, value in entries:
        table.add_row(_text(key), _text(value))
    return table


def effect_table(effects: list[Effect]) -> Table:
    """Effects, whether they are simulated, and why."""
    table = _table("Effects", "effect", "", "why")
    for effect in effects:
        style = None if effect.active else "dim"
        table.add_row(
            _text(effect.name), "yes" if effect.active else "no", _text(effect.reason), style=style
        )
    return table


def gap_table(gaps: list[InitialGap], thickness: float) -> Table:
    """Gap of every tool to a blank of a thickness [m]."""
    table = _table("Tools at the start", "tool", "gap", "nearest node, mm")
    for gap in gaps:
        touching = abs(gap.gap) <= OVERLAP_TOLERANCE * thickness
        text = "touches" if touching else f"{1e3 * gap.gap:.3f} mm"
        place = ", ".join(f"{1e3 * coordinate:.1f}" for coordinate in gap.position)
        table.add_row(_text(gap.tool), text, place)
    return table


def cost_table(
    estimate: Estimate, process: Process, *, element_count: int, node_count: int
) -> Table:
    """Size of the mesh, steps and computing time."""
    table = _table("Expected cost", "", "")
    table.show_header = False
    table.add_row("elements", f"{element_count:,}")
    table.add_row("nodes", f"{node_count:,}")
    table.add_row("process time", f"{1e3 * process.time:g} ms, {process.frames} saved frames")
    table.add_row(
        "critical time step",
        f"{1e6 * estimate.critical_step:.3g} us at the start, set by {estimate.controlled_by}",
    )
    table.add_row("steps", f"about {estimate.step_count:,}")
    table.add_row(
        "computing time", f"about {duration_text(estimate.seconds)} on one core, once compiled"
    )
    return table


def process_time_table(needed: ProcessTime, process: Process) -> Table:
    """How long a quasi-static process of the sheet takes."""
    table = _table("Process time of a quasi-static run", "", "")
    table.show_header = False
    table.add_row("process.time", f"{1e3 * process.time:g} ms")
    table.add_row(
        "slowest shear vibration",
        f"{1e3 * needed.period:.3g} ms at rest, {1e3 * needed.softened_period:.3g} ms where the "
        "law is softest",
    )
    table.add_row(
        "needed",
        f"at least {1e3 * needed.least:.3g} ms ({PERIODS[0]} periods at rest); from "
        f"{1e3 * needed.sufficient:.3g} ms on ({PERIODS[1]} periods where softest) nothing should "
        "change any more",
    )
    for name, period in needed.holder_periods.items():
        table.add_row(f"{name} on the sheet", f"vibrates with {1e3 * period:.3g} ms")
    return table
