"""Threads of the compiled loops: how many, and which library runs them."""

from __future__ import annotations

import ctypes
import sys
from importlib.metadata import PackageNotFoundError, files
from pathlib import Path
from typing import Any

#: Elements that one thread should have. On a mesh half as large as for two of them the second one
#: gains nothing: both wait for each other several times per step.
ELEMENTS_PER_THREAD = 700


def load_threading_library() -> None:
    """Make the TBB that pip installed visible to numba; without it numba takes OpenMP.

    TBB's fork and join stay fast on a busy machine, where OpenMP's active waiting does not. pip
    puts the library into the environment's ``lib``, which the dynamic loader does not search; of
    packages that lie elsewhere (``pip install --user`` or ``--target``) it lists where that is.
    """
    for name in ("libtbb.so.12", "libtbb.12.dylib"):
        path = Path(sys.prefix) / "lib" / name
        if not path.exists():
            path = _file_of_package("tbb", name) or path
        if path.exists():
            ctypes.CDLL(str(path), mode=ctypes.RTLD_GLOBAL)


def _file_of_package(package: str, name: str) -> Path | None:
    """Return where pip has put a file of a package, or None."""
    try:
        found = [file for file in files(package) or () if file.name == name]
    except PackageNotFoundError:
        return None
    return Path(found[0].locate()).resolve() if found else None


def launch_before_compiled_code_is_loaded() -> None:
    """Make numba launch its threads before it reads any compiled function from disk.

    Compiled parallel loops jump to addresses that numba fills in when it launches its threads. It
    notes with each function on disk whether that has to happen first, but a parallel function that
    was itself read from disk does not hand this note on: a serial function compiled with a copy of
    it is kept without the note. A later process that calls the serial function before any
    parallel one would jump to address zero and end by a segmentation fault. Seen with numba
    0.61.0 and 0.68.1.
    """
    from numba.core.compiler import CompileResult
    from numba.np.ufunc.parallel import _launch_threads

    rebuild = CompileResult._rebuild.__func__  # type: ignore[attr-defined]

    def rebuild_after_launch(cls: type[CompileResult], *content: Any) -> CompileResult:
        _launch_threads()
        return rebuild(cls, *content)

    CompileResult._rebuild = classmethod(rebuild_after_launch)  # type: ignore[method-assign, assignment]


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
