"""Scene tables of an infiltration: what fills, where it differs, and when it ends."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Any, Literal, Self

from pydantic import Field, field_validator, model_validator

from lcmchain.mesh.places import NamedPlace, Where
from lcmchain.quantities.entry_types import (
    POSITIVE,
    AbsentMeans,
    Acceleration,
    Direction,
    NamedEntry,
    Number,
    PermeabilityValue,
    PositiveLength,
    PositiveTime,
    Pressure,
    Range,
    Row,
    SceneModel,
    Switch,
    with_own_names,
    wrong,
)
from lcmchain.scene.infiltration.boundaries import Arrival, Closure, Gate, OverTime, Times, Vent
from lcmchain.scene.infiltration.laws import Permeability, Resin

# --- what fills: a preform not formed here, a flow medium -----------------------------------------


class OwnPermeability(SceneModel):
    """Permeability of a textile as it lies there, along axes of its own."""

    k1: PermeabilityValue = Field(description="Permeability along the axis.")
    ratio: Annotated[float, Number(1.0, POSITIVE)] = Field(
        default=1.0,
        description="Permeability across the axis, in the plane of the cell, over that along it.",
    )
    axis: Direction = Field(
        default=(1.0, 0.0, 0.0),
        description="Direction in space of k1; it is laid into every cell along its normal.",
    )
    k3: Annotated[PermeabilityValue | None, AbsentMeans("as it was")] = Field(
        default=None,
        description="Permeability through the thickness, which a film or a flow medium asks for.",
    )


class Preform(SceneModel):
    """A preform on a mesh that was not formed here: the same everywhere but in [[regions]]."""

    thickness: PositiveLength = Field(description="Thickness.")
    fibre_volume_fraction: Annotated[float, Number(0.5, Range(0.0, 1.0, (0.0, 1.0)))] = Field(
        description="Share of the fibres in the volume; one less the porosity."
    )
    permeability: OwnPermeability = Field(description="Permeability, with its axes.")
    sets_hold: Literal["nodes or cells", "cells"] = Field(
        default="nodes or cells",
        description="What the sets of a Nastran deck list, which does not say so itself; a place "
        "of nodes takes those of the cells.",
    )


class FlowMedium(SceneModel):
    """A distribution layer on one face of the preform, in which resin runs ahead."""

    thickness: PositiveLength = Field(
        description="Thickness of the layer, which is none of the part's."
    )
    porosity: Annotated[float, Number(0.8, Range(0.0, 1.0, (0.0, 1.0)))] = Field(
        description="Share of the layer's volume that resin can fill."
    )
    permeability: OwnPermeability = Field(description="Permeability of the layer, with its axes.")
    over: Annotated[Where | None, AbsentMeans("")] = Field(
        default=None, description="Cells that it covers; without it the whole part."
    )

    @model_validator(mode="after")
    def _check_layer(self) -> Self:
        if self.over is not None:
            _require_cells(self.over, "over")
        if self.permeability.k3 is not None:
            raise wrong(
                "has no meaning: the layer does not hold resin back through its thickness; k3 of "
                "the preform counts",
                field="permeability.k3",
            )
        return self

    @property
    def in_words(self) -> str:
        """Thickness, permeability and place, for the check of a scene."""
        where = "the whole part" if self.over is None else self.over.in_words
        return f"{1e3 * self.thickness:.3g} mm of {self.permeability.k1:.3g} m² on {where}"


def _require_cells(where: Where, field: str | None = None) -> None:
    """Refuse a place of which it is not clear which cells it takes.

    field : of the table that the place stands in, None where it is the table.
    """
    if where.rim or where.loop is not None or where.boundary is not None:
        raise wrong("takes cells: name a set, a box or a point with its radius", field=field)
    if where.point is not None and where.radius is None:
        raise wrong(
            "needs the radius around the point within which cells lie",
            field="radius" if field is None else f"{field}.radius",
        )


# --- flow while the blank is formed ---------------------------------------------------------------


class WithForming(SceneModel):
    """Forming and flow at once, as in wet compression moulding; both are brought to agree."""

    window: Annotated[PositiveTime | None, AbsentMeans("a four-hundredth of process.time")] = Field(
        default=None,
        description="First time window, on the clock of forming, over which resin and textile "
        "are iterated; windows of many iterations become shorter, others longer.",
    )
    tolerance: Annotated[float, Number(1e-3, POSITIVE)] = Field(
        default=1e-3,
        description="Change of the pore pressures in the last iteration of a window, relative to "
        "them.",
    )

    open_faces: Literal["closed", "air"] = Field(
        default="closed",
        description="What a face that no tool touches lets through: nothing, as under a film, so "
        "that suction may hold the sheet together; or air, which comes in before the "
        "pressure falls below vent_pressure.",
    )

    @property
    def in_words(self) -> str:
        """How it is coupled, for the check of a scene."""
        return f"while the blank is formed, pressures to {self.tolerance:g}"


# --- the infiltration -----------------------------------------------------------------------------


MOST_PLACES = 200


class Region(NamedPlace):
    """Cells whose thickness, fibre volume fraction or permeability is another than the mapped."""

    thickness: Annotated[PositiveLength | None, AbsentMeans("as mapped")] = Field(
        default=None, description="Thickness; the fibre volume fraction stays unless it is given."
    )
    fibre_volume_fraction: Annotated[
        Annotated[float, Number(0.5, Range(0.0, 1.0, (0.0, 1.0)))] | None, AbsentMeans("as mapped")
    ] = Field(
        default=None,
        description="Share of the fibres in the volume; a permeability law of the infiltration "
        "follows it.",
    )
    own_permeability: Annotated[OwnPermeability | None, AbsentMeans("as mapped, or by law")] = (
        Field(
            default=None,
            description="Permeability along axes of its own, in place of that of a law.",
        )
    )
    permeability_factor: Annotated[float, Number(1.0, POSITIVE)] = Field(
        default=1.0, description="Factor of all permeabilities."
    )

    @model_validator(mode="after")
    def _check_place(self) -> Self:
        _require_cells(self)
        changes = self.thickness, self.fibre_volume_fraction, self.own_permeability
        if changes == (None, None, None) and self.permeability_factor == 1.0:
            raise wrong(
                "changes nothing; give thickness, fibre_volume_fraction, own_permeability or a "
                "factor"
            )
        return self


class RaceTrack(NamedPlace):
    """An open channel along edges of the mesh, such as a gap between the preform and the mould."""

    width: PositiveLength = Field(
        description="Width of the channel, which is as high as the preform is thick."
    )

    @model_validator(mode="after")
    def _check_place(self) -> Self:
        if self.point is not None:
            raise wrong("runs along edges: name a set, a box, loop or rim = true", field="point")
        return self


class WettedPlace(NamedPlace):
    """Where the preform is full of resin from the start."""


class ResinFilm(OverTime):
    """Resin that lies on the preform at the start and is pressed into it, as in wet moulding."""

    over_time = "pressure"

    thickness: PositiveLength = Field(description="Thickness of the film.")
    over: Arrival = Field(default=None, description="Where it lies; without it on the whole part.")
    pressure: Annotated[tuple[Pressure, ...], Row('"0.5 MPa"', one=True, minimum_count=1)] = Field(
        description="Pressure on the film, or one for each of times."
    )
    times: Times = Field(default=None, description="Times of the pressures, linear between them.")
    capillary_pressure: Pressure = Field(
        default="0 MPa",  # type: ignore[assignment]
        description="Pressure that draws the resin into dry textile.",
    )

    @property
    def in_words(self) -> str:
        """Thickness and place, for the check of a scene."""
        where = "the whole part" if self.over is None else self.over.in_words
        return f"{1e3 * self.thickness:.3g} mm on {where}"


class Infiltration(SceneModel):
    """Infiltration of the formed part: Darcy flow of resin with a moving front."""

    resin: Resin = Field(description="The resin that flows.")
    time: PositiveTime = Field(description="Time at which the filling ends at the latest.")
    gates: Annotated[
        tuple[Gate, ...],
        Row("[[gates]] ...", entries="tables", units=False, maximum_count=MOST_PLACES),
    ] = ()
    vents: Annotated[
        tuple[Vent, ...],
        Row("[[vents]] ...", entries="tables", units=False, maximum_count=MOST_PLACES),
    ] = ()
    vent_pressure: Pressure = Field(
        default="0 MPa",  # type: ignore[assignment]
        description="Pressure of the vents and of the air in the dry preform, the lowest of all; "
        "pressures are all gauge, or all absolute.",
    )
    preform: Annotated[Preform | None, AbsentMeans("of the forming result")] = Field(
        default=None,
        description="What fills a mesh that was not formed here; SOURCE is then the mesh file.",
    )
    permeability: Annotated[Permeability | None, AbsentMeans("of the forming result")] = Field(
        default=None,
        description="Law for the mapped fibre volume fraction and directions, in place of the "
        "mapped permeabilities.",
    )
    regions: Annotated[
        tuple[Region, ...],
        Row("[[regions]] ...", entries="tables", units=False, maximum_count=MOST_PLACES),
    ] = ()
    race_tracks: Annotated[
        tuple[RaceTrack, ...],
        Row("[[race_tracks]] ...", entries="tables", units=False, maximum_count=MOST_PLACES),
    ] = ()
    wetted: Annotated[
        tuple[WettedPlace, ...],
        Row("[[wetted]] ...", entries="tables", units=False, maximum_count=MOST_PLACES),
    ] = ()
    film: Annotated[ResinFilm | None, AbsentMeans("none")] = Field(
        default=None, description="Resin that lies on the preform at the start."
    )
    flow_medium: Annotated[FlowMedium | None, AbsentMeans("none")] = Field(
        default=None,
        description="A layer of high permeability on one face: resin runs ahead in it and sinks "
        "into the preform.",
    )
    closure: Annotated[Closure | None, AbsentMeans("a mould that does not move")] = Field(
        default=None,
        description="What presses on the part while resin flows: the thickness follows from it, "
        "the pore pressure and the textile's compaction law.",
    )
    with_forming: Annotated[WithForming | None, AbsentMeans("after forming")] = Field(
        default=None,
        description="Flow while the blank is formed, on the sheet itself: pore pressure and "
        "thickness act on each other, and time is that of the process for the resin.",
    )
    gravity: Annotated[
        Annotated[
            tuple[Acceleration, Acceleration, Acceleration],
            Row('["0 m/s^2", "0 m/s^2", "-9.81 m/s^2"]', count=3),
        ]
        | None,
        AbsentMeans("none"),
    ] = Field(default=None, description="Acceleration of gravity on the resin.")
    trapped_air: Switch = Field(
        default=False,
        description="Air that the front encloses is compressed; without it such air vanishes at "
        "the pressure of the vents. Needs absolute pressures.",
    )
    frames: Annotated[int, Number(21, Range(2, 10_000), whole=True)] = Field(
        default=21, description="Saved states, at equal shares of the filled pore volume."
    )
    frame_interval: Annotated[PositiveTime | None, AbsentMeans("")] = Field(
        default=None, description="Time between saved states, in place of frames."
    )
    animation: Literal["none", "gif", "mp4"] = Field(
        default="none", description="Film of the front; mp4 needs lcmchain[video]."
    )

    def places(self) -> Iterator[tuple[str, Where]]:
        """Yield every place with its key in this table."""
        for table in ("gates", "vents", "regions", "race_tracks", "wetted"):
            for index, entry in enumerate(getattr(self, table)):
                key = f'{table}[{index}] "{entry.name}"'
                yield key, entry
                for name in ("opens_on_arrival", "closes_on_arrival"):
                    where = getattr(entry, name, None)
                    if where is not None:
                        yield f"{key}.{name}", where
        if self.film is not None and self.film.over is not None:
            yield "film.over", self.film.over
        if self.flow_medium is not None and self.flow_medium.over is not None:
            yield "flow_medium.over", self.flow_medium.over

    def preset_values(self) -> dict[str, Any]:
        """Return the entries of the presets of the resin, with their names."""
        return {"resin": {key: v for key, v in self.resin.preset_values().items() if v}}

    @field_validator("gates", "vents", "regions", "race_tracks", "wetted")
    @classmethod
    def _check_names(cls, items: tuple[NamedEntry, ...]) -> tuple[NamedEntry, ...]:
        return with_own_names(items)

    @model_validator(mode="after")
    def _check_scene(self) -> Self:
        gates = {gate.name for gate in self.gates}
        shared = next((vent.name for vent in self.vents if vent.name in gates), None)
        if shared is not None:
            raise wrong(f'has the name "{shared}" of a gate; give it another', field="vents")
        if self.with_forming is not None:
            self._check_with_forming()
        else:
            self._check_no_stages()
        if self.preform is not None:
            self._check_preform()
        if self.flow_medium is not None:
            self._check_flow_medium()
        self._check_openings()
        if getattr(self.closure, "pressed", None) == "wet" and not self.wetted:
            raise wrong(
                'is "wet", but no resin is in the preform at the start; name where it is with '
                "[[wetted]], or leave the entry out",
                field="closure.pressed",
            )
        if self.trapped_air and self.least_pressure <= 0.0:
            raise wrong(
                f"compresses the air from the pressure of the vents, which is "
                f"{self.least_pressure:g} Pa; give absolute pressures, such as "
                'vent_pressure = "1 bar"',
                field="trapped_air",
            )
        if self.film is not None:
            self._check_film(self.film)
        count = 0.0 if self.frame_interval is None else self.time / self.frame_interval
        if count > 10_000:
            raise wrong("gives more than 10,000 saved states over time", field="frame_interval")
        return self

    @property
    def least_pressure(self) -> float:
        """Lowest pressure of the vents, and of the air in the dry preform [Pa]."""
        own = [vent.pressure for vent in self.vents if vent.pressure is not None]
        return min([self.vent_pressure, *own])

    def _check_openings(self) -> None:
        """Refuse an infiltration through which no resin would flow."""
        if not self.gates and not self.wetted and self.film is None:
            raise wrong("is missing: no resin enters; give [[gates]]", field="gates")
        if not self.vents:
            raise wrong(
                "is missing: the air has nowhere to go, and the front would stop; give [[vents]], "
                "for example one with rim = true",
                field="vents",
            )
        least = self.least_pressure
        for index, gate in enumerate(self.gates):
            at_most = gate.pressure_limit if gate.pressure is None else max(gate.pressure)
            if at_most is not None and at_most <= least:
                name = "pressure" if gate.pressure is not None else "pressure_limit"
                raise wrong(
                    f"is {at_most:g} Pa at most, not above that of the vents "
                    f"({least:g} Pa): no resin would flow",
                    field=f'gates[{index}] "{gate.name}".{name}',
                )

    def _check_film(self, film: ResinFilm) -> None:
        drive, least = max(film.pressure) + film.capillary_pressure, self.least_pressure
        if drive <= least:
            raise wrong(
                f"is {drive:g} Pa at most, with the capillary pressure, not above that of the "
                f"vents ({least:g} Pa): no resin would sink in",
                field="film.pressure",
            )

    def _check_preform(self) -> None:
        """Refuse what a preform that was not formed here knows nothing of."""
        for name, why in (
            ("permeability", "is a law of formed fibres; give preform.permeability"),
            ("closure", "presses by the law of the fabric that was formed; leave it out"),
        ):
            if getattr(self, name) is not None:
                raise wrong(f"{why}, or fill a formed part", field=name)

    def _check_flow_medium(self) -> None:
        """Refuse what is not known of a preform with a flow medium."""
        for name, why in (
            ("closure", "would press the layer together as well, by a law that is not known"),
            ("with_forming", "is of resin in the blank alone"),
            ("film", "is a layer of resin in the place of the flow medium"),
            ("trapped_air", "does not know the air below the layer that resin closes in"),
        ):
            if getattr(self, name):
                raise wrong(f"{why}; leave it or the flow_medium out", field=name)

    def _check_no_stages(self) -> None:
        """Refuse gates and vents of stages in a filling that has none."""
        for name in ("gates", "vents"):
            for number, opening in enumerate(getattr(self, name)):
                if opening.stages:
                    raise wrong(
                        f'names "{opening.stages[0]}", but no resin flows in stages of the process '
                        "without with_forming; give that, or opens and closes instead of it",
                        field=f'{name}[{number}] "{opening.name}".stages',
                    )

    def _check_with_forming(self) -> None:
        """Refuse what makes no sense, or is not known, while the blank is formed."""
        if self.preform is not None:
            raise wrong("is none of a blank that is formed; leave it out", field="preform")
        if any(region.own_permeability is not None for region in self.regions):
            raise wrong(
                "has an own_permeability, but with_forming takes that of the fibres as they lie; "
                "give a permeability_factor",
                field="regions",
            )
        for name in ("closure", "race_tracks", "frame_interval", "trapped_air"):
            if getattr(self, name):
                raise wrong("cannot be combined with with_forming; leave it out", field=name)
        if any(region.thickness is not None for region in self.regions):
            raise wrong(
                "has a thickness, but with_forming takes that of the blank; leave it out",
                field="regions",
            )
