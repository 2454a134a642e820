"""What happens in a test: the contact with the specimen, and loads that drop.

- **Contact**: the load of a machine that touches nothing scatters about a constant. The first rows
  that do so tell the zero of the load, and the line of the first rows above that scatter the zero
  of the travel.
- **Drop**: the load falls while the machine travels on, by more than scatter explains. It comes
  back where the specimen slipped in its clamps, and does not where it tore.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from lcmchain.identification.lack_of_fit import medians, relative_scatter

# Rows ahead of the contact that tell a zero, at least.
LEAST_AHEAD = 5
# A row lies above the load ahead of the contact by so many times its scatter, and this part of the
# largest load, which only rounding stays below.
_ABOVE, _ROUNDING = 5.0, 1e-9
#: The line of the first rows behind the contact reaches a load of so many times the scatter.
REACHES = 25.0
#: The line of the first rows from a preload on reaches so many times the preload.
GROWS = 2.0
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


# --- drops ----------------------------------------------------------------------------------------


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


# --- zeros ----------------------------------------------------------------------------------------


class Contact(NamedTuple):
    """Rows ahead of the contact, the load that they read, and its scatter."""

    ahead: int
    load: float
    scatter: float


def contact_of(load: np.ndarray) -> Contact | None:
    """Return how many first rows bear nothing; None where the load rises from the first row on."""
    if len(load) < LEAST_AHEAD + 2:
        return None
    rounding = _ROUNDING * float(np.ptp(load))

    def scatter_of(count: int) -> float:
        # Second differences do not see a rise.
        return math.sqrt(float(np.mean(np.diff(load[:count], 2) ** 2)) / 6.0)

    place = np.arange(LEAST_AHEAD) - 0.5 * (LEAST_AHEAD - 1)
    slope = float(place @ load[:LEAST_AHEAD] / (place @ place))
    error = scatter_of(LEAST_AHEAD) / math.sqrt(place @ place)
    if abs(slope) > _ABOVE * error + rounding:
        return None
    ahead = LEAST_AHEAD
    while ahead < len(load):
        limit = load[:ahead].mean() + _ABOVE * scatter_of(ahead) + rounding
        if np.all(load[ahead : ahead + 2] > limit):
            break
        ahead += 1
    if ahead == len(load):
        return None
    return Contact(ahead, float(load[:ahead].mean()), scatter_of(ahead))


def met_zero(travel: np.ndarray, load: np.ndarray, first: int, until: float) -> tuple[float, int]:
    """Return where the line of the first loaded rows meets no load, and of how many rows it is.

    travel, load : of one specimen, shape [row_count]; the load counts from its zero.
    first : row at which the line begins. until : load that it reaches, in two rows at least.
    """
    grown = np.flatnonzero(load[first + 1 :] >= until)
    last = first + 1 + (int(grown[0]) if len(grown) else len(load) - first - 2)
    x, y = travel[first : last + 1], load[first : last + 1]
    slope, level = np.polyfit(x - x[0], y, 1)
    return float(x[0] - level / slope) if slope > 0.0 else float(x[0]), len(x)
