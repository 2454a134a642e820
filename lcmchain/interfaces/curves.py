"""Curves by points of several interfaces, one behind the other in one array."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from lcmchain.jit import equation


@equation
def place_between(points, first, last, value):
    """Return the interval of ``points[first:last]`` that a value lies in, and how far in it."""
    k = first
    while k < last - 2 and points[k + 1] <= value:
        k += 1
    if last - first < 2:
        return first, 0.0
    part = (value - points[k]) / (points[k + 1] - points[k])
    return k, min(max(part, 0.0), 1.0)


def starts(rows: Sequence[np.ndarray]) -> np.ndarray:
    """Return where each of some arrays begins in all of them, one behind the other."""
    return np.concatenate([[0], np.cumsum([row.size for row in rows])]).astype(np.int64)


def rows_of(tables: Sequence[Any], entry: str) -> list[np.ndarray]:
    """Return an entry of each table as a flat array, empty where there is no table."""
    return [
        np.zeros(0) if table is None else np.ravel(np.asarray(getattr(table, entry), dtype=float))
        for table in tables
    ]


def increasing(values: Sequence[float]) -> bool:
    return all(b > a for a, b in zip(values, values[1:], strict=False))
