"""Units of systems that other tools publish, rebuilt as small equations; see test_foreign_systems.

``variables`` are causality, start value and, where the original gives one, unit of measurement.
``step`` advances the values ``v`` by ``h`` with inputs that are held, ``answer`` sets the outputs.
"""

import math

#: What the units of measurement mean.
MEASURES = {
    "N.m": {"kg": 1, "m": 2, "s": -2}, "rad": {"rad": 1}, "rad/s": {"rad": 1, "s": -1},
    "kg.m2": {"kg": 1, "m": 2}, "N.m.s/rad": {"kg": 1, "m": 2, "s": -1, "rad": -1},
    "V": {"kg": 1, "m": 2, "s": -3, "A": -1}, "A": {"A": 1}, "K": {"K": 1}, "1/K": {"K": -1},
    "Ohm": {"kg": 1, "m": 2, "s": -3, "A": -2}, "H": {"kg": 1, "m": 2, "s": -2, "A": -2},
    "N.m/A": {"kg": 1, "m": 2, "s": -2, "A": -1}, "s": {"s": 1},
}  # fmt: skip


class DriveMass:
    """A damped inertia between two flanges: J dw/dt = M_A + M_B - d w."""

    variables = {
        "M_A": ("input", 0.0, "N.m"), "M_B": ("input", 0.0, "N.m"),
        "inertia.J": ("parameter", 1.0, "kg.m2"), "damper.d": ("parameter", 1.0, "N.m.s/rad"),
        "wA": ("output", 0.0, "rad/s"), "wB": ("output", 0.0, "rad/s"),
        "phiA": ("output", 0.0, "rad"), "phiB": ("output", 0.0, "rad"),
    }  # fmt: skip

    @staticmethod
    def answer(v):
        v["wB"], v["phiB"] = v["wA"], v["phiA"]

    @staticmethod
    def step(v, t, h):
        lag, rest = v["inertia.J"] / v["damper.d"], (v["M_A"] + v["M_B"]) / v["damper.d"]
        decay = math.exp(-h / lag)
        above = v["wA"] - rest
        v["phiA"] += rest * h + above * lag * (1.0 - decay)
        v["wA"] = rest + above * decay


class Machine:
    """Armature of a direct current motor: L dI/dt = U - R I - k w, torque k I."""

    variables = {
        "U": ("input", 0.0, "V"), "w": ("input", 0.0, "rad/s"), "phi": ("input", 0.0, "rad"),
        "resistor.R": ("parameter", 1.0, "Ohm"), "resistor.T": ("parameter", 300.0, "K"),
        "resistor.T_ref": ("parameter", 300.0, "K"),
        "resistor.alpha": ("parameter", 0.0, "1/K"), "inductor.L": ("parameter", 1.0, "H"),
        "emf.k": ("parameter", 1.0, "N.m/A"),
        "M": ("output", 0.0, "N.m"), "I": ("output", 0.0, "A"),
    }  # fmt: skip

    @staticmethod
    def answer(v):
        v["M"] = v["emf.k"] * v["I"]

    @staticmethod
    def step(v, t, h):
        warmer = v["resistor.T"] - v["resistor.T_ref"]
        resistance = v["resistor.R"] * (1.0 + v["resistor.alpha"] * warmer)
        rest = (v["U"] - v["emf.k"] * v["w"]) / resistance
        v["I"] = rest + (v["I"] - rest) * math.exp(-h * resistance / v["inductor.L"])


class Stimuli:
    """A step of the voltage and a constant load."""

    variables = {
        "Voltage_step.offset": ("parameter", 0.0, "V"),
        "Voltage_step.startTime": ("parameter", 0.0, "s"),
        "Voltage_step.height": ("parameter", 1.0, "V"), "MLoad.k": ("parameter", 0.0, "N.m"),
        "U": ("output", 0.0, "V"), "M_load": ("output", 0.0, "N.m"),
    }  # fmt: skip

    @staticmethod
    def answer(v):
        is_on = v.get("time", 0.0) >= v["Voltage_step.startTime"]
        v["U"] = v["Voltage_step.offset"] + is_on * v["Voltage_step.height"]
        v["M_load"] = v["MLoad.k"]

    @staticmethod
    def step(v, t, h):
        v["time"] = t + h


class Chassis:
    """A mass on a spring and a damper: takes the velocity below it (flow), gives its force."""

    variables = {
        "p.f": ("input", 0.0, None), "p.e": ("output", 0.0, None),
        "C.mChassis": ("parameter", 1.0, None), "C.kChassis": ("parameter", 1.0, None),
        "R.dChassis": ("parameter", 0.0, None),
        "velocity": ("local", 0.0, None), "compression": ("local", 0.0, None),
    }  # fmt: skip

    @staticmethod
    def answer(v):
        v["p.e"] = v["C.kChassis"] * v["compression"] + v["R.dChassis"] * (v["p.f"] - v["velocity"])

    @staticmethod
    def step(v, t, h):
        v["compression"] += h * (v["p.f"] - v["velocity"])
        Chassis.answer(v)
        v["velocity"] += h * v["p.e"] / v["C.mChassis"]


class Wheel:
    """A mass on a tyre: takes the force of the chassis and the velocity of the road."""

    variables = {
        "p.f": ("input", 0.0, None), "p1.e": ("input", 0.0, None),
        "p.e": ("output", 0.0, None), "p1.f": ("output", 0.0, None),
        "C.mWheel": ("parameter", 1.0, None), "C.kWheel": ("parameter", 1.0, None),
        "R.dWheel": ("parameter", 0.0, None), "compression": ("local", 0.0, None),
    }  # fmt: skip

    @staticmethod
    def answer(v):
        v["p.e"] = v["C.kWheel"] * v["compression"] + v["R.dWheel"] * (v["p.f"] - v["p1.f"])

    @staticmethod
    def step(v, t, h):
        v["compression"] += h * (v["p.f"] - v["p1.f"])
        Wheel.answer(v)
        v["p1.f"] += h * (v["p.e"] - v["p1.e"]) / v["C.mWheel"]


class Ground:
    """The road: a bump of 0.1 m that takes 0.1 s, from 10.05 s on. The force is felt, not used."""

    variables = {"p.e": ("input", 0.0, None), "p.f": ("output", 0.0, None)}

    @staticmethod
    def answer(v):
        phase = (v.get("time", 0.0) - 10.05) / 0.1
        v["p.f"] = 0.05 * math.pi / 0.1 * math.sin(math.pi * phase) * (0.0 <= phase <= 1.0)

    @staticmethod
    def step(v, t, h):
        v["time"] = t + h


class Gain:
    """y = k u."""

    variables = {
        "u": ("input", 0.0, None), "y": ("output", 0.0, None), "k": ("parameter", 1.0, None)
    }  # fmt: skip

    @staticmethod
    def answer(v):
        v["y"] = v["k"] * v["u"]

    @staticmethod
    def step(v, t, h):
        """Has no memory."""


class Add:
    """y = k1 u1 + k2 u2."""

    variables = {
        "u1": ("input", 0.0, None), "u2": ("input", 0.0, None), "y": ("output", 0.0, None),
        "k1": ("parameter", 1.0, None), "k2": ("parameter", 1.0, None),
    }  # fmt: skip

    @staticmethod
    def answer(v):
        v["y"] = v["k1"] * v["u1"] + v["k2"] * v["u2"]

    @staticmethod
    def step(v, t, h):
        """Has no memory."""


class Identity:
    """Gives what it takes."""

    variables = {"realIn": ("input", 0.0, None), "realOut": ("output", 0.0, None)}

    @staticmethod
    def answer(v):
        v["realOut"] = v["realIn"]

    @staticmethod
    def step(v, t, h):
        """Has no memory."""


class Slave:
    """What the classes of pythonfmu and pythonfmu3 have in common; ``fmi`` is that package."""

    fmi = equations = None

    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.v = {name: start for name, (_, start, _) in self.equations.variables.items()}
        self.register()

    def access(self, name):
        """Return what reads and what sets a variable."""

        def get():
            self.equations.answer(self.v)
            return self.v[name]

        return {"getter": get, "setter": lambda value: self.v.update({name: value})}

    def advance(self, time, step):
        self.equations.step(self.v, time, step)


class Slave2(Slave):
    """For FMI 2.0, in which pythonfmu knows no units of measurement."""

    def register(self):
        for name, (kind, _, _) in self.equations.variables.items():
            options = {"causality": getattr(self.fmi.Fmi2Causality, kind), **self.access(name)}
            if kind == "parameter":
                options["variability"] = self.fmi.Fmi2Variability.fixed
            self.register_variable(self.fmi.Real(name, **options))

    def do_step(self, current_time, step_size):
        self.advance(current_time, step_size)
        return True


class Slave3(Slave):
    """For FMI 3.0."""

    def register(self):
        self.register_units([self.fmi.Unit(name, **base) for name, base in MEASURES.items()])
        for name, (kind, _, unit) in self.equations.variables.items():
            options = {"causality": getattr(self.fmi.Fmi3Causality, kind), **self.access(name)}
            if kind == "parameter":
                options["variability"] = self.fmi.Fmi3Variability.fixed
            self.register_variable(self.fmi.Float64(name, unit=unit, **options))

    def do_step(self, current_time, step_size):
        self.advance(current_time, step_size)
        return self.fmi.Fmi3StepResult()
