"""What a filling has found: saved states and histories, as plain arrays."""

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

#: What presses on a part, by the name of the variable, with words; friction and inertia where the
#: part is being formed.
FORCES = {
    "press_force": "of what presses on the part",
    "fibre_force": "of it that the fibres bear",
    "resin_force": "of it that the resin bears",
    "friction_force": "of it that friction takes",
    "inertia_force": "of it that moves and damps the textile",
}


@dataclass
class FillingRecord:
    """What is kept while a filling runs: frames now and then, histories of every step.

    Every entry is a list of arrays or numbers, one for each frame or step. ``frame_stage`` and
    ``stage`` are numbers of stages of the process, 0 in one without.
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
        """Return a record with nothing in it."""
        return cls(*([] for _ in fields(cls)))

    def add_frame(self, filling: Filling, stage: int = 0) -> None:
        """Keep the fields of the present state; ``stage`` is the number of the present stage."""
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
        """Keep the sums of the present state.

        node_area : [m2] of each node, (N,). force : of what presses on the part [N], those of
        :data:`FORCES` that are known; none where nothing does. stage : number of the present one.
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
    """Sums at the end of every step, the start among them.

    Parameters
    ----------
    time : [s], (H,). filled_share : resin over pore volume, (H,). stored : resin [m3], (H,).
    balance_error : what entered and did not leave, less what is stored [m3], (H,).
    wet_area : of the part that resin covers [m2], (H,).
    gate_pressure, gate_rate, injected : [Pa], [m3/s], [m3], each (H, G). vented : [m3], (H, V).
    force : of what presses on the part [N], those of :data:`FORCES` that are known, (H, 3) or
        (H, 5); (H, 0) in a mould that does not move.
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
    """Which stage of the process each saved state (F,) and each step (H,) belongs to.

    names : of all stages, in their order.
    """

    names: tuple[str, ...]
    of_frames: np.ndarray
    of_steps: np.ndarray


@dataclass(frozen=True)
class FilledLayer:
    """How the flow medium on a part fills: at the nodes of the part, nan where there is none.

    Parameters
    ----------
    fill : (F, N). pressure : [Pa], (F, N). resin_volume : [m3], (F, N). fill_time : [s], (N,).
    pore_volume : of all of it [m3].
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
        """Take what a filling has kept of the layer; None where there is no layer."""
        medium, count = setup.flow_medium, setup.mesh.node_count
        if medium is None:
            return None
        below = medium.nodes(setup.mesh)

        def spread(values: np.ndarray) -> np.ndarray:
            found = np.full((*values.shape[:-1], count), np.nan)
            found[..., below] = values[..., count:]
            return found

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
    """A formed part and how it fills.

    Parameters
    ----------
    setup : the part, its places and material.
    time : of the saved states [s], (F,). fill : (F, N). pressure : [Pa], (F, N).
    resin_volume : of the control volumes [m3], (F, N). velocity : of Darcy [m/s], (F, C, 3).
    cure, temperature, film : of the resin, [K], and on the sheet [m], (F, N).
    thickness : of the cells [m], (F, C). fibre_volume_fraction : (F, C).
    coupling : how textile and resin were brought to agree, where something presses on the part.
    stages : of the process in which it fills, None where there are none.
    layer : the flow medium on it, None where there is none; histories, the pore volume and the
        state hold both, the nodes and cells of the layer behind those of the part.
    state : the last one. outcome, message : why it ended (:class:`FillingResult`).
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
        """Gather what a filling has left; ``stages`` are the names of those of its process."""
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
        """Whether nothing is left to fill."""
        return self.outcome == "filled"

    @property
    def pore_volume(self) -> float:
        """Volume of all pores in the end [m3], with those of a flow medium."""
        open_height = self.thickness[-1] * (1.0 - self.fibre_volume_fraction[-1])
        above = 0.0 if self.layer is None else self.layer.pore_volume
        return float(self.setup.mesh.areas @ open_height) + above

    @property
    def is_pressed(self) -> bool:
        """Whether something presses on the part, so that its thickness changes."""
        case = self.setup.case
        moved = bool(np.any(self.thickness != self.thickness[:1]))
        return case.closure is not None or case.with_forming is not None or moved

    @property
    def fill_time(self) -> np.ndarray:
        """When the front passed each node [s], nan where it is dry, (N,)."""
        return self.state.fill_time[: self.setup.mesh.node_count]

    @property
    def dry_spots(self) -> list[tuple[str, DrySpot]]:
        """Pockets of air that the front closed around, the largest first, with names.

        Of a pocket in a flow medium the nodes below are named.
        """
        spots = self._spots
        medium, count = self.setup.flow_medium, self.setup.mesh.node_count
        if medium is not None:
            own = np.concatenate([np.arange(count), medium.nodes(self.setup.mesh)])
            spots = [replace(spot, nodes=np.unique(own[spot.nodes])) for spot in spots]
        return [(f"dry {number}", spot) for number, spot in enumerate(spots, start=1)]

    @property
    def _spots(self) -> list[DrySpot]:
        return sorted(self.state.dry_spots, key=lambda spot: (-spot.volume, spot.time))

    @cached_property
    def left_dry(self) -> list[tuple[float, float]]:
        """Area [m2] and pore volume [m3] of each of the dry spots that are dry in the end.

        Compressed air keeps a bubble; without it a pocket fills as far as the time allows.
        """
        setup = self.setup
        mesh, preform, links = setup.layers()
        medium = Medium(mesh, preform, setup.race_tracks, links=links)
        still = preform.of_cells(mesh.cell_count).thickness[setup.mesh.cell_count :]
        pores = medium.pores(np.concatenate([self.thickness[-1], still]))
        room = np.where(self.state.full, 0.0, pores - self.state.resin_volume)
        area = room / pores * medium.sheet_area
        return [
            (float(area[spot.nodes].sum()), float(room[spot.nodes].sum())) for spot in self._spots
        ]


def _rows(values: Sequence[np.ndarray], count: int) -> np.ndarray:
    return np.array(values, dtype=float).reshape(len(values), count)
