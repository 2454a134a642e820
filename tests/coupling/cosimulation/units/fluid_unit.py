"""Entry point of the fluid unit."""

import ctypes

from column_slave import ColumnSlave

from lcmchain.coupling.iteration.consolidation import FluidColumn

# At every instantiation pythonfmu 0.7 gives back a reference to this module's names that it never
# took; without this one they would be gone at the second.
ctypes.pythonapi.Py_IncRef(ctypes.py_object(globals()))


class FluidUnit(ColumnSlave):
    part_type = FluidColumn
    inputs = ("volume_rate",)
    outputs = ("pore_pressure",)
