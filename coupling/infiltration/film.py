"""Resin film on top of a textile: it enters through the thickness before it flows along.

In wet compression moulding the resin is poured onto the blank. Under a pressure it sinks in, column
by column, with a front that moves down. Where a column is through, its resin takes part in the flow
along the sheet, and what is left of the film above feeds that flow.

Left out: spreading of the film over the textile (the gap between tool and textile is no channel
here), the film's weight and its loss of pressure along the sheet, air that is trapped below the
film, and resin that sinks on by capillarity after its film has been used up.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lcmchain.errors import InputError


@dataclass(frozen=True)
class Impregnation:
    """What a step of the impregnation leaves, all of shape (N,).

    Parameters
    ----------
    depth : impregnated depth [m]; film : thickness of what lies above [m].
    passed : resin that entered, per area of the sheet [m].
    time_through : time within the step [s] at which the column was through; infinite where it is
        not, zero where it was before.
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
    time, so that a dry column is through after t = porosity viscosity thickness² / (2 K dp). A
    column ends when it is through or its film is used up, whichever comes first. Resin is
    conserved: what the film loses is what has passed.

    Parameters
    ----------
    depth, film : now [m], shape (N,).
    thickness : of the textile [m]; porosity; permeability : through the thickness, K3 [m2];
        viscosity : [Pa s], infinite where the resin has gelled; all (N,) or one number, constant
        over the step.
    pressure : on the film, above that of the air below [Pa].
    step : [s].
    capillary_pressure : that draws the resin in [Pa], negative where it holds it back.

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
    # The increment in this form keeps its digits where it is small against the depth.
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
    """Conductance from a film into the column below it, per area of the sheet [m/(Pa s)].

    Of a column that is through and gives its resin off evenly over the thickness, to the flow
    along the sheet. The flow through the thickness then falls linearly to zero at the bottom, and
    the mean pressure over the thickness lies viscosity thickness q / (3 K3) below the film's for a
    flow q per area: the conductance is 3 K3 / (viscosity thickness).
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
