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


def prepare(entry: str) -> None:
    """Leave the search path as it was, and make lcmchain importable."""
    folder = os.path.dirname(entry)
    sys.path[:] = [path for path in sys.path if path.rstrip("/\\") != folder]
    # A host that is no Python starts the interpreter outside of the environment it was started in.
    if find_spec("lcmchain") is None:
        _add_environment()
    _give_back_interrupts()
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


def _give_back_interrupts() -> None:
    """Let Ctrl-C end a host that is no Python, as it did before.

    The interpreter that the unit started there has taken the signal, and can answer to it only in
    a thread that no longer runs Python.
    """
    if getattr(sys, "orig_argv", None):
        return  # the process is a Python
    import ctypes
    import signal

    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        ctypes.CDLL(None).signal(int(signal.SIGINT), None)
