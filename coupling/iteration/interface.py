"""What coupled parts offer each other: a protocol, the exchange of fields, and their failures."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from lcmchain.errors import InputError, SimulationError

#: Values of a field, per cell (C,) or per node (N,), float64.
Values = NDArray[np.float64]
#: Values of fields by name.
Fields = dict[str, Values]

# Names of the fields that forming and fluid exchange.
PORE_PRESSURE = "pore_pressure"  # [Pa] per cell
THICKNESS = "thickness"  # [m] per cell
THICKNESS_RATE = "thickness_rate"  # [m/s] per cell
VOLUME_RATE = "volume_rate"  # [m3/s] per cell
# For the fixed-stress split: the pressure at which a solid has found its rate, and the derivative
# of that rate by the pressure. The fluid takes rate + slope (p - reference pressure) as its source.
REFERENCE_PRESSURE = "reference_pressure"  # [Pa] per cell
VOLUME_RATE_SLOPE = "volume_rate_slope"  # [m3/(s Pa)] per cell
THICKNESS_RATE_SLOPE = "thickness_rate_slope"  # [m/(s Pa)] per cell
# For a solid that moves on in steps of its own: within a window the pore pressure falls with the
# rate of the volume by the solid's resistance, as a fluid answers that must flow off. The fluid
# gives the pressure at rest, p + resistance * rate, as it has found both.
VOLUME = "volume"  # [m3] per cell, at the end of the step
RESISTANCE = "pore_resistance"  # [Pa s/m3] per cell
PRESSURE_AT_REST = "pressure_at_rest"  # [Pa] per cell


class Jumps(Protocol):
    """What goes between parts beside the exchanges and changes in jumps: iterated until it stays.

    A window is repeated with what the parts have found, until they find what they were given.
    """

    most_iterations: int

    def begin(self) -> None:
        """Give what there was at the begin of the window: it is gone through anew."""

    def follow(self) -> list[str]:
        """Give what the parts have found from now on; return in words what that changes."""


@runtime_checkable
class CoupledPart(Protocol):
    """A simulation that advances in time, exchanges fields and can go back to a saved state.

    A Python object, an FMU and a coupled system all satisfy it. Explicit schemes with windows of
    constant size never save or restore.
    """

    @property
    def time(self) -> float:
        """Return the present time [s]."""

    def advance(self, step: float) -> None:
        """Go on by ``step`` [s], any number of own steps; inputs are held over it.

        A part that solves implicitly takes the inputs as the values at the end of the step.

        Raises
        ------
        SimulationError : (a :class:`PartFailed` names time and inputs) the step cannot be done. The
            system restores the part and may try a shorter one.
        """

    def save(self) -> Any:
        """Return a copy of the whole state, inputs included; advancing does not change it."""

    def restore(self, saved: Any) -> None:
        """Return to a saved state, any number of times; going on from it is bit-identical."""

    def set_fields(self, fields: Mapping[str, Values]) -> None:
        """Take inputs by name; they hold until they are set again. The part copies what it keeps.

        Raises
        ------
        InputError : a name that is no input, or a wrong number of values.
        """

    def get_fields(self, names: Sequence[str]) -> Fields:
        """Return outputs by name at the present time; a rate is its mean over the last step.

        Raises
        ------
        InputError : a name that is no output.
        """


@runtime_checkable
class HasPlaces(Protocol):
    """A part that knows where the values of its fields lie, for messages."""

    def places(self, name: str) -> Values | None:
        """Return the positions (n, 3) [m] of a field's values, None where there are none."""


class PartFailed(SimulationError):
    """A part that could not do its step; names the part, the time, the step and its inputs.

    Parameters
    ----------
    reason : what happened, in words.
    part : name of the part; a system fills it in.
    time, step : where the step began and how long it was [s].
    inputs : last inputs by name; their ranges are written into the message.
    """

    def __init__(
        self,
        reason: str,
        *,
        part: str = "",
        time: float = math.nan,
        step: float = math.nan,
        inputs: Mapping[str, Values] | None = None,
    ) -> None:
        self.reason, self.part, self.time, self.step = reason, part, time, step
        self.inputs = {} if inputs is None else dict(inputs)
        head = f'coupled part "{part}" failed' if part else "a coupled part failed"
        if not math.isnan(time):
            head += f" at {time:g} s"
        if not math.isnan(step):
            head += f", step {step:g} s"
        ranges = [f"{name} {_range_text(values)}" for name, values in self.inputs.items()]
        given = f". Its inputs: {'; '.join(ranges)}" if ranges else ""
        super().__init__(f"{head}: {reason}{given}")


@dataclass(frozen=True)
class Tolerance:
    """When a field counts as converged.

    The residual is what an iteration changes, measured by ``norm``: the root mean square over the
    values, or the largest. ``relative`` and ``increment`` must hold, those that are given;
    ``absolute`` and ``floor`` are floors: a residual below one of them suffices.

    Parameters
    ----------
    relative : residual over the field.
    increment : residual over the field's change since the beginning of the window.
    absolute : residual, in the unit of the field.
    floor : residual over the largest size that the field has had: a field that fades is not
        followed into its round-off.
    """

    relative: float | None = 1e-6
    increment: float | None = None
    absolute: float | None = None
    floor: float = 1e-10
    norm: Literal["rms", "largest"] = "rms"

    def __post_init__(self) -> None:
        given = {"relative": self.relative, "increment": self.increment, "absolute": self.absolute}
        if all(value is None for value in given.values()):
            raise InputError("a tolerance needs a relative, an increment or an absolute part")
        for name, value in given.items():
            if value is not None and not (0.0 < value < math.inf):
                raise InputError(f"the {name} tolerance must be positive, not {value:g}")
        if not (0.0 <= self.floor < 1.0):
            raise InputError(f"the floor of a tolerance must lie in 0..1, not {self.floor:g}")
        if self.norm not in ("rms", "largest"):
            raise InputError('the norm of a tolerance must be "rms" or "largest"')


#: An operator between the meshes of two parts: a matrix (n_target, n_source) or a function.
FieldMapping = Any


@dataclass(frozen=True, eq=False)
class Exchange:
    """A field that goes from one part to another.

    Parameters
    ----------
    source, target : names of the parts in the system.
    field : its name as an output of the source.
    target_field : its name as an input of the target; the same without.
    mapping : from the source's mesh to the target's: a matrix (n_target, n_source), dense or
        sparse, or a function of the values; None where both have the same cells.
    tolerance : when it counts as converged; None where it is passed on unjudged.
    judged : an ``unknown`` of the iteration only, by what the parts answer to it; or ``always``:
        in a serial scheme then also the fields that lead forward, by what the last iteration
        changed. They follow from the unknowns, so that judging them costs one iteration more.
    scale : size of the field in its unit, which weighs it against others in a quasi-Newton
        scheme; None takes the largest size so far.
    relaxation : factor 0..1 on top of the scheme's own relaxation, for this field.
    bounds : (least, largest) value that the iteration may try, in the unit of the field: a pressure
        is not below the vent's, for example. What the source answers is not touched.
    iterated : False for a field that only accompanies another one (a slope, a reference) and is
        no unknown; it must lead forward in a serial scheme.
    of_window : what the target gets of the source's sub-steps: the ``end`` value, or the ``mean``,
        which conserves a rate.
    within : the target's sub-steps see it ``linear`` in time between the windows' ends, or ``held``
        at its new value.
    """

    source: str
    target: str
    field: str
    target_field: str = ""
    mapping: FieldMapping = None
    tolerance: Tolerance | None = Tolerance()
    judged: Literal["unknown", "always"] = "unknown"
    scale: float | None = None
    relaxation: float = 1.0
    bounds: tuple[float, float] | None = None
    iterated: bool = True
    of_window: Literal["end", "mean"] = "end"
    within: Literal["linear", "held"] = "linear"

    def __post_init__(self) -> None:
        if self.scale is not None and not (0.0 < self.scale < math.inf):
            raise InputError(f"the scale of {self.name} must be positive, not {self.scale:g}")
        if not (0.0 < self.relaxation <= 1.0):
            raise InputError(
                f"the relaxation of {self.name} must lie in 0..1, not {self.relaxation:g}"
            )
        if self.bounds is not None and not self.bounds[0] < self.bounds[1]:
            raise InputError(
                f"the bounds of {self.name} must rise, not {self.bounds[0]:g} to {self.bounds[1]:g}"
            )
        if self.judged not in ("unknown", "always"):
            raise InputError(f'judged of {self.name} must be "unknown" or "always"')
        if self.of_window not in ("end", "mean"):
            raise InputError(f'of_window of {self.name} must be "end" or "mean"')
        if self.within not in ("linear", "held"):
            raise InputError(f'within of {self.name} must be "linear" or "held"')

    @property
    def input(self) -> str:
        """Return the name of the field as an input of the target."""
        return self.target_field or self.field

    @property
    def name(self) -> str:
        """Return the exchange in words, for messages and histories."""
        return f"{self.source}.{self.field} -> {self.target}.{self.input}"

    def carry(self, values: Values) -> Values:
        """Return the source's values on the target's mesh, always a new array."""
        if self.mapping is None:
            return np.array(values, dtype=np.float64)
        apply: Callable[[Any], Any] | None = self.mapping if callable(self.mapping) else None
        carried = self.mapping @ values if apply is None else apply(values)
        return np.array(carried, dtype=np.float64)


def fixed_stress_exchanges(
    solid: str, fluid: str, *, rate: str = VOLUME_RATE, mapping: FieldMapping = None
) -> list[Exchange]:
    """Return the two exchanges that turn a serial solid-fluid coupling into the fixed-stress split.

    The solid reports the derivative of its rate by the pressure at fixed total stress and the
    pressure that it belongs to; the fluid adds ``slope (p - reference)`` to the rate. The added
    term vanishes with convergence (Kim, Tchelepi, Juanes 2011). Put the solid before the fluid.
    """
    slope = {VOLUME_RATE: VOLUME_RATE_SLOPE, THICKNESS_RATE: THICKNESS_RATE_SLOPE}.get(rate)
    if slope is None:
        raise InputError(f'the fixed-stress split knows no slope of "{rate}"')
    return [
        Exchange(solid, fluid, name, mapping=mapping, tolerance=None, iterated=False, within="held")
        for name in (slope, REFERENCE_PRESSURE)
    ]


def _range_text(values: Values) -> str:
    values = np.asarray(values)
    if values.size == 0:
        return "empty"
    if not np.all(np.isfinite(values)):
        return f"{np.count_nonzero(~np.isfinite(values))} of {values.size} not finite"
    return f"{values.min():.4g} to {values.max():.4g}"


# --- fields that a coupled system offers as a part ------------------------------------------------


@dataclass(frozen=True)
class Port:
    """An input or output of a part that the system offers under a name of its own.

    ``of_step``: an output is the value at the ``end`` of the system's step or its ``mean``.
    """

    part: str
    field: str
    of_step: Literal["end", "mean"] = "end"


def find_port(name: str, ports: Mapping[str, Port], parts: Collection[str], kind: str) -> Port:
    """Return the port of that name; ``"part.field"`` names a field of a part directly.

    Raises
    ------
    InputError : there is none; names those that there are.
    """
    if name in ports:
        return ports[name]
    part, _, field = name.partition(".")
    if part in parts and field:
        return Port(part, field)
    known = ", ".join([*ports, *(f"{part}.<field>" for part in parts)])
    raise InputError(f'the coupled system has no {kind} "{name}"; there are {known}')
