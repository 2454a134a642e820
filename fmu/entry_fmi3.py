"""Entry point of a unit of FMI 3.0; ``fmu/build.py`` copies this file into its resources.

pythonfmu3 runs it in the Python of the importing process, whose environment must have lcmchain.
"""

import importlib
from typing import Any

Fmi3Slave: Any
unit: type
try:
    try:
        environment = importlib.import_module("lcmchain_unit_environment")  # beside this file
    except ModuleNotFoundError:  # not in a unit
        environment = importlib.import_module("lcmchain.fmu.entry_environment")
    environment.prepare(__file__)
    adapter = importlib.import_module("lcmchain.fmu.fmi3")
    Fmi3Slave, unit = adapter.Fmi3Slave, adapter.UnitSlave3
except BaseException as error:
    # After an exception of this file pythonfmu3 keeps Python's lock, and the host hangs; after one
    # of the class it tells the master, and there is no instance.
    reason = f"{type(error).__name__}: {error}"

    class Unable:
        """Says why the unit cannot run."""

        def __init__(self, **kwargs: object) -> None:
            raise RuntimeError(reason)

    Fmi3Slave, unit = object, Unable


class LcmchainUnit(Fmi3Slave):
    """Stands for the unit: pythonfmu3 looks in this text for the name of a class like this one."""


# Not a class derived from it: pythonfmu3 may look up a method while an exception is pending, which
# only succeeds in the dictionary of the very first class.
globals()["LcmchainUnit"] = unit
