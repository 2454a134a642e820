"""Which rows of a test enter its fit, and from which zero they count.

A testing machine counts from where its operator pressed the button: ahead of the contact with the
specimen, or at a preload. A specimen slips in its clamps, and tears in the end. The choice of the
user is applied here to every specimen by itself, in this order: zeros, slip and tear, range. The
result lists all that was done, and its diagrams show the rows that were left out.

- **Contact**: rows ahead of it tell the zero of the load. The travel counts from where the line of
  the first rows behind it meets no load (:func:`contact_of`).
- **Preload**: the first row bears a load already. The travel counts from where the line of the
  first rows meets no load.
- **Slip**: an elastic specimen is the same at the peak before it and where the load is back, so
  that the travel between them was slip: it is taken off the rows behind.
- **Tear**: everything behind the last peak is left out.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from lcmchain.errors import InputError
from lcmchain.identification.data import Column, CouponData
from lcmchain.identification.regression import medians, relative_scatter
from lcmchain.identification.result import Identification, LeftOut, Points
from lcmchain.quantities.units import (
    ANGLE,
    FRACTION,
    LENGTH,
    QuantityError,
    parse_fraction,
    parse_quantity,
)

# --- what happens in a test -----------------------------------------------------------------------
# - Contact: the load of a machine that touches nothing scatters about a constant. The first rows
#   that do so tell the zero of the load, and the line of the first rows above that scatter the zero
#   of the travel.
# - Drop: the load falls while the machine travels on, by more than scatter explains. It comes
#   back where the specimen slipped in its clamps, and does not where it tore.


# Rows ahead of the contact that tell a zero, at least.
_LEAST_AHEAD = 5
# A row lies above the load ahead of the contact by so many times its scatter, and this part of the
# largest load, which only rounding stays below.
_ABOVE, _ROUNDING = 5.0, 1e-9
#: The line of the first rows behind the contact reaches a load of so many times the scatter.
_REACHES = 25.0
#: The line of the first rows from a preload on reaches so many times the preload.
_GROWS = 2.0
# A load drops where it is this part below its peak, and by so many times its scatter.
_DROP, _DROP_IN_NOISE = 0.03, 6.0
# Peaks below this part of the largest load are the start of a test; a machine that has travelled
# less than this part of its way stands still.
_SMALL, _STANDS = 0.1, 1e-4


class Drop(NamedTuple):
    """A load that falls: rows of the peak and of the first below it; where the load is back.

    back : first row at or above the load of the peak, None where it does not come back.
    """

    peak: int
    first: int
    back: int | None


def drops_of(driven: np.ndarray, load: np.ndarray) -> list[Drop]:
    """Return where the load of one specimen drops while it is driven on, shape [row_count] each.

    A row lies below the peak, the next one by half as much: a single low row is scatter.
    """
    found: list[Drop] = []
    start = 0
    noise = relative_scatter(load, medians(load)) if len(load) > 2 else 0.0
    while (drop := _next_drop(driven, load, start, noise)) is not None:
        found.append(drop)
        if drop.back is None:
            break
        start = drop.back
    return found


def _next_drop(driven: np.ndarray, load: np.ndarray, start: int, noise: float) -> Drop | None:
    if len(load) - start < 3:
        return None
    peak = np.maximum.accumulate(medians(load[start:]))[:-1]
    least = max(_DROP, _DROP_IN_NOISE * noise)
    # What is small against the whole test is the start of it.
    below, counts = 1.0 - load[start + 1 :] / np.maximum(peak, 1e-300), peak > _SMALL * load.max()
    for k in np.flatnonzero((below > least) & counts):
        if k + 1 < len(below) and below[k + 1] < 0.5 * least:
            continue
        first = start + int(k) + 1
        # The load of the peak itself; earlier rows above it are scatter.
        top = start + int(np.flatnonzero(load[start:first] >= peak[k])[-1])
        if driven[first] - driven[top] <= _STANDS * np.ptp(driven):
            continue  # the machine stands still, and the specimen relaxes
        later = np.flatnonzero(load[first:] >= load[top])
        return Drop(top, first, first + int(later[0]) if len(later) else None)
    return None


class Contact(NamedTuple):
    """Rows ahead of the contact, the load that they read, and its scatter."""

    ahead: int
    load: float
    scatter: float


def contact_of(load: np.ndarray) -> Contact | None:
    """Return how many first rows bear nothing; None where the load rises from the first row on."""
    if len(load) < _LEAST_AHEAD + 2:
        return None
    rounding = _ROUNDING * float(np.ptp(load))

    def scatter_of(count: int) -> float:
        # Second differences do not see a rise.
        return math.sqrt(float(np.mean(np.diff(load[:count], 2) ** 2)) / 6.0)

    place = np.arange(_LEAST_AHEAD) - 0.5 * (_LEAST_AHEAD - 1)
    slope = float(place @ load[:_LEAST_AHEAD] / (place @ place))
    error = scatter_of(_LEAST_AHEAD) / math.sqrt(place @ place)
    if abs(slope) > _ABOVE * error + rounding:
        return None
    ahead = _LEAST_AHEAD
    while ahead < len(load):
        limit = load[:ahead].mean() + _ABOVE * scatter_of(ahead) + rounding
        if np.all(load[ahead : ahead + 2] > limit):
            break
        ahead += 1
    if ahead == len(load):
        return None
    return Contact(ahead, float(load[:ahead].mean()), scatter_of(ahead))


def _met_zero(travel: np.ndarray, load: np.ndarray, first: int, until: float) -> tuple[float, int]:
    """Return where the line of the first loaded rows meets no load, and of how many rows it is.

    travel, load : of one specimen, shape [row_count]; the load counts from its zero.
    first : row at which the line begins. until : load that it reaches, in two rows at least.
    """
    grown = np.flatnonzero(load[first + 1 :] >= until)
    last = first + 1 + (int(grown[0]) if len(grown) else len(load) - first - 2)
    x, y = travel[first : last + 1], load[first : last + 1]
    slope, level = np.polyfit(x - x[0], y, 1)
    return float(x[0] - level / slope) if slope > 0.0 else float(x[0]), len(x)


# --- what is asked for, and what enters -----------------------------------------------------------


ZERO, WITHOUT, RANGE = "--zero", "--without", "--range"
CONTACT, PRELOAD = "contact", "preload"
SLIP, TEAR = "slip", "tear"
BEFORE, OUTSIDE = "before contact", "outside the range"
# Limits of a range take in what the conversion of units leaves of them.
_SAME = 1e-9
_RANGE = re.compile(
    r"(?:(?P<who>[^:]*):)?\s*(?:up to\s+(?P<upto>.+)|from\s+(?P<start>.+)"
    r"|(?P<low>.+?)\s+to\s+(?P<high>.+))\s*"
)
#: Column -> axis label of the diagrams, unit, factor from SI units.
SHOWN = {
    "displacement": ("displacement [mm]", "mm", 1e3),
    "thickness": ("thickness [mm]", "mm", 1e3),
    "fibre volume fraction": ("fibre volume fraction", "%", 100.0),
    "shear angle": ("shear angle [deg]", "deg", 180.0 / math.pi),
    "force": ("force [N]", "N", 1.0),
    "pressure": ("pressure [MPa]", "MPa", 1e-6),
}


@dataclass(frozen=True)
class RowChoice:
    """What a user chooses of the rows before a fit; all as they are by default.

    Attributes
    ----------
    zero : ``"contact"``, ``"preload"``, or readings at zero as ``"force=0.4 N"``, with commas.
    without : ``"slip"``, ``"tear"`` or both.
    ranges : as ``"2 mm to 40 mm"``, ``"up to 40 mm"``, ``"from 2 mm"``; with the name of a specimen
        in front, as ``"A: 2 mm to 40 mm"``, for it alone.
    """

    zero: str | None = None
    without: str | None = None
    ranges: tuple[str, ...] = ()


class Axes(NamedTuple):
    """Columns of a kind of tests: what is driven, and what bears.

    remembers : whether a row depends on all rows before it, none of which may then go.
    drawn : column of the diagrams where it is not the driven one, and what turns that into it.
    """

    driven: Column
    load: Column
    remembers: bool = False
    drawn: tuple[str, Callable[[np.ndarray], np.ndarray]] | None = None

    @property
    def is_travel(self) -> bool:
        """Whether the driven column counts the travel of a machine from some zero."""
        return self.driven.dimension is LENGTH and self.driven.loading > 0


class Entering(NamedTuple):
    """Rows that enter a fit.

    told : (name, value, origin) of everything that was done, for the table of inputs.
    """

    data: CouponData
    told: tuple[tuple[str, str, str], ...]
    left_out: tuple[LeftOut, ...]


def entering_rows(data: CouponData, axes: Axes, choice: RowChoice, fewest: int) -> Entering:
    """Return the rows of a file that enter the fit, counted from the zeros that were asked for.

    Parameters
    ----------
    data : all rows. axes : which columns are driven and bear the load.
    choice : of the user. fewest : rows that a fit needs.

    Raises
    ------
    InputError : an option that cannot be read or that does not suit the test, a zero that the rows
        do not tell, a specimen that is not there, or too few rows in the end.
    """
    work = _Work(data, axes)
    if choice.zero is not None:
        work.shift(choice.zero)
    if choice.without is not None:
        work.drop(choice.without)
    if choice.ranges:
        work.cut(choice.ranges)
    kept = work.data.keep(work.stays)
    if len(kept.lines) < fewest and len(kept.lines) < len(data.lines):
        raise InputError(
            f"{len(kept.lines)} of {len(data.lines)} rows are left; at least {fewest} are needed",
            key=RANGE if choice.ranges else WITHOUT, file=data.file,
        )  # fmt: skip
    return Entering(kept, tuple(work.told), tuple(work.left_out))


def found_drops(data: CouponData, axes: Axes) -> list[tuple[str, str]]:
    """Return what drops in a file, as the word for it and the sentence that tells it."""
    work, found = _Work(data, axes), []
    for rows in work.specimens():
        for drop in work.drops(rows):
            found.append((TEAR if drop.back is None else SLIP, work.words(rows, drop)))
    return found


def with_left_out(
    result: Identification, left_out: Sequence[LeftOut], axes: Axes
) -> Identification:
    """Return a result that lists and draws the rows which did not enter it."""
    if not left_out:
        return result
    name, turned = axes.drawn or (axes.driven.name, np.asarray)
    x_label, _, x_factor = SHOWN[name]
    y_label, _, y_factor = SHOWN[axes.load.name]
    grey = tuple(
        Points(x_factor * turned(one.driven), y_factor * one.load, one.why) for one in left_out
    )
    panels = tuple(
        replace(panel, left_out=grey)
        if (panel.x_label, panel.y_label) == (x_label, y_label) else panel
        for panel in result.panels
    )  # fmt: skip
    return replace(result, panels=panels, left_out=tuple(left_out))


class _Work:
    """The rows of a file while zeros, drops and ranges are applied to them."""

    def __init__(self, data: CouponData, axes: Axes) -> None:
        self.data, self.axes = data, axes
        self.stays = np.ones(len(data.lines), dtype=bool)
        self.told: list[tuple[str, str, str]] = []
        self.left_out: list[LeftOut] = []

    def specimens(self) -> list[np.ndarray]:
        numbers = self.data.specimen
        return [np.flatnonzero(numbers == number) for number in np.unique(numbers)]

    @property
    def several(self) -> bool:
        return len(np.unique(self.data.specimen)) > 1

    def name(self, rows: np.ndarray) -> str:
        """Return " of specimen A" where a file has several, else nothing."""
        return f" of specimen {self.data.name_of(rows[0])}" if self.several else ""

    def leave_out(self, rows: np.ndarray, why: str) -> None:
        """Note rows that do not enter the fit."""
        if not len(rows):
            return
        driven, load = self.data[self.axes.driven.name], self.data[self.axes.load.name]
        name = self.data.name_of(rows[0]) if self.several else ""
        self.left_out.append(
            LeftOut(why, name, self.data.lines[rows], driven[rows], load[rows])
        )  # fmt: skip
        _, unit, factor = SHOWN[self.axes.driven.name]
        ends = factor * driven[rows].min(), factor * driven[rows].max()
        self.told.append(
            (f"left out{self.name(rows)}",
             f"{len(rows)} rows, {ends[0]:.5g} to {ends[1]:.5g} {unit}, lines "
             f"{self.data.lines[rows].min()} to {self.data.lines[rows].max()}", why)
        )  # fmt: skip

    # --- zeros

    def shift(self, text: str) -> None:
        """Move load and driven column to the zeros that ``--zero`` asks for."""
        for part in filter(None, (part.strip() for part in text.split(","))):
            name, given, value = (piece.strip() for piece in part.partition("="))
            if given:
                self._shift_by(name.lower(), value)
            elif part == CONTACT:
                self._find_contact()
            elif part == PRELOAD:
                self._find_preload()
            else:
                raise InputError(
                    f'"{part}" is no zero; write {self._zeros()}', key=ZERO, file=self.data.file
                )
        if not self.axes.is_travel:
            return
        # They stay among the rows, where times count from them; no fit looks at them.
        for rows in self.specimens():
            self.leave_out(rows[self.data[self.axes.driven.name][rows] <= 0.0], BEFORE)

    def _zeros(self) -> str:
        load = self.axes.load
        words = [CONTACT, *([PRELOAD] if self.axes.is_travel else [])]
        return " or ".join([*words, f'"{load.name}={load.dimension.example}"'])

    def _shift_by(self, name: str, text: str) -> None:
        columns = {
            column.name: column for column in (self.axes.driven, self.axes.load)
            if column.dimension is not FRACTION
        }  # fmt: skip
        if name not in columns:
            raise InputError(
                f'"{name}" has no zero here; write {" or ".join(columns)}',
                key=ZERO, file=self.data.file,
            )  # fmt: skip
        try:
            value = parse_quantity(text, columns[name].dimension, is_size=False)
        except QuantityError as error:
            raise InputError(str(error), key=ZERO) from None
        self.data = self.data.shifted(name, np.full(len(self.data.lines), value))
        self.told.append((f"zero of {name}", f"reads {text}", f"given, {ZERO}"))

    def _find_contact(self) -> None:
        driven, load = self.axes.driven.name, self.axes.load.name
        zero_load, zero_travel = np.zeros(len(self.data.lines)), np.zeros(len(self.data.lines))
        told = []
        for rows in self.specimens():
            loads = self.data[load][rows]
            contact = contact_of(loads)
            if contact is None:
                raise InputError(
                    f"the {load}{self.name(rows)} rises from the first row on: the zero is told by "
                    f"at least {_LEAST_AHEAD} rows ahead of the contact. Give it as "
                    f'{ZERO} "{load}={self.axes.load.dimension.example}"'
                    + (f", or {ZERO} {PRELOAD}" if self.axes.is_travel else ""),
                    key=ZERO, file=self.data.file,
                )  # fmt: skip
            zero_load[rows] = contact.load
            _, unit, factor = SHOWN[load]
            told.append(
                (f"zero of {load}{self.name(rows)}", f"reads {factor * contact.load:.5g} {unit}",
                 f"{CONTACT}: mean of {contact.ahead} rows ahead of it, which scatter by "
                 f"{factor * contact.scatter:.2g} {unit}")
            )  # fmt: skip
            if not self.axes.is_travel:
                continue
            travel = self.data[driven][rows]
            place, count = _met_zero(
                travel, loads - contact.load, contact.ahead, _REACHES * contact.scatter
            )
            # The specimen has borne nothing before the first row that is above the scatter.
            place = float(np.clip(place, travel[0], travel[contact.ahead]))
            zero_travel[rows] = place
            told.append(
                (f"zero of {driven}{self.name(rows)}", f"reads {1e3 * place:.5g} mm",
                 f"{CONTACT}: the line of {count} rows from line "
                 f"{self.data.lines[rows[contact.ahead]]} on meets the zero of the {load}")
            )  # fmt: skip
        self.data = self.data.shifted(load, zero_load)
        self.told += told
        if self.axes.is_travel:
            self.data = self.data.shifted(driven, zero_travel)

    def _find_preload(self) -> None:
        driven, load = self.axes.driven.name, self.axes.load.name
        if not self.axes.is_travel:
            raise InputError(
                f"{PRELOAD} tells the zero of a travel; a {driven} has none to be found",
                key=ZERO, file=self.data.file,
            )  # fmt: skip
        zero = np.zeros(len(self.data.lines))
        _, unit, factor = SHOWN[load]
        for rows in self.specimens():
            loads, travel = self.data[load][rows], self.data[driven][rows]
            if len(rows) < 3 or loads[0] <= 0.0:
                raise InputError(
                    f"the first row{self.name(rows)} bears {factor * loads[0]:.4g} {unit}, which "
                    f"is no preload; write {ZERO} {CONTACT} for rows ahead of the contact",
                    key=ZERO, file=self.data.file,
                )  # fmt: skip
            place, count = _met_zero(travel, loads, 0, _GROWS * loads[0])
            zero[rows] = place
            self.told.append(
                (f"zero of {driven}{self.name(rows)}", f"reads {1e3 * place:.5g} mm",
                 f"{PRELOAD} of {factor * loads[0]:.4g} {unit}: the line of the first {count} rows "
                 "meets no load")
            )  # fmt: skip
        self.data = self.data.shifted(driven, zero)

    # --- slip and tear

    def drops(self, rows: np.ndarray) -> list[Drop]:
        driven = self.axes.driven.loading * self.data[self.axes.driven.name][rows]
        return drops_of(driven, self.data[self.axes.load.name][rows])

    def words(self, rows: np.ndarray, drop: Drop) -> str:
        """Say what drops in a specimen, with numbers."""
        load, driven = self.data[self.axes.load.name][rows], self.data[self.axes.driven.name][rows]
        _, unit, factor = SHOWN[self.axes.load.name]
        _, of_way, way = SHOWN[self.axes.driven.name]
        end = len(rows) if drop.back is None else drop.back
        least = load[drop.first : end].min()
        said = (
            f"the {self.axes.load.name}{self.name(rows)} falls from {factor * load[drop.peak]:.4g} "
            f"to {factor * least:.4g} {unit} behind {way * driven[drop.peak]:.4g} {of_way} (line "
            f"{self.data.lines[rows[drop.peak]]}) and "
        )
        if drop.back is None:
            return said + "does not come back"
        return said + (
            f"is back at {way * driven[drop.back]:.4g} {of_way} (line "
            f"{self.data.lines[rows[drop.back]]})"
        )

    def drop(self, text: str) -> None:
        """Leave out slip and tear, as ``--without`` asks."""
        kinds = {part.strip() for part in text.split(",") if part.strip()}
        if not kinds or kinds - {SLIP, TEAR}:
            raise InputError(f'"{text}" is not {SLIP}, {TEAR} or "{SLIP},{TEAR}"', key=WITHOUT)
        if self.axes.remembers:
            raise InputError(
                f"later rows depend on a slip here, and loads relax; end the test by {RANGE}",
                key=WITHOUT,
            )
        found = 0
        for rows in self.specimens():
            for drop in self.drops(rows):
                kind = TEAR if drop.back is None else SLIP
                if kind in kinds:
                    found += 1
                    self._leave_drop(rows, drop, kind)
        if not found:
            self.told.append((" and ".join(sorted(kinds)), "none found", f"given, {WITHOUT}"))

    def _leave_drop(self, rows: np.ndarray, drop: Drop, kind: str) -> None:
        load, driven = self.data[self.axes.load.name][rows], self.data[self.axes.driven.name][rows]
        words, end = self.words(rows, drop), len(rows) if drop.back is None else drop.back
        out = rows[drop.peak + 1 : end]
        self.stays[out] = False
        self.leave_out(out, f"{kind}: {words}")
        if drop.back is None or not self.axes.is_travel:
            return
        # The same load, the same state: what the machine has travelled between was slip.
        share = (load[drop.peak] - load[end - 1]) / (load[end] - load[end - 1])
        back = driven[end - 1] + share * (driven[end] - driven[end - 1])
        slip = float(back - driven[drop.peak])
        less = np.zeros(len(self.data.lines))
        less[rows[end:]] = slip
        self.data = self.data.shifted(self.axes.driven.name, less)
        self.told.append(
            (f"slip{self.name(rows)}", f"{1e3 * slip:.4g} mm",
             f"taken off the {self.axes.driven.name} from line {self.data.lines[rows[end]]} on")
        )  # fmt: skip

    # --- range

    def cut(self, texts: Sequence[str]) -> None:
        """Leave out what lies outside the ranges that ``--range`` asks for."""
        driven = self.data[self.axes.driven.name]
        for text in texts:
            rows, low, high, starts = self._range(text)
            if self.axes.remembers and starts:
                raise InputError(
                    f'"{text}" leaves out the beginning, on which all later rows depend here; '
                    f'write "up to {self._example()}"',
                    key=RANGE,
                )
            inside = (driven >= low) & (driven <= high)
            out = rows[~inside[rows] & self.stays[rows]]
            noted = [line for one in self.left_out for line in one.lines]
            self.stays[out] = False
            self.told.append(("range", text, f"given, {RANGE}"))
            for of_specimen in self.specimens():
                mine = np.intersect1d(out, of_specimen)
                mine = mine[~np.isin(self.data.lines[mine], noted)]
                for side in (mine[driven[mine] < low], mine[driven[mine] > high]):
                    self.leave_out(side, OUTSIDE)

    def _example(self) -> str:
        return {ANGLE: "40 deg", FRACTION: "55 %"}.get(self.axes.driven.dimension, "40 mm")

    def _range(self, text: str) -> tuple[np.ndarray, float, float, bool]:
        """Return rows and ends [SI] of a range, and whether it leaves out the beginning."""
        match = _RANGE.fullmatch(text.strip())
        if match is None:
            raise InputError(
                f'"{text}" is no range of the {self.axes.driven.name}; write "up to '
                f'{self._example()}", "from ..." or "... to ...", with "NAME: " ahead for one '
                "specimen",
                key=RANGE,
            )
        start, end = match["start"] or match["low"], match["upto"] or match["high"]
        open_end = math.inf * self.axes.driven.loading  # a gap closes from its largest value on
        begin = -open_end if start is None else self._place(start)
        stop = open_end if end is None else self._place(end)
        low, high = min(begin, stop), max(begin, stop)
        small = _SAME * max(abs(v) for v in (low, high, 0.0) if math.isfinite(v))
        rows = np.arange(len(self.data.lines))
        if match["who"] is not None:
            rows = self._of_name(match["who"].strip())
        return rows, low - small, high + small, start is not None

    def _place(self, text: str) -> float:
        try:
            if self.axes.driven.dimension is FRACTION:
                return parse_fraction(text.strip())
            return parse_quantity(text.strip(), self.axes.driven.dimension, is_size=False)
        except QuantityError as error:
            raise InputError(
                f"in the axis of this test, {self.axes.driven.name}: {error}", key=RANGE
            ) from None

    def _of_name(self, name: str) -> np.ndarray:
        for rows in self.specimens():
            known = self.data.name_of(rows[0])
            if known == name or (known.isdigit() and name.isdigit() and int(known) == int(name)):
                return rows
        names = ", ".join(self.data.name_of(rows[0]) for rows in self.specimens())
        raise InputError(
            f'there is no specimen "{name}"; there are {names}', key=RANGE, file=self.data.file
        )
