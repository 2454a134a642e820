"""The interface of coupled parts: their protocol, the exchange of fields, and failures."""

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
# For the fixed-stress split: the pressure at which the solid computed its rate, and the derivative
# of that rate by the pressure. The fluid takes rate + slope (p - reference pressure) as its source.
REFERENCE_PRESSURE = "reference_pressure"  # [Pa] per cell
VOLUME_RATE_SLOPE = "volume_rate_slope"  # [m3/(s Pa)] per cell
THICKNESS_RATE_SLOPE = "thickness_rate_slope"  # [m/(s Pa)] per cell
# For a solid with time steps of its own: within a window the pore pressure falls with the rate of
# the volume, p = pressure at rest - resistance * rate, because the fluid has to flow off. The fluid
# gives the pressure at rest from the pressure and the rate at the end of the window.
VOLUME = "volume"  # [m3] per cell, at the end of the step
RESISTANCE = "pore_resistance"  # [Pa s/m3] per cell
PRESSURE_AT_REST = "pressure_at_rest"  # [Pa] per cell
# Nodes of the mid-surface.
POINTS = "points"  # [m] (3 N,), x y z of one node after the other


class Jumps(Protocol):
    """Values between parts that change in jumps, besides the exchanges of fields.

    A window is repeated with the new values until it does not change them any more.
    """

    most_iterations: int

    def begin(self) -> None:
        """Go back to the values at the begin of the window."""

    def follow(self) -> list[str]:
        """Take the present values of the parts; return in words what that changes."""


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
        """Go on by ``step`` [s], in any number of time steps of its own, with constant inputs.

        To a part that solves implicitly the inputs are the values at the end of the step.

        Raises
        ------
        SimulationError : the step failed; a :class:`PartFailed` names time and inputs. The system
            restores the part and may try a shorter step.
        """

    def save(self) -> object:
        """Return a copy of the whole state, inputs included; advancing does not change it."""

    def restore(self, saved: Any) -> None:
        """Return to a saved state, any number of times; going on from it is bit-identical."""

    def set_fields(self, fields: Mapping[str, Values]) -> None:
        """Set inputs by name; they hold until they are set again. The part copies the arrays.

        Raises
        ------
        InputError : a name that is no input, or a wrong number of values.
        """

    def get_fields(self, names: Sequence[str]) -> Fields:
        """Return present outputs by name; a rate is the mean over the last step.

        Raises
        ------
        InputError : a name that is no output.
        """


@runtime_checkable
class HasPlaces(Protocol):
    """A part that knows the positions of the values of its fields, for messages."""

    def places(self, name: str) -> Values | None:
        """Return the positions (n, 3) [m] of a field's values, None where there are none."""


class PartFailed(SimulationError):
    """A part could not do its step; names the part, the time, the step and its inputs.

    Parameters
    ----------
    reason : what happened, in words.
    part : name of the part; a system fills it in.
    time, step : begin and size of the step [s].
    inputs : last inputs by name; the message has their ranges.
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

    The residual is the change of the field in an iteration, by ``norm``: the root mean square over
    the values, or the largest. It must be below ``relative`` and ``increment``, as far as they are
    given. A residual below ``absolute`` or ``floor`` suffices in any case.

    Parameters
    ----------
    relative : limit of the residual, relative to the field.
    increment : limit relative to the change of the field since the begin of the window.
    absolute : limit in the unit of the field.
    floor : limit relative to the largest size that the field has had, so that a field that fades
        need not converge in its round-off.
    """

    relative: float | None = 1e-6
    increment: float | None = None
    absolute: float | None = None
    floor: float = 1e-10
    norm: Literal["rms", "largest"] = "rms"

    def __post_init__(self) -> None:
        limits = {"relative": self.relative, "increment": self.increment, "absolute": self.absolute}
        if all(limit is None for limit in limits.values()):
            raise InputError("a tolerance needs a relative, an increment or an absolute part")
        for name, limit in limits.items():
            if limit is not None and not (0.0 < limit < math.inf):
                raise InputError(f"the {name} tolerance must be positive, not {limit:g}")
        if not (0.0 <= self.floor < 1.0):
            raise InputError(f"the floor of a tolerance must lie in 0..1, not {self.floor:g}")
        if self.norm not in ("rms", "largest"):
            raise InputError('the norm of a tolerance must be "rms" or "largest"')


class MappingMatrix(Protocol):
    """A matrix (n_target, n_source), dense or sparse."""

    def __matmul__(self, values: Values, /) -> Values:
        """Return the values (n_target,) on the target's mesh."""


#: An operator between the meshes of two parts: a matrix (n_target, n_source) or a function.
FieldMapping = MappingMatrix | Callable[[Values], Values]


@dataclass(frozen=True, eq=False)
class Exchange:
    """A field that goes from one part to another.

    Parameters
    ----------
    source, target : names of the parts in the system.
    field : its name as an output of the source.
    target_field : its name as an input of the target; by default the same.
    mapping : from the source's mesh to the target's: a matrix (n_target, n_source), dense or
        sparse, or a function of the values; None where both have the same cells.
    tolerance : when it counts as converged; None where it need not converge.
    judged : ``unknown``: only as an unknown of the iteration, by the answer to it. ``always``: in a
        serial scheme also where it leads forward, by its change in the last iteration. Such fields
        follow from the unknowns, so that this costs one iteration more.
    scale : size of the field in its unit, which weighs it against others in a quasi-Newton
        scheme; None takes the largest size so far.
    relaxation : factor 0..1 on top of the scheme's own relaxation, for this field.
    bounds : (least, largest) value that the iteration may try, in the unit of the field: a pressure
        not below the vent's, for example. Answers of the source are not limited.
    iterated : False for a field that only accompanies another one (a slope, a reference) and is
        no unknown; it must lead forward in a serial scheme.
    of_window : what the target gets of the source's sub-steps: the ``end`` value, or the ``mean``,
        which conserves a rate.
    within : in the target's sub-steps ``linear`` in time between the ends of windows, or ``held``
        at the new value.
    """

    source: str
    target: str
    field: str
    target_field: str = ""
    mapping: FieldMapping | None = None
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
        mapping = self.mapping
        mapped = mapping(values) if callable(mapping) else mapping @ values
        return np.array(mapped, dtype=np.float64)


def fixed_stress_exchanges(
    solid: str, fluid: str, *, rate: str = VOLUME_RATE, mapping: FieldMapping | None = None
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

    of_step : an output is the value at the ``end`` of the system's step or the ``mean`` over it.
    """

    part: str
    field: str
    of_step: Literal["end", "mean"] = "end"


def find_port(name: str, ports: Mapping[str, Port], parts: Collection[str], kind: str) -> Port:
    """Return the port with this name; ``"part.field"`` names a field of a part directly.

    Raises
    ------
    InputError : there is none; lists the known ones.
    """
    if name in ports:
        return ports[name]
    part, _, field = name.partition(".")
    if part in parts and field:
        return Port(part, field)
    known = ", ".join([*ports, *(f"{part}.<field>" for part in parts)])
    raise InputError(f'the coupled system has no {kind} "{name}"; there are {known}')


# --- checks of fields -----------------------------------------------------------------------------


def checked_field(name: str, values: np.ndarray, count: int) -> np.ndarray:
    """Return a copy of the values of a field (count,), one per cell.

    Raises
    ------
    InputError : a wrong number of values, or a value that is no number; names the cell.
    """
    values = np.array(values, dtype=float)
    if values.shape != (count,):
        raise InputError(f"{name} has the shape {values.shape}; there are {count} cells")
    if not np.isfinite(values).all():
        cell = int(np.flatnonzero(~np.isfinite(values))[0])
        raise InputError(f"{name} is {values[cell]} in cell {cell}")
    return values


def selected_fields(names: Sequence[str], outputs: Fields) -> Fields:
    """Return copies of the outputs with these names.

    Raises
    ------
    InputError : a name that is no output.
    """
    unknown = [name for name in names if name not in outputs]
    if unknown:
        raise InputError(f'"{unknown[0]}" is no output; there are {", ".join(outputs)}')
    return {name: outputs[name].copy() for name in names}
