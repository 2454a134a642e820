"""What holds at the start of a time step of a filling and is kept over it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from lcmchain.coupling.infiltration.air import Air, find_air
from lcmchain.coupling.infiltration.film_supply import FilmFlow, FilmSinking, FilmSupply
from lcmchain.coupling.infiltration.network import Conductances
from lcmchain.coupling.infiltration.overflow import FULL
from lcmchain.coupling.infiltration.pressure import Flow, Lift
from lcmchain.coupling.infiltration.state import FillingState
from lcmchain.coupling.infiltration.supply import OpenGate, Priming, prime

if TYPE_CHECKING:
    from lcmchain.coupling.infiltration.filling import Filling

# Of the pores of a control volume: what a full one may lack and stay so although they shrink, and
# the round-off of its content.
NEARLY, ROUND_OFF = 0.5 * (1.0 - FULL), 1e-13


@dataclass(frozen=True)
class Situation:
    """What holds at the start of a step and is kept over it.

    Parameters
    ----------
    pores : volume of each control volume [m3], (N,). pore_rate : its rate [m3/s], (N,).
    primings : gates and films that fill their own control volumes before resin flows on.
    bleeds : control volumes at open vents, (N,); vent_pressure : there [Pa], nan elsewhere, (N,).
    excess : resin in full control volumes beyond their pores [m3], (N,).
    """

    state: FillingState
    conductances: Conductances
    pores: np.ndarray
    gates: list[OpenGate]
    primings: list[Priming | FilmSinking]
    bleeds: np.ndarray
    vent_pressure: np.ndarray
    air: Air
    excess: np.ndarray
    pore_rate: np.ndarray
    lift: Lift | None
    film: FilmFlow | None = None


def situation_of(filling: Filling, state: FillingState) -> Situation:
    """Return what holds in a state; writes the pressure of the air into it."""
    medium, supply = filling.medium, filling.supply
    fluidity = filling.liquid.fluidity(medium, state)
    conductances = medium.conductances(state.thickness, fluidity)
    pores = medium.pores(state.thickness)
    vents = supply.open_vents(state.time, state)
    compressed = filling.options.trapped_air
    air = find_air(medium.network.edges, state, pores, vents, compressed)
    dry = air.region >= 0
    state.air_pressure = state.air_pressure.copy()
    state.air_pressure[dry] = air.pressure[air.region[dry]]
    gates = supply.open_gates(state.time, state, medium.network, conductances)
    primings: list[Priming | FilmSinking] = [
        prime(gate, medium.network, conductances, pores, state) for gate in gates if not gate.ready
    ]
    vent_pressure = np.full(len(pores), np.nan)
    for _, vent, pressure in vents:
        if not vent.closes_when_wet:
            vent_pressure[vent.nodes] = pressure
    film = None if filling.film is None else _film_flow(filling, filling.film, state, pores, gates)
    if film is not None and film.sinking is not None:
        primings.append(film.sinking)
    excess = np.where(state.full, state.resin_volume - pores, 0.0)
    # Full volumes may lack a little; what they have too much of is only dropped as round-off.
    excess[(excess > -NEARLY * pores) & (excess < ROUND_OFF * pores)] = 0.0
    return Situation(
        state, conductances, pores, gates, primings, ~np.isnan(vent_pressure), vent_pressure,
        air, excess, medium.pore_rate(state.thickness_rate), medium.lift(state), film,
    )  # fmt: skip


def _film_flow(
    filling: Filling,
    film: FilmSupply,
    state: FillingState,
    pores: np.ndarray,
    gates: list[OpenGate],
) -> FilmFlow | None:
    viscosity = filling.liquid.node_viscosity(state)
    under_gates = np.zeros(len(pores), dtype=bool)
    for gate in gates:
        under_gates[gate.gate.nodes] = True
    return film.at(state, filling.medium, pores, viscosity, under_gates)


def at_the_same_rate(situation: Situation, share: float) -> Situation:
    """Of what has no room, as much as flows in a share of the step; the rest in later ones.

    What a full volume lacks is drawn in at once: else the front would come back to it.
    """
    excess = situation.excess
    if share == 1.0 or not excess.any():
        return situation
    return replace(situation, excess=np.where(excess > 0.0, share * excess, excess))


def thickness_rate(situation: Situation, flow: Flow) -> np.ndarray:
    """Rate of the cells' thickness [m/s], (C,), with what the pressure of the resin adds."""
    state, lift = situation.state, situation.lift
    if lift is None:
        return state.thickness_rate
    rate = state.thickness_rate.copy()
    rate[lift.cells] += state.lift[lift.cells] * (flow.lifted - lift.reference)
    return rate
