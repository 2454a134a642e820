"""Resin film on top of a textile, which sinks in through the thickness.

In wet compression moulding the resin is poured onto the blank. Under a pressure it sinks in, column
by column, with a front that moves down. Where the front has reached the bottom, the resin of the
column takes part in the flow along the sheet, and the rest of the film above feeds that flow.

Left out: spreading of the film over the textile (the gap between tool and textile is no channel
here), the film's weight and its loss of pressure along the sheet, air that is trapped below the
film, and resin that sinks on by capillarity after its film is used up.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from lcmchain.coupling.infiltration.flow.boundaries import TimeTable, value_at
from lcmchain.coupling.infiltration.flow.medium import Medium
from lcmchain.coupling.infiltration.flow.state import FillingState
from lcmchain.errors import InputError


@dataclass(frozen=True)
class Impregnation:
    """Result of a step of the impregnation, arrays (N,).

    Parameters
    ----------
    depth : impregnated depth [m].
    film : thickness of the film above [m].
    passed : resin that entered, per area of the sheet [m].
    time_through : time within the step [s] at which the front reached the bottom of the column;
        infinite where it has not, zero where it was there before.
    """

    depth: np.ndarray
    film: np.ndarray
    passed: np.ndarray
    time_through: np.ndarray


def impregnate(
    depth: np.ndarray,
    film: np.ndarray,
    *,
    thickness: np.ndarray,
    porosity: np.ndarray,
    permeability: np.ndarray,
    viscosity: np.ndarray,
    pressure: np.ndarray,
    step: float,
    capillary_pressure: np.ndarray | float = 0.0,
) -> Impregnation:
    """Let a film sink into columns of textile for a step.

    Darcy's law with a linear pressure between the film and the front, porosity d(depth)/dt =
    K (pressure + capillary) / (viscosity depth), is solved exactly: depth² grows linearly over
    time, so that the front in a dry column reaches the bottom after t = porosity viscosity
    thickness² / (2 K dp). Impregnation of a column ends there, or when its film is used up. Resin
    is conserved: the loss of the film is the resin that has passed.

    Parameters
    ----------
    depth, film : present depth and film [m], (N,).
    thickness : of the textile [m]. This and the next three are (N,) or one number, constant over
        the step.
    porosity : of the textile.
    permeability : through the thickness, K3 [m²].
    viscosity : [Pa s], infinite where the resin has gelled.
    pressure : on the film, above that of the air below [Pa].
    step : [s].
    capillary_pressure : draws the resin in [Pa]; negative where it holds it back.

    Raises
    ------
    InputError : a thickness, porosity, permeability or viscosity that is not positive, a negative
        depth or film, or a column deeper than the textile.
    """
    depth, film, thickness, porosity, permeability, viscosity, drive = np.broadcast_arrays(
        *(
            np.asarray(value, dtype=float)
            for value in (depth, film, thickness, porosity, permeability, viscosity)
        ),
        np.asarray(pressure, dtype=float) + capillary_pressure,
    )
    _check(depth, film, thickness, porosity, permeability, viscosity)
    # depth² grows by this rate [m2/s]; a pressure below the air's lets nothing in.
    rate = 2.0 * permeability * np.maximum(drive, 0.0) / (porosity * viscosity)
    reached = np.sqrt(depth**2 + rate * step)
    # this form of the increment is exact where it is small against the depth
    advance = np.where(
        reached > 0.0, rate * step / np.where(reached > 0.0, reached + depth, 1.0), 0
    )
    room = np.maximum(thickness - depth, 0.0)
    supply = film / porosity
    advance = np.minimum(np.minimum(advance, room), supply)
    is_through = (advance >= room) & (room <= supply)
    with np.errstate(divide="ignore", invalid="ignore"):
        needed = (thickness**2 - depth**2) / rate
    time_through = np.where(is_through, np.where(room > 0.0, needed, 0.0), np.inf)
    uses_up = (advance >= supply) & ~is_through
    passed = np.where(uses_up, film, np.minimum(porosity * advance, film))
    return Impregnation(
        depth=np.where(is_through, thickness, depth + advance),
        film=film - passed,
        passed=passed,
        time_through=time_through,
    )


def film_conductance(
    thickness: np.ndarray, permeability: np.ndarray, viscosity: np.ndarray
) -> np.ndarray:
    """Return the conductance from a film into a full column, per area of the sheet [m/(Pa s)].

    The column gives its resin off evenly over the thickness, to the flow along the sheet. Then the
    flow through the thickness falls linearly to zero at the bottom, and the mean pressure is below
    that of the film by viscosity thickness q / (3 K3) for a flow q per area: the conductance is
    3 K3 / (viscosity thickness).
    """
    return 3.0 * np.asarray(permeability) / (np.asarray(viscosity) * np.asarray(thickness))


def _check(depth, film, thickness, porosity, permeability, viscosity) -> None:
    positive = {
        "thickness": thickness, "porosity": porosity, "permeability through the thickness":
        permeability, "viscosity": viscosity,
    }  # fmt: skip
    for name, values in positive.items():
        _refuse(~(values > 0.0), values, f"{name} is not positive")
    _refuse(~(depth >= 0.0), depth, "impregnated depth is negative")
    _refuse(~(film >= 0.0), film, "thickness of the film is negative")
    _refuse(
        depth > thickness * (1.0 + 1e-9), depth, "impregnated depth is larger than the thickness"
    )


def _refuse(wrong: np.ndarray, values: np.ndarray, what: str) -> None:
    if np.any(wrong):
        rows = np.flatnonzero(wrong)
        value = values.reshape(-1)[rows[0]]
        raise InputError(
            f"the {what} at {len(rows)} nodes (first at node {rows[0]}: {value:g})", key="film"
        )


# --- the film of a filling ------------------------------------------------------------------------
# Columns that are not full take resin by :func:`impregnate`. A column that the flow along the sheet
# has partly filled counts as impregnated to the same share of its thickness. Full columns take
# resin from the film above by the pressure in the sheet, in a time step no more than the film has.


# Least volume of the film over the pores below; less resin counts as none.
NO_FILM = 1e-12
# A time step ends when columns become full, but not before this share of the slowest one's time.
LEAST_SHARE = 0.05


@dataclass(frozen=True)
class Film:
    """Resin on top of the sheet at the start, and the pressure on it.

    Parameters
    ----------
    thickness : [m], one number or (N,).
    pressure : on the film [Pa], absolute or gauge as those of gates and vents; or a table.
    capillary_pressure : draws the resin into dry textile [Pa].

    Raises
    ------
    InputError : a thickness that is negative or not a number.
    """

    thickness: np.ndarray | float
    pressure: float | TimeTable
    capillary_pressure: float = 0.0

    def __post_init__(self) -> None:
        thickness = np.asarray(self.thickness, dtype=float)
        if not np.all(thickness >= 0.0) or not np.all(np.isfinite(thickness)):
            raise InputError("the thickness of the film must not be negative", key="film.thickness")
        if not np.isfinite(self.capillary_pressure):
            raise InputError("is not a number", key="film.capillary_pressure")


@dataclass(frozen=True)
class FilmSinking:
    """Resin that sinks into columns that are not full, over a time step; as a gate's priming."""

    nodes: np.ndarray
    area: np.ndarray
    columns: dict[str, Any]
    left: float
    duration: float

    def volumes(self, step: float, growth: np.ndarray) -> np.ndarray:
        """Return the volume that enters each of the nodes in a time step [m³].

        Columns that become full take the growth of their pores [m³] as well: else those of a sheet
        that thickens would never be full.
        """
        sunk = impregnate(**self.columns, step=step)
        entered, left = sunk.passed * self.area, sunk.film * self.area
        through = np.isfinite(sunk.time_through)
        return entered + np.where(through, np.clip(growth, -entered, left), 0.0)


@dataclass(frozen=True)
class FilmFlow:
    """The film at the start of a time step.

    Parameters
    ----------
    fed : rows of full nodes below the film; conductance [m3/(Pa s)] from the film to them;
        available : resin above them [m3].
    pressure : of the film [Pa].
    sinking : into columns that are not full, if there are any.
    """

    fed: np.ndarray
    conductance: np.ndarray
    available: np.ndarray
    pressure: float
    sinking: FilmSinking | None

    @property
    def nodes(self) -> np.ndarray:
        """Rows of the nodes that take resin from the film."""
        return self.fed if self.sinking is None else np.append(self.fed, self.sinking.nodes)

    def drive(
        self, contact: np.ndarray, outside: np.ndarray, source: np.ndarray, step: float,
        spent: np.ndarray,
    ) -> None:  # fmt: skip
        """Add conductance and pressure of the film; where it is spent within the step, its rate."""
        kept = self.fed[~spent]
        contact[kept], outside[kept] = self.conductance[~spent], self.pressure
        source[self.fed[spent]] += self.available[spent] / step

    def overdrawn(self, net: np.ndarray, step: float, spent: np.ndarray) -> np.ndarray:
        """Which of the fed nodes would take more than lies above them, (K,)."""
        return spent | (net[self.fed] * step > self.available)

    def rate(self, net: np.ndarray, step: float, spent: np.ndarray) -> np.ndarray:
        """What the fed nodes take from the film [m3/s], (K,); negative where it flows back."""
        return np.where(spent, self.available / step, net[self.fed])


class FilmSupply:
    """The film of a filling; its thickness is part of the state."""

    def __init__(self, film: Film) -> None:
        self.film = film

    def start(self, count: int) -> np.ndarray:
        """Thickness of the film on the nodes at the start [m], (N,)."""
        given = np.asarray(self.film.thickness, dtype=float)
        if given.shape not in ((), (1,), (count,)):
            raise InputError(
                f"has the shape {given.shape}; give one number or ({count},), one per node",
                key="film.thickness",
            )
        return np.array(np.broadcast_to(given, (count,)))

    def at(
        self, state: FillingState, medium: Medium, pores: np.ndarray, viscosity: np.ndarray,
        excluded: np.ndarray,
    ) -> FilmFlow | None:  # fmt: skip
        """The film at the start of a time step; None where nothing is left of it.

        Parameters
        ----------
        pores : [m3]; viscosity : of the resin at the nodes [Pa s], (N,).
        excluded : nodes that take nothing from the film, as those of gates, (N,).

        Raises
        ------
        InputError : the preform has no permeability through the thickness.
        """
        area = medium.node_area
        lies = (state.film * area > NO_FILM * pores) & ~excluded
        if not lies.any():
            return None
        through = medium.preform.through_permeability
        if through is None:
            raise InputError(
                "a film needs the permeability through the thickness of the preform",
                key="film",
            )
        thickness = medium.network.node_mean(state.thickness)
        permeability = medium.network.node_mean(through * medium.factor(state.thickness))
        pressure = value_at(self.film.pressure, state.time)
        fed = np.flatnonzero(lies & state.full & np.isfinite(viscosity))
        conductance = area[fed] * film_conductance(
            thickness[fed], permeability[fed], viscosity[fed]
        )
        drive = pressure - state.air_pressure + self.film.capillary_pressure
        dry = np.flatnonzero(lies & ~state.full & (drive > 0.0) & np.isfinite(viscosity))
        porosity = pores / (area * thickness)
        columns = {
            "depth": state.fill[dry] * thickness[dry], "film": state.film[dry],
            "thickness": thickness[dry], "porosity": porosity[dry],
            "permeability": permeability[dry], "viscosity": viscosity[dry],
            "pressure": drive[dry],
        }  # fmt: skip
        sinking = None
        if len(dry):
            supply = columns["depth"] + state.film[dry] / porosity[dry]
            end = np.minimum(columns["thickness"], supply)
            time = (
                columns["porosity"] * columns["viscosity"] * (end**2 - columns["depth"] ** 2)
                / (2.0 * columns["permeability"] * columns["pressure"])
            )  # fmt: skip
            left = float(max(time.min(), LEAST_SHARE * time.max()))
            sinking = FilmSinking(dry, area[dry], columns, left, float(time.max()))
        return FilmFlow(fed, conductance, (state.film * area)[fed], pressure, sinking)
