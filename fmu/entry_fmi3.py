"""Entry point of a unit of FMI 3.0; ``fmu/build.py`` copies this file into its resources.

pythonfmu3 runs it in the Python of the importing process, whose environment must have lcmchain.
"""

import importlib

try:
    environment = importlib.import_module("lcmchain_unit_environment")  # beside this file
except ModuleNotFoundError:  # not in a unit
    environment = importlib.import_module("lcmchain.fmu.entry_environment")
environment.prepare(__file__)

from lcmchain.fmu.fmi3 import Fmi3Slave, UnitSlave3  # noqa: E402


class LcmchainUnit(Fmi3Slave):
    """Stands for the unit: pythonfmu3 looks in this text for the name of a class like this one."""


# Not a class derived from it: pythonfmu3 may look up a method while an exception is pending, which
# only succeeds in the dictionary of the very first class.
globals()["LcmchainUnit"] = UnitSlave3
