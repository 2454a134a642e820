"""The level part of a profile: where nothing else of the tool can be nearer.

Most of a sheet faces the level parts of its tools: holders, dies, moulds. There the distance is a
difference of heights.
"""

from __future__ import annotations

import math

import numpy as np

from lcmchain.tools.profiles import LINE

#: Columns: the part lies between two abscissas [m], at a height [m]; the normal is +1 or -1. A
#: point between them is nearer to it than to anything else where it is less far from it than from
#: either of them, and than the last column says [m].
BEGIN = 0
END = 1
HEIGHT = 2
NORMAL = 3
DEPTH = 4
COLUMNS = 5

#: No level part: ends before it begins.
NONE = (math.inf, -math.inf, 0.0, 1.0, 0.0)


def level_part(segments: np.ndarray, corners: np.ndarray, *, revolved: bool) -> np.ndarray:
    """Return the widest level part of a profile (:data:`COLUMNS`,).

    Parameters
    ----------
    segments, corners : of the profile, see :class:`lcmchain.tools.profiles.Profile`.
    revolved : whether abscissas are distances from an axis.
    """
    level = (segments[:, 0] == LINE) & (segments[:, 7] == 0.0)
    heights = segments[level, 2]
    steep = [_extent(row) for row in segments[~level]] + [(x, x) for x in corners[:, 0]]
    widest, best = 0.0, np.array(NONE)
    for row in segments[level]:
        apart = np.abs(heights - row[2])
        depth = 0.5 * apart[apart > 0.0].min(initial=math.inf)
        first, last = _extent(row)
        if revolved:
            first = max(first, 0.0)
        for begin, end in [*sorted(steep), (last, math.inf)]:
            width = min(begin, last) - first
            if width > widest:
                # nothing is nearer beyond the axis
                start = -math.inf if revolved and first == 0.0 else first
                widest, best = width, np.array((start, min(begin, last), row[2], row[8], depth))
            first = max(first, end)
    return best


def _extent(segment: np.ndarray) -> tuple[float, float]:
    """Return the least and the largest abscissa of a line or an arc [m]."""
    if segment[0] == LINE:
        x0, tx = segment[1], segment[3]
        ends = [x0 if tx == 0.0 else x0 + tx * abscissa for abscissa in segment[5:7]]
        return min(ends), max(ends)
    x0, radius = segment[1], segment[6]
    middle, half = math.atan2(segment[4], segment[3]), math.acos(segment[5])
    angles = [middle - half, middle + half]
    # where the arc turns back
    angles += [turn for turn in math.pi * np.arange(-2, 3) if abs(turn - middle) <= half]
    places = [x0 + radius * math.cos(angle) for angle in angles]
    return min(places), max(places)
