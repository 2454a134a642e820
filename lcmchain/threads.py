"""Threads of the compiled loops: how many, and which library runs them."""

from __future__ import annotations

import ctypes
import sys
from pathlib import Path

#: Elements that one thread should have. On a mesh half as large as for two of them the second one
#: gains nothing: both wait for each other several times per step.
ELEMENTS_PER_THREAD = 700


def load_threading_library() -> None:
    """Make the TBB that pip installed visible to numba; without it numba takes OpenMP.

    TBB's fork and join stay fast on a busy machine, where OpenMP's active waiting does not. pip
    puts the library into the environment's ``lib``, which the dynamic loader does not search.
    """
    for name in ("libtbb.so.12", "libtbb.12.dylib"):
        path = Path(sys.prefix) / "lib" / name
        if path.exists():
            ctypes.CDLL(str(path), mode=ctypes.RTLD_GLOBAL)


def use_threads(count: int | None, element_count: int | None = None) -> int:
    """Set the number of threads of all compiled loops and return it.

    Parameters
    ----------
    count : as many, and no more than there are cores; None or 0 means all of them, or fewer where
        ``element_count`` is given and more would not pay (:func:`worthwhile_threads`).
    """
    import numba

    available = available_threads()
    if count:
        count = min(count, available)
    else:
        count = available if element_count is None else worthwhile_threads(element_count)
    numba.set_num_threads(count)
    return count


def worthwhile_threads(element_count: int) -> int:
    """Return how many threads make the steps of a mesh of so many elements fastest."""
    return min(available_threads(), max(1, round(element_count / ELEMENTS_PER_THREAD)))


def available_threads() -> int:
    """Return how many threads the compiled loops can have: the cores, unless numba is told else."""
    import numba

    return int(numba.config.NUMBA_NUM_THREADS)  # type: ignore[attr-defined]


def thread_count() -> int:
    """Return how many threads the compiled loops have at present."""
    import numba

    return numba.get_num_threads()
