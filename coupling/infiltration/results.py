"""Results of a filling: saved states and histories, as plain arrays."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from lcmchain.coupling.infiltration.filling import Filling
from lcmchain.coupling.infiltration.flow.medium import Medium
from lcmchain.coupling.infiltration.flow.state import DrySpot, FillingState
from lcmchain.coupling.infiltration.setup import FillingSetup
from lcmchain.coupling.iteration import History

#: Force on a part and its shares: words by the name of the variable. Friction and inertia are known
#: where the part is being formed.
FORCES = {
    "press_force": "of what presses on the part",
    "fibre_force": "of it that the fibres bear",
    "resin_force": "of it that the resin bears",
    "friction_force": "of it that friction takes",
    "inertia_force": "of it that moves and damps the textile",
}


@dataclass
class FillingRecord:
    """Record of a running filling: fields of some states (frames), sums of every step.

    Every entry is a list with an array or a number for each frame or step. ``frame_stage`` and
    ``stage`` are numbers of stages of the process, 0 without stages.
    """

    frame_time: list[float]
    fill: list[np.ndarray]
    pressure: list[np.ndarray]
    resin_volume: list[np.ndarray]
    velocity: list[np.ndarray]
    cure: list[np.ndarray]
    temperature: list[np.ndarray]
    film: list[np.ndarray]
    thickness: list[np.ndarray]
    fibre_volume_fraction: list[np.ndarray]
    frame_stage: list[int]
    time: list[float]
    filled_share: list[float]
    stored: list[float]
    balance_error: list[float]
    wet_area: list[float]
    gate_pressure: list[np.ndarray]
    gate_rate: list[np.ndarray]
    injected: list[np.ndarray]
    vented: list[np.ndarray]
    force: list[np.ndarray]
    stage: list[int]

    @classmethod
    def empty(cls) -> FillingRecord:
        """Return an empty record."""
        return cls(*([] for _ in fields(cls)))

    def add_frame(self, filling: Filling, stage: int = 0) -> None:
        """Record the fields of the present state; ``stage`` is the number of the present stage."""
        frame = filling.frame()
        self.frame_time.append(frame.time)
        for name in ("fill", "pressure", "velocity", "cure", "temperature", "film"):
            getattr(self, name).append(np.array(getattr(frame, name)))
        self.resin_volume.append(filling.state.resin_volume.copy())
        thickness = filling.state.thickness
        self.thickness.append(thickness.copy())
        self.fibre_volume_fraction.append(filling.medium.fibre_fraction(thickness))
        self.frame_stage.append(stage)

    def add_step(
        self, filling: Filling, node_area: np.ndarray, force: Sequence[float] = (), stage: int = 0
    ) -> None:
        """Record the sums of the present state.

        Parameters
        ----------
        node_area : of each node (N,) [m²].
        force : on the part [N], those of :data:`FORCES` that are known; none without a closure.
        stage : number of the present stage.
        """
        state = filling.state
        self.time.append(state.time)
        self.filled_share.append(filling.filled_share)
        self.stored.append(state.stored)
        self.balance_error.append(state.balance_error)
        self.wet_area.append(float(node_area @ state.fill))
        self.gate_pressure.append(filling.gate_pressure.copy())
        self.gate_rate.append(filling.gate_rate.copy())
        self.injected.append(state.injected.copy())
        self.vented.append(state.vented.copy())
        self.force.append(np.array(force, dtype=float))
        self.stage.append(stage)


@dataclass(frozen=True)
class FillingHistory:
    """Sums at the start and at the end of every step.

    Parameters
    ----------
    time : [s], (H,).
    filled_share : resin over pore volume, (H,).
    stored : resin [m³], (H,).
    balance_error : resin that entered and did not leave, less the stored resin [m³], (H,).
    wet_area : of the part that resin covers [m²], (H,).
    gate_pressure, gate_rate, injected : [Pa], [m³/s], [m³], each (H, G).
    vented : [m³], (H, V).
    force : on the part [N], those of :data:`FORCES` that are known, (H, 3) or (H, 5); (H, 0) in a
        mould that does not move.
    """

    time: np.ndarray
    filled_share: np.ndarray
    stored: np.ndarray
    balance_error: np.ndarray
    wet_area: np.ndarray
    gate_pressure: np.ndarray
    gate_rate: np.ndarray
    injected: np.ndarray
    vented: np.ndarray
    force: np.ndarray


class FilledStages(NamedTuple):
    """Numbers of the stages of the process, of each saved state (F,) and each step (H,).

    names : of all stages, in their order.
    """

    names: tuple[str, ...]
    of_frames: np.ndarray
    of_steps: np.ndarray


@dataclass(frozen=True)
class FilledLayer:
    """Results of the flow medium on a part, at the nodes of the part; nan where there is none.

    Parameters
    ----------
    fill : fill factor, (F, N).
    pressure : [Pa], (F, N).
    resin_volume : [m³], (F, N).
    fill_time : [s], (N,).
    pore_volume : of the whole flow medium [m³].
    """

    fill: np.ndarray
    pressure: np.ndarray
    resin_volume: np.ndarray
    fill_time: np.ndarray
    pore_volume: float

    @classmethod
    def of_record(
        cls, setup: FillingSetup, record: FillingRecord, state: FillingState
    ) -> FilledLayer | None:
        """Return the results of the layer in a record; None where there is no layer."""
        medium, count = setup.flow_medium, setup.mesh.node_count
        if medium is None:
            return None
        below = medium.nodes(setup.mesh)

        def spread(values: np.ndarray) -> np.ndarray:
            at_nodes = np.full((*values.shape[:-1], count), np.nan)
            at_nodes[..., below] = values[..., count:]
            return at_nodes

        area = float(setup.mesh.areas[medium.cells].sum())
        return cls(
            spread(np.stack(record.fill)),
            spread(np.stack(record.pressure)),
            spread(np.stack(record.resin_volume)),
            spread(state.fill_time),
            area * medium.thickness * medium.porosity,
        )


@dataclass(frozen=True)
class FilledPart:
    """A formed part with the results of its filling.

    Parameters
    ----------
    setup : the part, its places and material.
    time : of the saved states [s], (F,).
    fill : fill factor, (F, N).
    pressure : [Pa], (F, N).
    resin_volume : of the control volumes [m³], (F, N).
    velocity : Darcy's [m/s], (F, C, 3).
    cure, temperature : of the resin, [1] and [K], (F, N).
    film : thickness of the resin on the sheet [m], (F, N).
    thickness : of the cells [m], (F, C).
    fibre_volume_fraction : (F, C).
    state : the last one.
    outcome, message : why the filling ended (:class:`FillingResult`).
    coupling : convergence between textile and resin, where the part is pressed.
    stages : of the process, None where it has none.
    layer : the flow medium on the part, None where there is none. Histories, pore volume and state
        include it; its nodes and cells follow those of the part.
    """

    setup: FillingSetup
    time: np.ndarray
    fill: np.ndarray
    pressure: np.ndarray
    resin_volume: np.ndarray
    velocity: np.ndarray
    cure: np.ndarray
    temperature: np.ndarray
    film: np.ndarray
    thickness: np.ndarray
    fibre_volume_fraction: np.ndarray
    history: FillingHistory
    state: FillingState
    outcome: str
    message: str
    coupling: History | None = None
    stages: FilledStages | None = None
    layer: FilledLayer | None = None

    @classmethod
    def of_record(
        cls, setup: FillingSetup, record: FillingRecord, state: FillingState, outcome: str,
        message: str, coupling: History | None = None, stages: Sequence[str] = (),
    ) -> FilledPart:  # fmt: skip
        """Return the results in a record; ``stages`` are the names of the stages."""
        gates, vents = len(setup.gates), len(setup.vents)
        nodes, cells = setup.mesh.node_count, setup.mesh.cell_count
        history = FillingHistory(
            time=np.array(record.time),
            filled_share=np.array(record.filled_share),
            stored=np.array(record.stored),
            balance_error=np.array(record.balance_error),
            wet_area=np.array(record.wet_area),
            gate_pressure=_rows(record.gate_pressure, gates),
            gate_rate=_rows(record.gate_rate, gates),
            injected=_rows(record.injected, gates),
            vented=_rows(record.vented, vents),
            force=np.array(record.force, dtype=float).reshape(len(record.time), -1),
        )
        return cls(
            setup=setup,
            time=np.array(record.frame_time),
            fill=np.stack(record.fill)[:, :nodes],
            pressure=np.stack(record.pressure)[:, :nodes],
            resin_volume=np.stack(record.resin_volume)[:, :nodes],
            velocity=np.stack(record.velocity)[:, :cells],
            cure=np.stack(record.cure)[:, :nodes],
            temperature=np.stack(record.temperature)[:, :nodes],
            film=np.stack(record.film)[:, :nodes],
            thickness=np.stack(record.thickness)[:, :cells],
            fibre_volume_fraction=np.stack(record.fibre_volume_fraction)[:, :cells],
            history=history,
            state=state,
            outcome=outcome,
            message=message,
            coupling=coupling,
            stages=FilledStages(
                tuple(stages), np.array(record.frame_stage), np.array(record.stage)
            ) if stages else None,
            layer=FilledLayer.of_record(setup, record, state),
        )  # fmt: skip

    @property
    def is_filled(self) -> bool:
        """Whether all pores are filled."""
        return self.outcome == "filled"

    @property
    def pore_volume(self) -> float:
        """Volume of all pores at the end [m³], with those of a flow medium and of race tracks."""
        open_height = self.thickness[-1] * (1.0 - self.fibre_volume_fraction[-1])
        above = 0.0 if self.layer is None else self.layer.pore_volume
        beside = self._medium.network.track_volume.sum() if self.setup.race_tracks else 0.0
        return float(self.setup.mesh.areas @ open_height) + above + float(beside)

    @cached_property
    def _medium(self) -> Medium:
        mesh, preform, links = self.setup.layers()
        return Medium(mesh, preform, self.setup.race_tracks, links=links)

    @property
    def is_pressed(self) -> bool:
        """Whether the part is pressed, so that its thickness changes."""
        case = self.setup.case
        moved = bool(np.any(self.thickness != self.thickness[:1]))
        return case.closure is not None or case.with_forming is not None or moved

    @property
    def fill_time(self) -> np.ndarray:
        """Time at which the front passed each node [s], nan where it is dry, (N,)."""
        return self.state.fill_time[: self.setup.mesh.node_count]

    @property
    def dry_spots(self) -> list[tuple[str, DrySpot]]:
        """Names and pockets of air that the front has enclosed, the largest first.

        The nodes of a pocket in a flow medium are those of the part below it.
        """
        spots = self._spots
        medium, count = self.setup.flow_medium, self.setup.mesh.node_count
        if medium is not None:
            of_part = np.concatenate([np.arange(count), medium.nodes(self.setup.mesh)])
            spots = [replace(spot, nodes=np.unique(of_part[spot.nodes])) for spot in spots]
        return [(f"dry {number}", spot) for number, spot in enumerate(spots, start=1)]

    @property
    def _spots(self) -> list[DrySpot]:
        return sorted(self.state.dry_spots, key=lambda spot: (-spot.volume, spot.time))

    @cached_property
    def left_dry(self) -> list[tuple[float, float]]:
        """Area [m²] and pore volume [m³] of each dry spot that is still dry at the end.

        Compressed air leaves a bubble. Without compressed air a pocket fills as far as the time
        allows.
        """
        medium = self._medium
        of_layer = medium.preform.thickness[self.setup.mesh.cell_count :]
        pores = medium.pores(np.concatenate([self.thickness[-1], of_layer]))
        room = np.where(self.state.full, 0.0, pores - self.state.resin_volume)
        area = room / pores * medium.sheet_area
        return [
            (float(area[spot.nodes].sum()), float(room[spot.nodes].sum())) for spot in self._spots
        ]


def _rows(values: Sequence[np.ndarray], count: int) -> np.ndarray:
    return np.array(values, dtype=float).reshape(len(values), count)
