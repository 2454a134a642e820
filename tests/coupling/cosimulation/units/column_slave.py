"""A column of Terzaghi's consolidation as a unit; a derived class says which of its parts."""

import numpy as np
from pythonfmu import Boolean, Fmi2Causality, Fmi2Slave, Real  # noqa: F401

from lcmchain.coupling.iteration.consolidation import Column

COLUMN = Column(cell_count=40)
UNITS = {"pore_pressure": "Pa", "volume_rate": "m3/s", "thickness": "m"}


class ColumnSlave(Fmi2Slave):
    """Values of fields lie one after the other, inputs first."""

    part_type = None
    inputs = ()
    outputs = ()

    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.part = self.part_type(COLUMN)
        n = COLUMN.cell_count
        self.given = {name: np.zeros(n) for name in self.inputs}
        self.names = [*self.inputs, *self.outputs]
        for name in self.names:
            causality = Fmi2Causality.input if name in self.inputs else Fmi2Causality.output
            start = {"start": 0.0} if name in self.inputs else {}
            for cell in range(n):
                self.register_variable(
                    Real(f"{name}[{cell + 1}]", causality=causality, **start), nested=False
                )

    def _split(self, vrs):
        """Yield field, cells and places of value references that come field by field."""
        vrs = np.asarray(vrs)
        for number, name in enumerate(self.names):
            here = np.flatnonzero(vrs // COLUMN.cell_count == number)
            if here.size:
                yield name, vrs[here] % COLUMN.cell_count, here

    def get_real(self, vrs):
        found = np.empty(len(vrs))
        for name, cells, places in self._split(vrs):
            source = self.given[name] if name in self.given else self.part.get_fields([name])[name]
            found[places] = source[cells]
        return found.tolist()

    def set_real(self, vrs, values):
        values = np.asarray(values)
        for name, cells, places in self._split(vrs):
            self.given[name][cells] = values[places]

    def do_step(self, current_time, step_size):
        self.part.set_fields(self.given)
        self.part.advance(step_size)
        return True

    def _get_fmu_state(self):
        given = {name: values.tolist() for name, values in self.given.items()}
        time, fields = self.part.save()
        return {"given": given, "time": time, "fields": {k: v.tolist() for k, v in fields.items()}}

    def _set_fmu_state(self, state):
        self.given = {name: np.array(values) for name, values in state["given"].items()}
        fields = {name: np.array(values) for name, values in state["fields"].items()}
        self.part.restore((state["time"], fields))
