"""Samples of scene entries: all combinations of listed values, or a Latin hypercube of ranges."""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Sequence
from dataclasses import dataclass

from scipy.stats import qmc

from lcmchain.errors import InputError
from lcmchain.quantities import units
from lcmchain.quantities.units import Dimension, QuantityError, parse_quantity
from lcmchain.study.source import Variant

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
