"""What ``lcmchain run`` says at its end: numbers of ``summary.json``, warnings, where it lies."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from lcmchain.commands.terminal import console, say, warn_in_groups
from lcmchain.results import COMPLETE, all_warnings

if TYPE_CHECKING:
    from lcmchain.report.numbers import Number


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
    table.add_column(no_wrap=True)
    table.add_column(overflow="fold")
    for number in summary_rows(summary):
        table.add_row(Text(number.name), Text(number.in_words))
    console().print(table)


def summary_rows(summary: Mapping) -> Iterator[Number]:
    """Yield what matters first in a ``summary.json``, in words."""
    from lcmchain.report.chapters import filling_in_words
    from lcmchain.report.numbers import Number, key_numbers, ply_numbers

    if summary.get("state", COMPLETE) != COMPLETE:
        reached, total = 1e3 * summary["time_reached_s"], 1e3 * summary["process_time_s"]
        value = f"{reached:.4g} of {total:.4g} ms"
        yield Number("Reached", value, "the fields are of the last saved frame")
    yield from key_numbers(summary)
    yield from ply_numbers(summary)
    for name, report in summary["mapping"].items():
        yield Number(f"Mapping {name}", *_mapping_text(report))
    for name, report in summary.get("structure", {}).items():
        cells = f"{report['cell_count']:,} {'/'.join(report['elements'])} elements"
        yield Number(f"Structure {name}", cells, ", ".join(_structure_text(report)))
    for name, report in summary.get("infiltration", {}).items():
        cells = "failed" if "error" in report else f"{report['cell_count']:,} cells"
        yield Number(f"Infiltration {name}", cells, filling_in_words(report))


def _structure_text(report: Mapping) -> Iterator[str]:
    if not report["solved"]:
        yield "not solved"
    if report["displacement_max"] is not None:
        yield f"displaced by up to {1e3 * report['displacement_max']:.4g} mm"
    if report["eigenfrequencies"]:
        found = [f"{value:.4g}" for value in report["eigenfrequencies"][:3] if value is not None]
        yield f"eigenfrequencies {', '.join(found)} Hz"


def _mapping_text(report: Mapping) -> tuple[str, str]:
    if "error" in report:
        return "failed", ""
    return (
        f"{report['cell_count']:,} cells",
        f"{report['target_coverage']:.1%} of the target and {report['source_coverage']:.1%} of the "
        "sheet covered",
    )
