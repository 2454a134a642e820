"""What ``lcmchain run`` says at its end: numbers of ``summary.json``, warnings, where it lies."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from pathlib import Path

from lcmchain.commands.terminal import console, say, warn_in_groups
from lcmchain.quantities.durations import duration_text, milliseconds_text
from lcmchain.results import COMPLETE, all_warnings


def print_result(summary: Mapping, folder: Path, *, quiet: bool = False) -> list[str]:
    """Print what a run has left, its warnings last; return them."""
    warnings = all_warnings(summary)
    if not quiet:
        _print_table(summary)
    warn_in_groups(warnings)
    if not quiet:
        say(f"Results in {folder}")
    return warnings


def _print_table(summary: Mapping) -> None:
    from rich import box
    from rich.table import Table
    from rich.text import Text

    table = Table(
        title=Text(summary["title"]), title_justify="left", box=box.SIMPLE_HEAD, pad_edge=False,
        show_header=False,
    )  # fmt: skip
    table.add_column(overflow="fold")
    table.add_column(overflow="fold")
    for name, text in summary_rows(summary):
        table.add_row(Text(name), Text(text))
    console().print(table)


def summary_rows(summary: Mapping) -> Iterator[tuple[str, str]]:
    """Yield name and value, in words, of what matters first in a ``summary.json``."""
    if summary.get("state", COMPLETE) != COMPLETE:
        reached, total = 1e3 * summary["time_reached_s"], 1e3 * summary["process_time_s"]
        yield "reached", f"{reached:.4g} of {total:.4g} ms; the fields are of the last saved frame"
    yield "shear angle", f"up to {math.degrees(summary['shear_angle_max_rad']):.1f} deg"
    if "thickness_min_m" in summary:
        low, high = 1e3 * summary["thickness_min_m"], 1e3 * summary["thickness_max_m"]
        yield "thickness", f"{low:.3f} to {high:.3f} mm"
    if "fibre_volume_fraction_max" in summary:
        yield "fibre volume fraction", f"up to {summary['fibre_volume_fraction_max']:.3f}"
    yield "fibre strain", f"up to {summary['fibre_strain_max']:.2%}"
    if "punch_force_max_N" in summary:
        yield "largest punch force", "".join(_punch_force(summary))
    if "process_time_needed_s" in summary:
        needed = summary["process_time_needed_s"]
        yield (
            "process time",
            f"{1e3 * summary['process_time_s']:g} ms; the sheet needs at least "
            f"{milliseconds_text(needed['least_s'])}, and "
            f"{milliseconds_text(needed['sufficient_s'])} to be safe",
        )
    yield (
        "energy balance",
        f"off by {summary['balance_error_max']:.2%} of the largest internal energy; kinetic "
        f"{summary['kinetic_to_internal_end']:.2%} of the internal energy at the end",
    )
    yield "steps", f"{summary['step_count']:,}, limited by {_step_control(summary)}"
    yield (
        "time",
        f"{duration_text(summary['wall_s'])} on {summary['threads']} threads, "
        f"{duration_text(summary['compile_s'])} of compiling before",
    )
    for name, report in summary["mapping"].items():
        yield f"mapping {name}", _mapping_text(report)
    for name, report in summary.get("structure", {}).items():
        yield f"structure {name}", "".join(_structure_text(report))


def _punch_force(summary: Mapping) -> Iterator[str]:
    """Yield the largest mean force, the peak, and what inertia and damping take of it."""
    yield f"{summary['punch_force_max_N']:.4g} N"
    if "tool_loads" not in summary:
        return
    yield f" as a mean, {summary['punch_force_peak_N']:.4g} N in a single step"
    parts = summary["tool_loads"][summary["punch"]].get("parts_at_maximum")
    if parts is not None:
        yield f"; around it damping takes {parts['damping_N']:.3g} N"
        yield f" and inertia {parts['inertia_N']:.3g} N of {parts['force_N']:.4g} N"


def _step_control(summary: Mapping) -> str:
    causes = sorted(summary["step_control"].items(), key=lambda item: -item[1])
    total = sum(summary["step_control"].values())
    return ", ".join(f"{cause} ({count / total:.0%})" for cause, count in causes)


def _structure_text(report: Mapping) -> Iterator[str]:
    yield f"{report['cell_count']:,} {'/'.join(report['elements'])} elements"
    if not report["solved"]:
        yield ", not solved"
    if report["displacement_max"] is not None:
        yield f", displaced by up to {1e3 * report['displacement_max']:.4g} mm"
    if report["eigenfrequencies"]:
        found = [f"{value:.4g}" for value in report["eigenfrequencies"][:3] if value is not None]
        yield f", eigenfrequencies {', '.join(found)} Hz"


def _mapping_text(report: Mapping) -> str:
    if "error" in report:
        return "failed"
    return (
        f"{report['cell_count']:,} cells, {report['target_coverage']:.1%} of the target and "
        f"{report['source_coverage']:.1%} of the sheet covered"
    )
