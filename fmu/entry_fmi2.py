"""Entry point of a unit of FMI 2.0; ``fmu/build.py`` copies this file into its resources.

pythonfmu runs it in the Python of the importing process, whose environment must have lcmchain.
"""

import ctypes
import importlib

# At every instantiation pythonfmu 0.7 gives back a reference to this module's names that it never
# took; without this one they would be gone at the second.
ctypes.pythonapi.Py_IncRef(ctypes.py_object(globals()))

try:
    environment = importlib.import_module("lcmchain_unit_environment")  # beside this file
except ModuleNotFoundError:  # not in a unit
    environment = importlib.import_module("lcmchain.fmu.entry_environment")
environment.prepare(__file__)

from lcmchain.fmu.fmi2 import UnitSlave2  # noqa: E402, F401  # found by its base class
