"""Scene tables of the places where resin enters and air leaves, and when they are open."""

from __future__ import annotations

from typing import Annotated, Any, Self

from pydantic import Field, field_validator, model_validator

from lcmchain.mesh.places import NamedPlace, Where
from lcmchain.quantities.at_work import AtWork
from lcmchain.quantities.entry_types import (
    AbsentMeans,
    FlowRate,
    PositiveTime,
    Pressure,
    Row,
    Switch,
    TimeOrZero,
    wrong,
)
from lcmchain.scene.over_time import Times, as_row, require_times

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
        description="Where resin flows in [[stages]] (with_forming): those in which it is open; "
        "its times then count from when the first one begins. Left out, all of them.",
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
        Annotated[tuple[Pressure, ...], Row('"0.3 MPa"', minimum_count=1)] | None, AbsentMeans("")
    ] = Field(default=None, description="Pressure of the resin, or one for each of times.")
    flow_rate: Annotated[
        Annotated[tuple[FlowRate, ...], Row('"5 ml/s"', minimum_count=1)] | None, AbsentMeans("")
    ] = Field(default=None, description="Flow rate of the whole gate, or one for each of times.")
    times: Times = Field(
        default=None,
        description="Times of the pressures or flow rates, which are linear between them and "
        "constant before and after.",
    )
    pressure_limit: Annotated[Pressure | None, AbsentMeans("none")] = Field(
        default=None,
        description="Highest pressure of a flow rate, as of the pump: it holds from there on.",
    )

    @field_validator("pressure", "flow_rate", mode="before")
    @classmethod
    def _take_one(cls, value: Any) -> Any:
        return as_row(value)

    @property
    def in_words(self) -> str:
        """Place, value and times, for the check of a scene."""
        return f"{_text(self)} at {super().in_words}" + (f", {self.when}" if self.when else "")

    @model_validator(mode="after")
    def _check_values(self) -> Self:
        given = [name for name in ("pressure", "flow_rate") if getattr(self, name) is not None]
        if len(given) != 1:
            raise wrong(
                f"needs one of pressure and flow_rate, but has {' and '.join(given) or 'none'}"
            )
        kind = given[0]
        values = getattr(self, kind)
        require_times(kind, values, self.times)
        if kind == "flow_rate" and (min(values) < 0.0 or max(values) <= 0.0):
            raise wrong("must not be negative, and above zero at some time", field="flow_rate")
        if kind == "pressure" and self.pressure_limit is not None:
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


def _text(gate: Gate) -> str:
    """Say pressures or flow rates."""
    if gate.pressure is not None:
        values, unit, factor = gate.pressure, "bar", 1e-5
    else:
        values, unit, factor = gate.flow_rate or (), "ml/s", 1e6
    low, high = factor * min(values), factor * max(values)
    return f"{high:.4g} {unit}" if low == high else f"{low:.4g} to {high:.4g} {unit}"
