"""Whether a fitted law describes its data: systematic deviations, falling loads, range that holds.

Noise scatters to both sides of a law. A law that misses its data lies above them over one part of
the range and below over another. The rows are therefore sorted into bands along the range: a band
is off where the mean deviation in it is larger than scatter explains, and large enough to matter.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.stats import t as student

# Mean deviation of a band that matters, of the measured value or of a fifth of the largest one.
TOLERANCE = 0.1
_SMALL_VALUE = 0.2
# Chance of calling pure noise systematic, over all bands of a fit.
_FALSE_ALARM = 1e-4
_ROWS_PER_BAND, _MOST_BANDS = 5, 10
# Fewer differences of neighbours than this do not tell the scatter.
_FEWEST_DIFFERENCES = 4
# A load falls where it is this much below its peak, and by more than noise can explain.
_FALL, _FALL_IN_NOISE = 0.1, 6.0
# Largest number of shorter ranges that are tried.
_TRIALS = 30


@dataclass(frozen=True)
class LackOfFit:
    """Mean deviation of the data from a law in bands along the range of the test.

    Attributes
    ----------
    band : number of the band of each row, shape [row_count].
    x : mean abscissa of each band, shape [band_count].
    deviation : mean of (data - model) / max(\\|model\\|, a fifth of the largest value), or over
        another scale, shape [band_count].
    off : whether the deviation is systematic and matters, shape [band_count].
    """

    band: np.ndarray
    x: np.ndarray
    deviation: np.ndarray
    off: np.ndarray

    @property
    def is_systematic(self) -> bool:
        return bool(self.off.any())

    @property
    def blocks(self) -> np.ndarray | None:
        """Bands whose rows err together, for the intervals of the fit; None if errors are noise."""
        return self.band if self.is_systematic and len(self.x) > 1 else None

    def widening(self, x: np.ndarray) -> np.ndarray:
        """Return the relative deviation that a band of confidence has to reach to, shape as x."""
        if not self.is_systematic:
            return np.zeros(np.shape(x))
        return np.interp(x, self.x, np.abs(self.deviation))

    def text(self, law: str, quantity: str, unit: str, factor: float = 1.0, *, of: str = "") -> str:
        """Say where the law misses the data; ``factor`` turns the abscissa into ``unit``.

        of : what the deviation is a part of, as " of the friction", if not of the value.
        """
        worst = int(np.argmax(np.where(self.off, np.abs(self.deviation), 0.0)))
        side = "below" if self.deviation[worst] > 0.0 else "above"
        return (
            f"{law} does not follow the data: it lies "
            f"{100.0 * abs(self.deviation[worst]):.0f} %{of} {side} them around {quantity} = "
            f"{factor * self.x[worst]:.4g} {unit}, which is no scatter"
        )


def lack_of_fit(
    x: np.ndarray,
    data: np.ndarray,
    model: np.ndarray,
    specimen: np.ndarray,
    *,
    tolerance: float = TOLERANCE,
    scale: np.ndarray | None = None,
) -> LackOfFit:
    """Compare data and model band by band.

    Parameters
    ----------
    x : abscissa of the rows (displacement, thickness, orientation), shape [row_count].
    data, model : measured and fitted values, shape [row_count].
    specimen : number of the specimen of each row, shape [row_count].
    tolerance : mean deviation of a band that matters.
    scale : what deviations are taken over, shape [row_count]; the values by default.
    """
    x, data, model = (np.asarray(values, dtype=float) for values in (x, data, model))
    if scale is None:
        smallest = _SMALL_VALUE * np.max(np.abs(data))
        scale = np.maximum(np.abs(model), smallest)
    deviation = (data - model) / np.maximum(scale, 1e-300)
    order = np.argsort(x, kind="stable")
    band = np.empty(len(x), dtype=int)
    band[order] = _bands(x[order])
    count = int(band.max()) + 1
    rows = np.bincount(band)
    mean = np.bincount(band, deviation) / rows
    centre = np.bincount(band, x) / rows
    neighbours = band[order][1:] == band[order][:-1]
    differences = np.diff(deviation[order])[neighbours]
    if len(differences) < _FEWEST_DIFFERENCES:
        return LackOfFit(band, centre, mean, np.zeros(count, dtype=bool))
    # The median is not moved by the one jump that is looked for; 0.954 = 0.6745 sqrt(2).
    scatter = float(np.median(np.abs(differences))) / 0.954
    error = np.maximum(
        scatter / np.sqrt(rows), [_between(deviation[band == b], specimen[band == b])
                                  for b in range(count)],
    )  # fmt: skip
    # Two differences that share a row count as little more than one.
    freedom = max(1.0, 0.6 * len(differences))
    factor = float(student.ppf(1.0 - 0.5 * _FALSE_ALARM / count, freedom))
    off = (np.abs(mean) > factor * error) & (np.abs(mean) > tolerance)
    return LackOfFit(band, centre, mean, off)


def _bands(x: np.ndarray) -> np.ndarray:
    """Return the band of each of the sorted rows: few distinct abscissae, or equal counts."""
    new = np.append(False, np.diff(x) > 1e-6 * max(np.ptp(x), 1e-300))
    distinct = np.cumsum(new)
    if distinct[-1] + 1 <= max(2, len(x) // 2) and distinct[-1] < _MOST_BANDS:
        return distinct
    count = int(np.clip(len(x) // _ROWS_PER_BAND, 1, _MOST_BANDS))
    return np.arange(len(x)) * count // len(x)


def _between(deviation: np.ndarray, specimen: np.ndarray) -> float:
    """Error of a mean that the scatter between specimens leaves; 0 for one specimen."""
    numbers = np.unique(specimen)
    if len(numbers) < 2:
        return 0.0
    means = [deviation[specimen == number].mean() for number in numbers]
    return float(np.std(means, ddof=1) / math.sqrt(len(numbers)))


def falling_row(
    load: np.ndarray,
    specimen: np.ndarray,
    *,
    for_good: bool = False,
    noise_floor: float = 0.0,
) -> int | None:
    """Return the first row where the load of a specimen falls below its peak, None without one.

    A test that loads the specimen cannot lower the load of a law that rises: the specimen tore,
    slipped in its clamps, or was unloaded. Single peaks and scatter are no fall.

    Parameters
    ----------
    load : force or pressure in the order of loading, shape [row_count].
    specimen : number of the specimen of each row, shape [row_count].
    for_good : count only a fall of two rows or more from which the load never comes back to its
        peak, for a load that was computed and scatters more in one place than in another.
    noise_floor : smallest noise relative to the largest load.
    """
    first = []
    for number in np.unique(specimen):
        rows = np.flatnonzero(specimen == number)
        values = load[rows]
        if len(values) < 3:
            continue
        middle = medians(values)
        peak = np.maximum.accumulate(middle)
        least = max(noise_floor * float(np.max(np.abs(middle))), 1e-300)
        noise = relative_scatter(values, middle, least)
        size = np.maximum(peak, least) if noise_floor > 0.0 else peak
        fallen = peak - values > np.maximum(_FALL * peak, _FALL_IN_NOISE * noise * size)
        # What is small against the whole test is the start of it, not its end.
        fallen &= peak > _FALL * np.max(middle)
        if for_good:
            later = np.maximum.accumulate(middle[::-1])[::-1]
            fallen &= later < peak
            fallen &= np.count_nonzero(fallen) >= 2
        if fallen.any():
            first.append(rows[int(np.argmax(fallen))])
    return int(min(first)) if first else None


def medians(load: np.ndarray) -> np.ndarray:
    """Return the load without its single peaks: medians of three, the lesser one at the ends."""
    middle = np.array([np.median(load[max(i - 1, 0) : i + 2]) for i in range(len(load))])
    middle[0], middle[-1] = min(middle[:2].min(), load[0]), min(middle[-1], middle[-2])
    return middle


def relative_scatter(load: np.ndarray, middle: np.ndarray, least: float = 1e-300) -> float:
    """Return the standard deviation of a load over itself; a rise does not count.

    load, middle : of three rows or more in the order of loading, and their medians.
    least : smallest value that it is taken over.
    """
    usable = np.abs(middle) > _FALL * np.max(np.abs(middle))
    ratio = (load[1:] - load[:-1]) / np.maximum(np.abs(middle[1:]), least)
    # Second differences do not see the rise of the load, only its scatter.
    rough = np.abs(np.diff(ratio))[usable[2:]]
    return float(np.median(rough)) / (0.6745 * math.sqrt(6.0)) if len(rough) else 0.0


def longest_range(
    x: np.ndarray,
    holds: Callable[[np.ndarray], bool],
    fewest: int,
    *,
    from_start_only: bool = True,
) -> np.ndarray | None:
    """Return the most rows at one end of the range, as a mask, whose own fit holds; else None.

    Parameters
    ----------
    x : abscissa of the rows in the order of loading, from the unloaded state, shape [row_count].
    holds : says whether a fit of these rows alone describes them.
    fewest : fewest rows that can be fitted.
    from_start_only : whether the range has to begin with the unloaded state.
    """
    count = len(x)
    order = np.argsort(x, kind="stable")
    step = max(1, (count - fewest) // _TRIALS)
    for kept in range(count, fewest - 1, -step):
        for chosen in (order[:kept],) if from_start_only else (order[:kept], order[count - kept :]):
            rows = np.zeros(count, dtype=bool)
            rows[chosen] = True
            if holds(rows):
                return rows
    return None
