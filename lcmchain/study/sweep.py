"""Sweep: runs over any scene entries, with the numbers of each."""

from __future__ import annotations

import csv
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import xarray as xr
from rich.table import Table

from lcmchain.atomic import replacing
from lcmchain.errors import InputError
from lcmchain.fields.netcdf_file import ROOT, write_netcdf
from lcmchain.study.results import RESULTS, plain_table, results_of
from lcmchain.study.runs import Progress, Study, Workers
from lcmchain.study.sampling import Entry, in_si, number_and_unit, samples, with_unit
from lcmchain.study.source import Source, Variant


@dataclass(frozen=True, eq=False)
class SweptRun:
    """A run of a sweep: the value of each entry as text, its numbers by name, time, failure."""

    variant: Variant
    entries: dict[str, str]
    results: dict[str, float]
    seconds: float
    failure: str


def run_sweep(
    text: Source,
    folder: Path,
    entries: Sequence[Entry],
    *,
    count: int | None = None,
    workers: Workers | None = None,
    progress: Progress | None = None,
) -> list[SweptRun]:
    """Run a scene over values of its entries.

    Raises
    ------
    InputError : as :func:`lcmchain.study.sampling.samples`, or a value that the scene refuses.
    SimulationInterrupted : Ctrl-C; the same call goes on from what is there.
    """
    variants = samples(entries, count)
    outcomes = Study(text, folder, workers).outcomes(variants, progress)
    return [
        SweptRun(
            variant,
            dict(_key_and_value(override) for override in variant.overrides),
            results_of(outcomes[variant.name]),
            outcomes[variant.name].seconds,
            outcomes[variant.name].failure,
        )
        for variant in variants
    ]


def _key_and_value(override: str) -> tuple[str, str]:
    key, _, value = override.partition("=")
    return key, value.strip('"')


def known_results(runs: Sequence[SweptRun]) -> list:
    """Return the results that any run has."""
    return [r for r in RESULTS if any(math.isfinite(run.results[r.name]) for run in runs)]


def sweep_table(title: str, runs: Sequence[SweptRun]) -> Table:
    """Return the runs as a table for the terminal."""
    shown = known_results(runs)
    keys = [key.rpartition(".")[2].replace("_", " ") for key in runs[0].entries]
    table = plain_table(
        f"Sweep: {title}", *keys, *(r.heading for r in shown), "time\ns", names=len(keys)
    )
    for run in runs:
        numbers = [
            "failed" if run.failure else f"{r.scale * run.results[r.name]:.4g}" for r in shown
        ]
        values = [_shortened(value) for value in run.entries.values()]
        table.add_row(*values, *numbers, f"{run.seconds:.3g}")
    return table


def _shortened(value: str) -> str:
    """Return a quantity with four digits; names and lists as they are."""
    try:
        number, unit = number_and_unit(value)
    except InputError:
        return value
    return with_unit(float(f"{number:.4g}"), unit).strip('"')


def write_sweep(folder: Path, title: str, runs: Sequence[SweptRun]) -> list[Path]:
    """Write ``sweep.csv`` and ``sweep.nc``, numbers in SI; return the files."""
    table, data = folder / "sweep.csv", folder / "sweep.nc"
    names = [r.name for r in RESULTS]
    keys = list(runs[0].entries)
    with replacing(table) as temporary, open(temporary, "w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow([*keys, *names, "seconds", "failure"])
        for run in runs:
            numbers = [f"{run.results[name]:.9g}" for name in names]
            writer.writerow([*run.entries.values(), *numbers, f"{run.seconds:.4g}", run.failure])
    dataset = xr.Dataset(
        {
            **{f"entry_{k.replace('.', '_')}": ("run", *_values(runs, k)) for k in keys},
            **{n: ("run", [run.results[n] for run in runs], {"comment": "SI"}) for n in names},
            "seconds": ("run", [run.seconds for run in runs], {"units": "s"}),
        },
        attrs={"title": title},
    )  # fmt: skip
    write_netcdf(data, {ROOT: dataset})
    return [table, data]


def _values(runs: Sequence[SweptRun], key: str) -> tuple[np.ndarray, dict[str, str]]:
    """Return the values of an entry, numbers in SI or else texts, and what is said of them."""
    texts = [run.entries[key] for run in runs]
    about = {"scene_entry": key}
    found = in_si(texts)
    if found is None:  # names of presets, or rows
        return np.array(texts), about
    numbers, unit = found
    return np.array(numbers), about | ({"units": unit} if unit else {})
