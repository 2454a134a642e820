"""What a filling has found: saved states, histories, dry spots, as plain arrays."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from lcmchain.coupling.infiltration.formed_part import FormedPart


@dataclass(frozen=True)
class DrySpot:
    """A connected part of the preform that no resin can reach any more, or has not reached.

    Parameters
    ----------
    name : for pictures and messages. place : its middle [m], (3,). node : nearest to it.
    area : of the mid-surface [m2]. pore_volume : that stays empty [m3].
    since : time from which on it had no way to an open vent [s], nan where it still has one.
    """

    name: str
    place: tuple[float, float, float]
    node: int
    area: float
    pore_volume: float
    since: float


@dataclass(frozen=True)
class FillingHistory:
    """What is kept of every step.

    Parameters
    ----------
    time : at the end of each step [s], shape (H,). filled_share : of the pore volume, (H,).
    stored : resin in the part [m3], (H,). front_area : of the mid-surface that resin covers [m2].
    gate_pressure, gate_flow_rate, injected : [Pa], [m3/s], [m3], each (H, G).
    vented : [m3], (H, V).
    """

    time: np.ndarray
    filled_share: np.ndarray
    stored: np.ndarray
    wet_area: np.ndarray
    gate_pressure: np.ndarray
    gate_flow_rate: np.ndarray
    injected: np.ndarray
    vented: np.ndarray

    @property
    def balance_error(self) -> np.ndarray:
        """Largest relative difference of injected, stored and vented resin at each step, (H,)."""
        into = self.injected.sum(axis=1) + self.stored[0] - self.injected[0].sum()
        into = into - self.vented[0].sum()
        out = self.stored + self.vented.sum(axis=1)
        return np.abs(into - out) / np.maximum(np.maximum(np.abs(into), np.abs(out)), 1e-300)


@dataclass(frozen=True)
class FilledPart:
    """A formed part and how it fills.

    Parameters
    ----------
    gates, vents : rows of the nodes of each, by name.
    time : of the saved states [s], (F,). fill : (F, N). pressure : [Pa], (F, N).
    velocity : of Darcy [m/s], (F, C, 3). fill_time : [s], (N,), nan where dry.
    thickness, porosity : of the cells as they were filled, (C,).
    cure, temperature : (F, N), None where they are not simulated.
    end : why it ended, in words. is_filled : whether nothing is left to fill.
    """

    part: FormedPart
    gates: dict[str, np.ndarray]
    vents: dict[str, np.ndarray]
    time: np.ndarray
    fill: np.ndarray
    pressure: np.ndarray
    velocity: np.ndarray
    fill_time: np.ndarray
    thickness: np.ndarray
    porosity: np.ndarray
    history: FillingHistory
    end: str
    is_filled: bool
    dry_spots: tuple[DrySpot, ...] = ()
    cure: np.ndarray | None = None
    temperature: np.ndarray | None = None
    warnings: tuple[str, ...] = field(default=())
