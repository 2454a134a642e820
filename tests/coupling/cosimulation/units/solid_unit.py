from column_slave import ColumnSlave

from lcmchain.coupling.iteration.consolidation import SolidColumn


class SolidUnit(ColumnSlave):
    part_type = SolidColumn
    inputs = ("pore_pressure",)
    outputs = ("volume_rate", "thickness")
