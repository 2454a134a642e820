"""Finds lcmchain for a unit, or says in one message what is missing; lies in its resources.

Without lcmchain only the standard library is there.
"""

import atexit
import gc
import os
import site
import sys
from importlib.util import find_spec
from pathlib import Path

_ended: set[str] = set()


def prepare(entry: str) -> None:
    """Leave the search path as it was, and make lcmchain importable."""
    folder = os.path.dirname(entry)
    sys.path[:] = [path for path in sys.path if path.rstrip("/\\") != folder]
    # A host that is no Python starts the interpreter outside of the environment it was started in.
    if find_spec("lcmchain") is None:
        _add_environment()
    _give_back_interrupts()
    if sys.platform == "linux":
        for library in Path(folder).parent.glob("binaries/*linux*/*.so"):
            _end_once(str(library))
    # The exporter ends the interpreter in a thread of its own, with references that it has given
    # back twice: collecting what is left then ended hosts with a segmentation fault.
    atexit.register(gc.freeze)
    try:
        import numpy  # noqa: F401

        import lcmchain.fmu  # noqa: F401
    except ImportError as error:
        message = (
            f"this unit needs lcmchain in the Python {sys.version.split()[0]} of {sys.prefix} that "
            f"runs it (there is no module {error.name}): install it there, or start the importing "
            "program from the activated environment that has it"
        )
        # Most masters show no log messages unless asked to.
        print(message, file=sys.stderr, flush=True)
        raise ImportError(message) from error


def _add_environment() -> None:
    version = f"python{sys.version_info.major}.{sys.version_info.minor}"
    for variable in ("VIRTUAL_ENV", "CONDA_PREFIX"):
        for library in (f"lib/{version}", "Lib"):
            folder = Path(os.environ.get(variable, ""), library, "site-packages")
            if os.environ.get(variable) and folder.is_dir():
                site.addsitedir(str(folder))


def _host_is_python() -> bool:
    return bool(getattr(sys, "orig_argv", None))


def _end_once(library: str) -> None:
    """Release what the exporter's library holds before the end of the process does, twice.

    At the end of a process the destructor of its static pointer runs first and the function that
    empties this pointer after it (`onLibraryUnload` in pythonfmu and pythonfmu3): that counted down
    in memory given back long before, and now and then the C library found its lists corrupted.
    """
    import ctypes

    if library in _ended or sys.platform != "linux":
        return
    _ended.add(library)
    try:
        # Held, it stays where it is until then, although masters unload it and remove its file.
        exporter = ctypes.CDLL(library, mode=os.RTLD_NOLOAD | os.RTLD_NOW)
    except OSError:  # the binary for another machine
        return
    if _host_is_python():
        atexit.register(exporter.finalizePythonInterpreter)
    else:  # that very function ends the interpreter: the host's C library must call it
        ctypes.CDLL(None).__cxa_atexit(exporter.finalizePythonInterpreter, None, None)


def _give_back_interrupts() -> None:
    """Let Ctrl-C end a host that is no Python, as it did before.

    The interpreter that the unit started there has taken the signal, and can answer to it only in
    a thread that no longer runs Python.
    """
    if _host_is_python():
        return
    import ctypes
    import signal

    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        # on Windows a process has no handle for all its libraries: the one of C that Python uses
        library = ctypes.CDLL("ucrtbase" if os.name == "nt" else None)
        library.signal(int(signal.SIGINT), None)
