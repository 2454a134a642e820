"""Whether friction after Dahl describes loops, branch by branch.

The misfit is looked at along the way there and back on both sides, in parts of the largest value
and of the friction; from branch to branch; and over the rate, where a file tells the time. A
dashpot, a shifted zero, loops that change from one to the next, or a specimen that tears are no
friction of that kind.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from lcmchain.identification.loops.fit import LoopFit, Loops
from lcmchain.identification.regression import LackOfFit, falling_row, lack_of_fit

#: Mean deviation of a band that matters, over the largest value, and over the friction.
TOLERANCE, TOLERANCE_OF_FRICTION = 0.05, 0.1
# Slower than this part of the largest rate a test turns round: no test at another rate.
_CRAWL = 0.05
_MOST_RANGES = 12


@dataclass(frozen=True)
class Words:
    """How a test is spoken of: quantity, unit and factor of the way, and of what is measured."""

    place: str
    unit: str
    factor: float
    measured: str


@dataclass(frozen=True)
class Judgement:
    """Whether a law describes its loops, and over which rows it does.

    blocks : of rows that err together, shape [row_count]; None if errors are noise.
    """

    objections: tuple[str, ...]
    holds: str
    blocks: np.ndarray | None


def judge(
    law: LoopFit, words: Words, noise_floor: float, refit: Callable[[Loops], LoopFit]
) -> Judgement:
    """Judge a law branch by branch.

    refit : fits the same law to fewer rows.
    """
    objections, blocks = _objections(law, words, noise_floor)
    return Judgement(
        tuple(objections),
        _range_that_holds(law, words, noise_floor, refit) if objections else "",
        blocks,
    )


def _objections(
    law: LoopFit, words: Words, noise_floor: float
) -> tuple[list[str], np.ndarray | None]:
    loops, found = law.loops, []
    side = np.where(loops.place < 0.0, -1.0, 1.0)
    sense = np.sign(loops.ways.sum(axis=1))
    away = side * sense >= 0.0
    fallen = _fallen(loops, side, away, noise_floor)
    if fallen is not None:
        found.append(
            f"the {words.measured} falls at line {loops.data.lines[fallen]} while the "
            f"{words.place} goes on: the specimen tore or slipped, or resists a rate that falls"
        )
    blocks, first = np.zeros(len(side), dtype=int), 0
    missed: list[tuple[bool, float, str]] = []
    for one in (1.0, -1.0):
        for out in (True, False):
            rows = (side == one) & (away == out)
            if not rows.any():
                continue
            name = (
                f"on the way {'away from' if out else 'back to'} zero on the "
                f"{'positive' if one > 0.0 else 'negative'} side the law"
            )
            # on the way back its side counts, whatever the sign of the moment
            of_value, of_friction = _lacks(law, rows, np.abs(loops.place[rows]), one)
            blocks[rows] = first + of_value.band
            first = int(blocks[rows].max()) + 1
            for lack, of in (
                (of_value, f" of the largest {words.measured}"),
                (of_friction, " of the friction"),
            ):
                if lack is not None and lack.is_systematic:
                    told = lack.text(name, f"the {words.place}", words.unit, words.factor, of=of)
                    worst = float(np.abs(lack.deviation[lack.off]).max())
                    missed.append((lack is of_value, worst, told))
    if missed:  # one place is enough: the others err with it
        found.append(max(missed)[-1])
    found += _changes(law, sense)
    return found, blocks if len(found) > (fallen is not None) and first > 1 else None


def _lacks(
    law: LoopFit, rows: np.ndarray, x: np.ndarray, sign: np.ndarray | float
) -> tuple[LackOfFit, LackOfFit | None]:
    """Return misfits of rows over x: by the largest value, and by the friction if there is."""
    loops = law.loops
    specimen, count = loops.data.specimen[rows], int(np.count_nonzero(rows))
    data, model = sign * loops.measured[rows], sign * law.fit.model[rows]
    largest = np.full(count, np.abs(loops.measured).max())
    of_value = lack_of_fit(x, data, model, specimen, scale=largest, tolerance=TOLERANCE)
    if law.limit is None:
        return of_value, None
    return of_value, lack_of_fit(
        x, data, model, specimen, scale=law.friction()[rows], tolerance=TOLERANCE_OF_FRICTION
    )


def _changes(law: LoopFit, sense: np.ndarray) -> list[str]:
    """Say whether the friction misses the rows over what it does not know: branch and rate."""
    if law.limit is None:
        return []
    loops, every, found = law.loops, np.ones(len(sense), dtype=bool), []
    number = (loops.branch - _first_branch(loops)).astype(float)
    looks = []
    for sign, what in ((np.ones(len(sense)), "zero"), (sense, "friction")):
        lack = _lacks(law, every, number, sign)[1]
        if lack is not None and lack.is_systematic:
            worst = int(np.argmax(np.where(lack.off, np.abs(lack.deviation), 0.0)))
            size = float(abs(lack.deviation[worst]))
            off = f"is off by {100.0 * size:.0f} % of the friction"
            told = f"the {what} changes from branch to branch: that of branch "
            told += f"{1 + round(lack.x[worst])} {off}"
            if what == "zero" and np.ptp(np.sign(lack.deviation)) == 0.0:
                told = f"the zero of the test {off} in every branch"
            looks.append((size, told))
    if looks:
        found.append(max(looks)[1])
    rate = _rates(loops)
    if rate is not None and np.count_nonzero(rate):
        rows = rate > 0.0
        lack = _lacks(law, rows, np.log(rate[rows]), sense[rows])[1]
        if lack is not None and lack.is_systematic:
            grows = len(lack.x) < 2 or np.polyfit(lack.x, lack.deviation, 1)[0] > 0.0
            found.append(
                "the friction depends on the rate: it is larger where the test is "
                f"{'faster' if grows else 'slower'}, which friction after Dahl does not know"
            )
    return found


def _first_branch(loops: Loops) -> np.ndarray:
    """Return the number of the first branch of each row's test."""
    first = np.zeros(len(loops.branch), dtype=int)
    for number in np.unique(loops.data.specimen):
        of_test = loops.data.specimen == number
        first[of_test] = loops.branch[of_test].min()
    return first


def _rates(loops: Loops) -> np.ndarray | None:
    """Return the rate of the way to each row, 0 where it is not known; None without a time."""
    if "time" not in loops.data:
        return None
    time = np.diff(loops.data["time"], prepend=loops.data["time"][0])
    way = np.abs(loops.ways.sum(axis=1))
    known = ~loops.begins & (time > 0.0)
    rate = np.where(known, way / np.where(known, time, 1.0), 0.0)
    return np.where(rate > _CRAWL * rate.max(), rate, 0.0)


def _fallen(loops: Loops, side: np.ndarray, away: np.ndarray, noise_floor: float) -> int | None:
    """Return the first row where the load falls although the way leads away from zero."""
    first = []
    for number in np.unique(loops.branch):
        for one in (1.0, -1.0):
            rows = np.flatnonzero((loops.branch == number) & (side == one) & away)
            load = one * loops.measured[rows]
            if len(rows) and load.max() > 0.0:
                fallen = falling_row(load, np.zeros(len(rows), dtype=int), noise_floor=noise_floor)
                first += [] if fallen is None else [int(rows[fallen])]
    return min(first) if first else None


def _range_that_holds(
    law: LoopFit, words: Words, noise_floor: float, refit: Callable[[Loops], LoopFit]
) -> str:
    """Say which first branches of all tests a law of their own describes."""
    number = law.loops.branch - _first_branch(law.loops)
    count = int(number.max()) + 1
    for kept in range(min(count - 1, _MOST_RANGES), 1, -1):
        rows = law.loops.keep(number < kept)
        if rows.turn_back and not _objections(refit(rows), words, noise_floor)[0]:
            last = rows.data.lines[np.flatnonzero(rows.branch == rows.branch[-1])[-1]]
            return (
                f"a fit of the first {kept} branches (up to line {last}) describes them; remove "
                "the rows beyond"
            )
    return (
        f"check the zeros of {words.place} and {words.measured}; a smaller or slower loop may "
        "follow such a law"
    )
