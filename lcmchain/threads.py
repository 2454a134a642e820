"""Threads of the compiled loops: how many, and which library runs them."""

from __future__ import annotations

import ctypes
import sys
from pathlib import Path


def load_threading_library() -> None:
    """Make the TBB that pip installed visible to numba; without it numba takes OpenMP.

    TBB's fork and join stay fast on a busy machine, where OpenMP's active waiting does not. pip
    puts the library into the environment's ``lib``, which the dynamic loader does not search.
    """
    for name in ("libtbb.so.12", "libtbb.12.dylib"):
        path = Path(sys.prefix) / "lib" / name
        if path.exists():
            ctypes.CDLL(str(path), mode=ctypes.RTLD_GLOBAL)


def use_threads(count: int | None) -> int:
    """Set the number of threads of all compiled loops (default: all cores) and return it."""
    import numba

    available = numba.config.NUMBA_NUM_THREADS  # type: ignore[attr-defined]
    count = min(count or available, available)
    numba.set_num_threads(count)
    return count


def thread_count() -> int:
    """Return how many threads the compiled loops have at present."""
    import numba

    return numba.get_num_threads()
