"""Sweep: runs over any scene entries, with the numbers of each.

Listed values are combined, all with all; ranges are filled by a Latin hypercube.
"""

from __future__ import annotations

import csv
import itertools
import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import xarray as xr
from rich.table import Table
from scipy.stats import qmc

from lcmchain.atomic import replacing
from lcmchain.errors import InputError
from lcmchain.fields.netcdf_file import ROOT, write_netcdf
from lcmchain.quantities import units
from lcmchain.quantities.units import Dimension, QuantityError, parse_quantity
from lcmchain.study.results import RESULTS, plain_table, results_of
from lcmchain.study.runs import Progress, Study, Workers
from lcmchain.study.sources import Source, Variant

# --- samples of scene entries ---------------------------------------------------------------------


#: Seed of the Latin hypercube: the same command gives the same samples.
SEED = 20_240_607
#: Combinations of listed values, far above any use.
MOST_RUNS = 10_000
#: Kinds of quantities that entries of a scene are of.
DIMENSIONS = tuple(value for value in vars(units).values() if isinstance(value, Dimension))

#: A number in a text.
NUMBER = r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?"
# a unit may begin with 1, as in "200 1/s", but with no other digit: "100 60 mm" is a row
_QUANTITY = re.compile(rf"\s*({NUMBER})(?:\s+(1\s*/.*?)|\s*([^\d\s.,+-].*?))?\s*")


@dataclass(frozen=True)
class Entry:
    """A scene entry that a study varies.

    Parameters
    ----------
    key : dotted. values : texts to take; or, of a range, its two ends. is_range : which of both.
    """

    key: str
    values: tuple[str, ...]
    is_range: bool = False

    def at(self, part: float) -> str:
        """Return the value at a part, 0 to 1, of the range, with the unit of its ends."""
        (low, unit), (high, _) = (number_and_unit(text) for text in self.values)
        return with_unit(low + part * (high - low), unit)


def read_entry(text: str) -> Entry:
    """Read ``KEY=A|B|C`` or, as a range, ``KEY=A..B``.

    Raises
    ------
    InputError : a text of another form, or a range whose ends have unlike units.
    """
    key, separator, values = (part.strip() for part in text.partition("="))
    if not separator or not key or not values:
        raise InputError(
            f'"{text}" is neither KEY=A|B|C nor KEY=A..B; for example '
            '--vary "contact.friction=0.1..0.3" or --vary "blank.edge_length=10 mm|5 mm"',
            key="--vary",
        )
    if ".." not in values:
        listed = tuple(value.strip() for value in values.split("|"))
        if not all(listed):
            raise InputError(f'"{text}" has an empty value', key="--vary")
        return Entry(key, listed)
    low, _, high = (part.strip() for part in values.partition(".."))
    ends = [_QUANTITY.fullmatch(end) for end in (low, high)]
    if None in ends:
        raise InputError(f'"{values}" is no range of numbers such as 0.1..0.3', key="--vary")
    if number_and_unit(low)[1] != number_and_unit(high)[1]:
        raise InputError(
            f'the ends of "{values}" need the same unit, such as "4 mm..6 mm"', key="--vary"
        )
    return Entry(key, (low, high), is_range=True)


def number_and_unit(text: str) -> tuple[float, str]:
    """Return number and unit of a quantity; the unit is empty where there is none.

    Raises
    ------
    InputError : it is no number.
    """
    match = _QUANTITY.fullmatch(text.strip('"'))
    if match is None:
        raise InputError(f'"{text}" is no number with or without a unit', key="--vary")
    return float(match[1]), match[2] or match[3] or ""


def with_unit(number: float, unit: str) -> str:
    """Return a quantity as a scene entry."""
    return f'"{number:.9g} {unit}"' if unit else f"{number:.9g}"


def in_si(texts: Sequence[str]) -> tuple[list[float], str] | None:
    """Return quantities as numbers in SI with their unit, empty for plain numbers.

    None where one is neither a number nor a quantity of the same kind as the others.
    """
    try:
        used = {number_and_unit(text)[1] for text in texts}
    except InputError:
        return None
    if used == {""}:
        return [number_and_unit(text)[0] for text in texts], ""
    for dimension in DIMENSIONS:
        try:
            return [parse_quantity(t, dimension, is_size=False) for t in texts], dimension.unit
        except QuantityError:
            continue
    return None


def samples(entries: Sequence[Entry], count: int | None) -> list[Variant]:
    """Return the runs of a sweep.

    Listed values are combined with each other, all with all. Ranges are filled by a Latin
    hypercube of ``count`` points; with listed values beside them, every combination gets it.

    Raises
    ------
    InputError : no entry, one given twice, a value given twice, a range without ``count`` or
        ``count`` without a range, or far too many runs.
    """
    keys = [entry.key for entry in entries]
    if not entries:
        raise InputError("is missing: name what to vary, such as contact.friction=0.1|0.2|0.3",
                         key="--vary")  # fmt: skip
    if len(set(keys)) < len(keys):
        raise InputError("an entry is given twice", key="--vary")
    twice = [e.key for e in entries if len(set(e.values)) < len(e.values)]
    if twice:
        raise InputError(f"a value of {twice[0]} is given twice", key="--vary")
    ranges = [entry for entry in entries if entry.is_range]
    listed = [entry for entry in entries if not entry.is_range]
    if ranges and not count:
        raise InputError("a range needs it: how many samples to take", key="--samples")
    if count and not ranges:
        raise InputError(
            "is for ranges A..B, and no entry has one; leave it out, or give a range",
            key="--samples",
        )
    runs = math.prod(len(entry.values) for entry in listed) * (count or 1 if ranges else 1)
    if runs > MOST_RUNS:
        raise InputError(f"that would be {runs:,} runs, more than {MOST_RUNS:,}", key="--vary")
    points = [[]] if not ranges else hypercube(ranges, int(count or 0))
    variants: list[Variant] = []
    for combination in itertools.product(*(entry.values for entry in listed)):
        for point in points:
            pairs = [*zip(listed, combination, strict=True), *zip(ranges, point, strict=True)]
            overrides = tuple(f"{entry.key}={value}" for entry, value in pairs)
            # no running number: a value that is added leaves the names of the others as they are
            name = ", ".join(text.replace('"', "") for text in overrides)
            variants.append(Variant(name, "sweep", overrides))
    return variants


def hypercube(ranges: Sequence[Entry], count: int) -> list[list[str]]:
    """Return the values of a Latin hypercube of ``count`` points, the same at every call."""
    points = qmc.LatinHypercube(len(ranges), rng=SEED).random(count)
    return [[entry.at(part) for entry, part in zip(ranges, p, strict=True)] for p in points]


# --- runs, table and files ------------------------------------------------------------------------


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
    folder: Path | str,
    entries: Sequence[Entry],
    *,
    count: int | None = None,
    workers: Workers | None = None,
    progress: Progress | None = None,
) -> list[SweptRun]:
    """Run a scene over values of its entries.

    Raises
    ------
    InputError : as :func:`lcmchain.study.sweep.samples`, or a value that the scene refuses.
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


def write_sweep(folder: Path | str, title: str, runs: Sequence[SweptRun]) -> list[Path]:
    """Write ``sweep.csv`` and ``sweep.nc``, numbers in SI; return the files."""
    table, data = Path(folder) / "sweep.csv", Path(folder) / "sweep.nc"
    names = [r.name for r in RESULTS]
    keys = list(runs[0].entries)
    numbers_in_si = {
        r.name: (
            "run",
            [run.results[r.name] for run in runs],
            {"units": r.si_unit, "long_name": r.title},
        )
        for r in RESULTS
    }
    with replacing(table) as temporary, open(temporary, "w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow([*keys, *names, "seconds", "failure"])
        for run in runs:
            numbers = [f"{run.results[name]:.9g}" for name in names]
            writer.writerow([*run.entries.values(), *numbers, f"{run.seconds:.4g}", run.failure])
    dataset = xr.Dataset(
        {
            **{f"entry_{k.replace('.', '_')}": ("run", *_values(runs, k)) for k in keys},
            **numbers_in_si,
            "seconds": (
                "run",
                [run.seconds for run in runs],
                {"units": "s", "long_name": "computing time"},
            ),
            "failure": (
                "run",
                np.array([run.failure for run in runs], dtype=object),
                {"long_name": "why the run has no result, empty where it has"},
            ),
        },
        attrs={"title": title},
    )  # fmt: skip
    write_netcdf(data, {ROOT: dataset})
    return [table, data]


def _values(runs: Sequence[SweptRun], key: str) -> tuple[np.ndarray, dict[str, str]]:
    """Return the values of an entry, numbers in SI or else texts, and what is said of them."""
    texts = [run.entries[key] for run in runs]
    about = {"scene_entry": key}
    quantities = in_si(texts)
    if quantities is None:  # names of presets, or rows
        return np.array(texts), about
    numbers, unit = quantities
    return np.array(numbers), about | ({"units": unit} if unit else {})
