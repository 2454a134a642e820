"""A press whose force is limited, as a functional mock-up unit (FMI 2.0).

It drives its ram at the closing velocity, and slower the nearer the force comes to the limit; at
the limit it stands. The drive follows the wanted velocity with a lag of first order.

    pythonfmu build -f examples/cosimulation/press.py -d examples/cosimulation
"""

import ctypes
import math

from pythonfmu import Boolean, Fmi2Causality, Fmi2Slave, Fmi2Variability, Real

# At every instantiation pythonfmu 0.7 gives back a reference to this module's names that it never
# took; without this one they would be gone at the second.
ctypes.pythonapi.Py_IncRef(ctypes.py_object(globals()))

FIXED = {"causality": Fmi2Causality.parameter, "variability": Fmi2Variability.fixed}


class Press(Fmi2Slave):
    """Force of the part on the ram in [N], velocity of the ram out [m/s]."""

    description = "Press with a limited force"

    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.part_force = 0.0
        self.closing_velocity, self.force_limit = 0.5, 100.0
        self.band, self.lag, self.force_lag = 0.5, 2e-4, 5e-4
        self.velocity, self.force, self.drive = 0.0, 0.0, True
        for name in ("closing_velocity", "force_limit", "band", "lag", "force_lag"):
            self.register_variable(Real(name, **FIXED))
        self.register_variable(Real("part_force", causality=Fmi2Causality.input))
        for name in ("velocity", "force"):
            self.register_variable(Real(name, causality=Fmi2Causality.output))
        self.register_variable(
            Boolean("drive", causality=Fmi2Causality.output, variability=Fmi2Variability.discrete)
        )

    def do_step(self, current_time, step_size):
        # the force cell sees the mean over its own time, not every wave in the sheet
        follow = 1.0 - math.exp(-step_size / self.force_lag)
        self.force += follow * (-self.part_force - self.force)
        # full velocity up to (1 - band) of the limit, none at the limit, back above it
        share = (self.force_limit - self.force) / (self.band * self.force_limit)
        wanted = self.closing_velocity * max(-1.0, min(1.0, share))
        self.velocity += (1.0 - math.exp(-step_size / self.lag)) * (wanted - self.velocity)
        return True
