"""Entry point of the solid unit."""

import ctypes

from column_slave import ColumnSlave

from lcmchain.coupling.iteration.consolidation import SolidColumn

# At every instantiation pythonfmu 0.7 gives back a reference to this module's names that it never
# took; without this one they would be gone at the second.
ctypes.pythonapi.Py_IncRef(ctypes.py_object(globals()))


class SolidUnit(ColumnSlave):
    part_type = SolidColumn
    inputs = ("pore_pressure",)
    outputs = ("volume_rate", "thickness")
