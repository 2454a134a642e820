from column_slave import ColumnSlave

from lcmchain.coupling.iteration.consolidation import FluidColumn


class FluidUnit(ColumnSlave):
    part_type = FluidColumn
    inputs = ("volume_rate",)
    outputs = ("pore_pressure",)
