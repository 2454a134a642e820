"""Scene tables of what acts on the resin: what presses on the part, gates and vents."""

from __future__ import annotations

from itertools import pairwise
from typing import Annotated, ClassVar, Literal, Self

from pydantic import Field, model_validator

from lcmchain.mesh.places import NamedPlace, Where
from lcmchain.quantities.entry_types import (
    POSITIVE,
    AbsentMeans,
    AtWork,
    Direction,
    FlowRate,
    Force,
    Number,
    PositiveLength,
    PositiveTime,
    Pressure,
    Row,
    SceneModel,
    Switch,
    TimeOrZero,
    wrong,
)

# --- entries that are one value, or one for each of times -----------------------------------------


#: Times of the values of another entry, which are linear between them.
Times = Annotated[
    Annotated[tuple[TimeOrZero, ...], Row('"0 10 60 s"', minimum_count=2)] | None, AbsentMeans("")
]


def require_times(entry: str, values: tuple[float, ...], times: tuple[float, ...] | None) -> None:
    """Refuse values that are not as many as their times, and times that do not increase.

    Raises
    ------
    PydanticCustomError : names the entry of the values, or the times.
    """
    count = 1 if times is None else len(times)
    if len(values) != count:
        wanted = "one value" if times is None else f"{count} values, as times has"
        raise wrong(f"needs {wanted}, but has {len(values)}", field=entry)
    if times is not None and any(b <= a for a, b in pairwise(times)):
        raise wrong("must increase from one to the next", field="times")


class OverTime(SceneModel):
    """Base of tables with an entry that has one value, or one for each of ``times``."""

    #: Name of the entry.
    over_time: ClassVar[str]

    @model_validator(mode="after")
    def _check_times(self) -> Self:
        values, times = (getattr(self, entry) for entry in (self.over_time, "times"))
        require_times(self.over_time, values, times)
        return self


# --- what presses on the part: a bag, tools at a gap, a press -------------------------------------


class _Closure(OverTime):
    """What presses, and how it is coupled with the resin."""

    window: Annotated[PositiveTime | None, AbsentMeans("a two-hundredth of the filling's time")] = (
        Field(
            default=None,
            description="First time window over which resin and textile are iterated; windows of "
            "many iterations become shorter, others longer.",
        )
    )
    tolerance: Annotated[float, Number(1e-4, POSITIVE)] = Field(
        default=1e-4,
        description="Change of the pore pressures in the last iteration of a window, relative to "
        "them.",
    )


class _Pressed(_Closure):
    """What presses with a pressure or force from the start on."""

    pressed: Annotated[
        Literal["dry", "wet"] | None, AbsentMeans("wet where the case has [[wetted]], else dry")
    ] = Field(
        default=None,
        description="The preform at the start: dry, pressed before the resin comes, so that "
        "wetted places are full at the pressed thickness; or wet, as thick as formed "
        "where resin is, which first has to leave.",
    )


class Bag(_Pressed):
    """A bag or diaphragm: each cell bears its pressure."""

    over_time = "pressure"

    type: Literal["bag"]
    pressure: Annotated[tuple[Pressure, ...], Row('"1 bar"', one=True, minimum_count=1)] = Field(
        description="Pressure on the bag, or one for each of times, in the system of the vents'."
    )
    times: Times = Field(default=None, description="Times of the pressures, linear between them.")

    @property
    def in_words(self) -> str:
        """What presses, for the check of a scene."""
        return f"a bag at {1e-5 * min(self.pressure):.4g} to {1e-5 * max(self.pressure):.4g} bar"


class Gap(_Closure):
    """Rigid tools that close to a gap; a cell keeps its formed thickness until they arrive."""

    over_time = "thickness"

    type: Literal["gap"]
    thickness: Annotated[tuple[PositiveLength, ...], Row('"0.8 mm"', one=True, minimum_count=1)] = (
        Field(description="Gap of the closed tools, or one for each of times.")
    )
    closing_time: Annotated[PositiveTime | None, AbsentMeans("")] = Field(
        default=None,
        description="Time in which they close, at a constant speed from the thickest cell on.",
    )
    times: Times = Field(
        default=None,
        description="Times of the gaps, linear between them, in place of closing_time.",
    )
    direction: Annotated[Direction | None, AbsentMeans("normal to each cell")] = Field(
        default=None, description="Direction of closing, for the force of the press."
    )

    @model_validator(mode="after")
    def _check_closing(self) -> Self:
        if (self.closing_time is None) == (self.times is None):
            given = "both" if self.times is not None else "neither"
            raise wrong(
                f"needs closing_time, or times with a thickness for each, but has {given}; for "
                'example closing_time = "30 s"',
                field="closing_time",
            )
        return self

    @property
    def in_words(self) -> str:
        """What presses, for the check of a scene."""
        duration = self.closing_time
        if duration is None:
            duration = self.times[-1] if self.times is not None else 0.0
        return f"tools that close to {1e3 * min(self.thickness):.4g} mm in {duration:g} s"


class Press(_Pressed):
    """A rigid tool under a force."""

    over_time = "force"

    type: Literal["press"]
    force: Annotated[tuple[Force, ...], Row('"10 kN"', one=True, minimum_count=1)] = Field(
        description="Force of the press, or one for each of times."
    )
    times: Times = Field(default=None, description="Times of the forces, linear between them.")
    direction: Annotated[Direction | None, AbsentMeans("normal to each cell")] = Field(
        default=None, description="Direction of closing."
    )

    @model_validator(mode="after")
    def _check_force(self) -> Self:
        if min(self.force) < 0.0 or max(self.force) == 0.0:
            raise wrong("presses, so it must not be negative, nor zero for ever", field="force")
        return self

    @property
    def in_words(self) -> str:
        """What presses, for the check of a scene."""
        return f"a press with {min(self.force):.4g} to {max(self.force):.4g} N"


Closure = Annotated[Bag | Gap | Press, Field(discriminator="type")]


# --- where resin enters and air leaves ------------------------------------------------------------


#: A place that may be left out.
Arrival = Annotated[Where | None, AbsentMeans("")]


class _Opening(NamedPlace):
    """A place where resin or air passes the boundary, and when it is open."""

    opens: TimeOrZero = Field(default="0 s", description="Time from which on it may be open.")  # type: ignore[assignment]
    closes: Annotated[PositiveTime | None, AbsentMeans("never")] = Field(
        default=None, description="Time at which it closes for good."
    )
    stages: AtWork = Field(
        default=None,
        description="With with_forming: stages in which it is open; its times count from the "
        "start of the first one. Left out, all stages.",
    )
    opens_on_arrival: Arrival = Field(
        default=None, description="It stays closed until the front arrives at this place."
    )
    closes_on_arrival: Arrival = Field(
        default=None, description="It closes for good when the front arrives at this place."
    )

    @property
    def when(self) -> str:
        """When it is open, for the check of a scene."""
        parts = [] if self.stages is None else [f"in {', '.join(self.stages)}"]
        parts += [f"from {self.opens:g} s"] if self.opens > 0.0 else []
        if self.closes is not None:
            parts.append(f"until {self.closes:g} s")
        if self.opens_on_arrival is not None:
            parts.append(f"once the front is at {self.opens_on_arrival.in_words}")
        if self.closes_on_arrival is not None:
            parts.append(f"until the front is at {self.closes_on_arrival.in_words}")
        return ", ".join(parts)

    @model_validator(mode="after")
    def _check_times(self) -> Self:
        if self.closes is not None and self.closes <= self.opens:
            raise wrong(
                f"is {self.closes:g} s, but it opens at {self.opens:g} s only", field="closes"
            )
        return self


class Gate(_Opening):
    """Where resin enters, at a pressure or a flow rate."""

    pressure: Annotated[
        Annotated[tuple[Pressure, ...], Row('"0.3 MPa"', one=True, minimum_count=1)] | None,
        AbsentMeans(""),
    ] = Field(default=None, description="Pressure of the resin, or one for each of times.")
    flow_rate: Annotated[
        Annotated[tuple[FlowRate, ...], Row('"5 ml/s"', one=True, minimum_count=1)] | None,
        AbsentMeans(""),
    ] = Field(default=None, description="Flow rate of the whole gate, or one for each of times.")
    times: Times = Field(
        default=None,
        description="Times of pressures or flow rates: linear between them, constant before and "
        "after.",
    )
    pressure_limit: Annotated[Pressure | None, AbsentMeans("none")] = Field(
        default=None,
        description="Highest pressure of a flow rate, as of the pump: it holds from there on.",
    )

    @property
    def in_words(self) -> str:
        """Place, value and times, for the check of a scene."""
        return f"{_values_text(self)} at {super().in_words}" + (
            f", {self.when}" if self.when else ""
        )

    @model_validator(mode="after")
    def _check_values(self) -> Self:
        given = [name for name in ("pressure", "flow_rate") if getattr(self, name) is not None]
        if len(given) != 1:
            raise wrong(
                f"needs one of pressure and flow_rate, but has {' and '.join(given) or 'none'}"
            )
        entry = given[0]
        values = getattr(self, entry)
        require_times(entry, values, self.times)
        if entry == "flow_rate" and (min(values) < 0.0 or max(values) <= 0.0):
            raise wrong("must not be negative, and above zero at some time", field="flow_rate")
        if entry == "pressure" and self.pressure_limit is not None:
            raise wrong("belongs to a flow_rate, which is not given", field="pressure_limit")
        return self


class Vent(_Opening):
    """Where air leaves, and resin once the front has come."""

    pressure: Annotated[Pressure | None, AbsentMeans("vent_pressure")] = Field(
        default=None, description="Pressure there."
    )
    bleeds: Switch = Field(
        default=False,
        description="Resin leaves there once the front has come; without it each node closes then.",
    )

    except_gates: Switch = Field(
        default=False,
        description="Nodes of gates are left out, as where a gate lies on the rim that vents.",
    )

    @property
    def in_words(self) -> str:
        """Place and times, for the check of a scene."""
        but = " but the gates" if self.except_gates else ""
        return super().in_words + but + (f", {self.when}" if self.when else "")


def _values_text(gate: Gate) -> str:
    """Say pressures or flow rates."""
    if gate.pressure is not None:
        values, unit, factor = gate.pressure, "bar", 1e-5
    else:
        values, unit, factor = gate.flow_rate or (), "ml/s", 1e6
    low, high = factor * min(values), factor * max(values)
    return f"{high:.4g} {unit}" if low == high else f"{low:.4g} to {high:.4g} {unit}"
