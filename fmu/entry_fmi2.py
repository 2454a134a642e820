"""Entry point of a unit of FMI 2.0; ``fmu/build.py`` copies this file into its resources.

pythonfmu runs it in the Python of the importing process, whose environment must have lcmchain.
"""

import ctypes

# At every instantiation pythonfmu 0.7 gives back a reference to this module's names that it never
# took; without this one they would be gone at the second.
ctypes.pythonapi.Py_IncRef(ctypes.py_object(globals()))

import lcmchain_unit_environment  # noqa: E402  # beside this file

lcmchain_unit_environment.prepare(__file__)

from lcmchain.fmu.fmi2 import UnitSlave2  # noqa: E402, F401  # found by its base class
