"""Tables of a study of accuracy: for the terminal, as Markdown, as CSV and as netCDF."""

from __future__ import annotations

import csv
import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import xarray as xr
from rich.table import Table

from lcmchain.atomic import replacing
from lcmchain.fields.netcdf_file import ROOT, write_netcdf
from lcmchain.study.accuracy import AccuracyStudy, Setting
from lcmchain.study.comparison import BY_NAME
from lcmchain.study.plain_table import plain_table, short

#: Mark of a setting that no other one beats in both error and time.
EFFICIENT = "*"
#: What stands in place of the errors of the reference.
REFERENCE = "reference"


def headings(study: AccuracyStudy) -> list[str]:
    """Return the headings of the columns."""
    errors = [f"{BY_NAME[q].title} [{BY_NAME[q].unit}]" for q in study.quantities]
    return ["setting", "varied", "elements", "steps", "time [s]", *errors]


def rows(study: AccuracyStudy) -> Iterator[list[str]]:
    """Yield the cells of every setting, quickest first, and of the reference."""
    efficient = {
        q: {setting.variant.name for setting in study.efficient(q)} for q in study.quantities
    }
    for setting in sorted(study.settings, key=lambda s: s.seconds):
        yield [*_head(setting), *_errors(study, setting, efficient)]
    yield [*_head(study.reference), *[REFERENCE for _ in study.quantities]]


def order_rows(study: AccuracyStudy) -> Iterator[list[str]]:
    """Yield quantity, observed order, and how far the scene's mesh is from the limit by it."""
    scene = next((s for s in study.settings if s.variant.name == study.as_it_is), None)
    for name in study.quantities:
        found = study.orders.get(name)
        if found is None or not math.isfinite(found.order):
            yield [BY_NAME[name].title, "none seen", "-"]
        else:
            size = scene.variant.value if scene is not None else None
            left = BY_NAME[name].text(found.error(size)) if size else "-"
            yield [BY_NAME[name].title, f"{found.order:.1f}", left]


def failures(study: AccuracyStudy) -> list[str]:
    """Say which settings gave no result, and why."""
    return [
        f"{s.variant.name}: no result, {s.outcome.failure}"
        for s in study.settings
        if s.outcome.failure
    ]


def terminal_table(study: AccuracyStudy) -> Table:
    """Return the table for the terminal."""
    table = plain_table(
        f"What accuracy costs: {study.title}",
        "setting", "time\ns", *(_short(q) for q in study.quantities),
        caption=f"root mean square over the sheet against the reference (last row); {EFFICIENT} no "
        "other setting\nis both quicker and nearer; those on its own mesh tell nothing of the mesh",
    )  # fmt: skip
    for name, _, _, _, seconds, *errors in rows(study):
        table.add_row(name, seconds, *("" if e == REFERENCE else e for e in errors))
    return table


def order_table(study: AccuracyStudy) -> Table:
    """Return the orders of convergence for the terminal."""
    names = ("quantity", "order", "error of the scene's mesh")
    table = plain_table("Convergence over the edge length", *names)
    for cells in order_rows(study):
        table.add_row(*cells)
    return table


def markdown(study: AccuracyStudy) -> str:
    """Return tables of errors and orders as Markdown."""
    names = headings(study)
    lines = [f"## {study.title}", ""]
    if study.sentence():
        lines += [study.sentence() + ".", ""]
    lines += [f"| {' | '.join(names)} |", "|---|---" + "|---:" * (len(names) - 2) + "|"]
    lines += [f"| {' | '.join(cells)} |" for cells in rows(study)]
    if study.orders:
        lines += ["", "| | order over the three finest meshes | error of the scene's mesh by it |"]
        lines += ["|---|---:|---:|", *(f"| {' | '.join(cells)} |" for cells in order_rows(study))]
    lines += ["", *(f"- {text}" for text in (*study.notes, *failures(study)))]
    return "\n".join(lines).rstrip() + "\n"


def write_csv(path: Path, study: AccuracyStudy) -> None:
    """Write a row per setting, with typical, high (95 %) and largest error in SI or as parts."""
    kinds = ("typical", "high", "largest")
    errors = [f"{q}_{kind}" for q in study.quantities for kind in kinds]
    with replacing(path) as temporary, open(temporary, "w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(
            ["setting", "varied", "overrides", "elements", "steps", "threads", "seconds", *errors,
             "failure"]
        )  # fmt: skip
        for setting in (*study.settings, study.reference):
            numbers = setting.outcome.numbers
            writer.writerow(
                [
                    setting.variant.name, setting.variant.axis,
                    "; ".join(setting.variant.overrides),
                    int(numbers.get("element_count", 0)), int(numbers.get("step_count", 0)),
                    setting.outcome.threads, f"{setting.seconds:.4g}",
                    *(f"{getattr(setting.errors[q], k):.6g}" for q in study.quantities
                      for k in kinds),
                    setting.outcome.failure,
                ]
            )  # fmt: skip


def write_study_netcdf(path: Path, study: AccuracyStudy) -> None:
    """Write times and errors over settings and quantities."""
    everything = (*study.settings, study.reference)
    kinds = ("typical", "high", "largest")
    error = np.array(
        [
            [[getattr(s.errors[q], kind) for kind in kinds] for q in study.quantities]
            for s in everything
        ]
    )
    about = "in SI, or as a part of the quantity; against the setting of the attribute reference"
    dataset = xr.Dataset(
        {
            "seconds": ("setting", [s.seconds for s in everything], {"units": "s"}),
            "error": (("setting", "quantity", "kind"), error, {"comment": about}),
            "element_count": (
                "setting", [s.outcome.numbers.get("element_count", np.nan) for s in everything],
            ),
            "step_count": (
                "setting", [s.outcome.numbers.get("step_count", np.nan) for s in everything],
            ),
            "order": (
                "quantity",
                [study.orders[q].order if q in study.orders else np.nan for q in study.quantities],
            ),
        },
        coords={
            "setting": [s.variant.name for s in everything],
            "quantity": study.quantities,
            "kind": list(kinds),
        },
        attrs={"title": study.title, "reference": study.reference.variant.name},
    )  # fmt: skip
    write_netcdf(path, {ROOT: dataset})


def _short(quantity: str) -> str:
    return f"{BY_NAME[quantity].short}\n{BY_NAME[quantity].unit}"


def _head(setting: Setting) -> list[str]:
    numbers = setting.outcome.numbers
    return [
        setting.variant.name,
        setting.variant.axis,
        f"{int(numbers['element_count']):,}" if "element_count" in numbers else "-",
        f"{int(numbers['step_count']):,}" if "step_count" in numbers else "-",
        f"{setting.seconds:.{3 if setting.seconds >= 1.0 else 2}g}",
    ]


def _errors(
    study: AccuracyStudy, setting: Setting, efficient: dict[str, set[str]]
) -> Iterator[str]:
    for name in study.quantities:
        error = setting.error(name)
        if math.isnan(error):
            yield "-"
            continue
        mark = EFFICIENT if setting.variant.name in efficient[name] else ""
        yield f"{short(BY_NAME[name].scale * error)}{mark}"
