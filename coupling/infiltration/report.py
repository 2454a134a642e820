"""Report of a filling, in numbers and in words."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from lcmchain.atomic import replacing
from lcmchain.coupling.infiltration.flow.time_step import share_in_words
from lcmchain.coupling.infiltration.results import FilledPart, FillingHistory
from lcmchain.mesh.places import place_text
from lcmchain.report.chapters import filling_in_words, time_in_words

#: Most dry spots that are listed one by one, the largest first.
MOST_SPOTS = 20
#: Share of all pores below which a pocket is noise of the front on the mesh.
NOTABLE = 1e-3
#: Tension across the fibres, as a share of the largest force of a closure, that causes a warning.
LIFTED = 0.05


@dataclass
class FillingReport:
    """Result of one filling; SI units.

    Parameters
    ----------
    outcome : "filled", "reached" (the time of the scene), "gelled", "no_source" or "trapped".
    message : the outcome in words.
    time : end of the filling.
    balance_error : largest difference of entered, vented and stored resin, over the entered resin.
    closing : largest force on the part and its shares at that time, thicknesses at the end, windows
        of the coupling and their iterations; None in a mould that does not move.
    stages : numbers of each stage of the process, where it has stages.
    flow_medium : of the layer on the part: its resin and pore volume at the end, which are counted
        in all sums, and the time at which its last node was reached, None where it was not.
    """

    name: str
    source: str
    cell_count: int
    node_count: int
    outcome: str
    message: str
    time: float
    filled_share: float
    fill_time_last: float | None
    pore_volume: float
    resin_volume: float
    resin_mass: float
    pressure_max: float
    balance_error: float
    step_count: int
    closing: dict[str, float] | None
    gates: dict[str, dict[str, float]]
    vents: dict[str, dict[str, float]]
    dry_spots: list[dict[str, Any]]
    stages: dict[str, dict[str, float]] = field(default_factory=dict)
    flow_medium: dict[str, float | None] | None = None
    wall_s: float = 0.0
    warnings: list[str] = field(default_factory=list)
    files: dict[str, str] = field(default_factory=dict)

    def as_dict(self) -> dict:
        """Plain values, ready for JSON."""
        return asdict(self)

    def save(self, path: Path | str) -> None:
        """Write as JSON, complete or not at all."""
        with replacing(path) as temporary:
            text = json.dumps(self.as_dict(), indent=2, allow_nan=False) + "\n"
            temporary.write_text(text, encoding="utf-8")

    def summary(self) -> str:
        """One sentence for the terminal."""
        return f"{self.name}: {self.cell_count:,} cells, {filling_in_words(self.as_dict())}"


def filling_report(name: str, filled: FilledPart) -> FillingReport:
    """Return the numbers of a filling and the warnings that follow from them."""
    history, setup, state = filled.history, filled.setup, filled.state
    pores = filled.pore_volume
    entered = float(history.injected[-1].sum() + history.stored[0] + state.from_film)
    fill_time = filled.fill_time[np.isfinite(filled.fill_time)]
    report = FillingReport(
        name=name,
        source=setup.part.file,
        cell_count=setup.mesh.cell_count,
        node_count=setup.mesh.node_count,
        outcome=filled.outcome,
        message=filled.message,
        time=float(state.time),
        filled_share=float(history.filled_share[-1]),
        fill_time_last=float(fill_time.max()) if len(fill_time) else None,
        pore_volume=pores,
        resin_volume=float(history.stored[-1]),
        resin_mass=float(setup.resin_density * history.stored[-1]),
        pressure_max=float(filled.pressure.max()),
        balance_error=float(np.abs(history.balance_error).max() / max(entered, 1e-300)),
        step_count=int(state.step_count),
        closing=_closing(filled),
        gates={
            gate.name: {
                "injected_volume": float(history.injected[-1, number]),
                "pressure_max": _largest(history.gate_pressure[:, number]),
                "flow_rate_max": _largest(history.gate_rate[:, number]),
                "returned_volume": _returned_volume(history, number),
            }
            for number, gate in enumerate(setup.gates)
        },
        vents={
            vent.name: {"vented_volume": float(history.vented[-1, number])}
            for number, vent in enumerate(setup.vents)
        },
        dry_spots=[
            {
                "name": spot_name,
                "place": [float(x) for x in spot.place],
                "area": float(spot.area),
                "pore_volume": float(spot.volume),
                "time": float(spot.time),
                "area_left": area_left,
                "pore_volume_left": volume_left,
            }
            for (spot_name, spot), (area_left, volume_left) in list(
                zip(filled.dry_spots, filled.left_dry, strict=True)
            )[:MOST_SPOTS]
        ],
        stages=_of_stages(filled),
        flow_medium=_of_layer(filled),
        warnings=[*setup.warnings, *_warnings(filled, pores)],
    )
    return report


def _of_layer(filled: FilledPart) -> dict[str, float | None] | None:
    """Return the numbers of the flow medium on the part."""
    layer = filled.layer
    if layer is None:
        return None
    there = np.isfinite(layer.fill[-1])
    times = layer.fill_time[there]
    return {
        "resin_volume": float(layer.resin_volume[-1][there].sum()),
        "pore_volume": layer.pore_volume,
        "fill_time_last": float(times.max()) if np.isfinite(times).all() else None,
    }


def _closing(filled: FilledPart) -> dict[str, float] | None:
    """Return the numbers of the closure of the part."""
    if filled.coupling is None:
        return None
    force, thickness = filled.history.force, filled.thickness[-1]
    most = int(np.argmax(force[:, 0]))
    return {
        "force_max": float(force[most, 0]),
        "fibre_force_then": float(force[most, 1]),
        "resin_force_then": float(force[most, 2]),
        **({"friction_force_then": float(force[most, 3])} if force.shape[1] > 3 else {}),
        "force_end": float(force[-1, 0]),
        "thickness_min": float(thickness.min()),
        "thickness_max": float(thickness.max()),
        "window_count": len(filled.coupling.accepted),
        "iterations_per_window": float(filled.coupling.mean_iterations),
        "restarts": filled.coupling.restarts,
    }


def _of_stages(filled: FilledPart) -> dict[str, dict[str, float]]:
    """Return the numbers of each stage of the process, by its name.

    Times are those of the resin. The pressure is the largest in the saved states.
    """
    if filled.stages is None:
        return {}
    names, of_frames, of_steps = filled.stages
    history, numbers = filled.history, {}
    for number, name in enumerate(names):
        steps = np.flatnonzero(of_steps == number)
        if not len(steps):
            continue
        before, last = max(int(steps[0]) - 1, 0), int(steps[-1])
        frames = filled.pressure[of_frames == number]
        numbers[name] = {
            "start": float(history.time[before]),
            "end": float(history.time[last]),
            "filled_share": float(history.filled_share[last]),
            "injected_volume": float((history.injected[last] - history.injected[before]).sum()),
            "vented_volume": float((history.vented[last] - history.vented[before]).sum()),
            "force_max": float(history.force[steps, 0].max()),
            "pressure_max": float(frames.max()) if len(frames) else 0.0,
        }
    return numbers


def _warnings(filled: FilledPart, pores: float) -> Iterator[str]:
    """Yield warnings on the end of the filling."""
    if filled.outcome != "filled":
        dry = ~np.isfinite(filled.fill_time)
        where = ""
        if dry.any():
            points = filled.setup.mesh.points
            middle = points[dry].mean(axis=0)
            at = points[dry][np.argmin(np.linalg.norm(points[dry] - middle, axis=1))]
            where = f"; the dry part is around {place_text(at)}"
        share = share_in_words(filled.history.filled_share[-1])
        ended = filled.message or filled.outcome
        yield f"{ended if share in ended else f'{share}: {ended}'}{where}"
    yield from _returned(filled, pores)
    yield from _gelled(filled)
    yield from _lifted(filled)
    spots = [
        (name, spot, left)
        for (name, spot), (left, _) in zip(filled.dry_spots, filled.left_dry, strict=True)
        if spot.volume > NOTABLE * pores
    ]
    for name, spot, left in spots[:3]:
        rest = f"; {1e4 * left:.3g} cm² of it stay dry" if left > 0.0 else ""
        yield (
            f"{name}: the front closes around {1e4 * spot.area:.3g} cm² at "
            f"{place_text(spot.place)} after {time_in_words(spot.time)}, and the air there has no "
            f"way to a vent{rest}; put a vent there, or move the gates"
        )
    if len(spots) > 3:
        yield f"{len(spots) - 3} further dry spots, in the report"


def _lifted(filled: FilledPart) -> Iterator[str]:
    """Yield a warning where resin pushes a bag or tool off, which the fibres would have to hold."""
    force, closure = filled.history.force, filled.setup.case.closure
    if closure is None or closure.type == "gap" or not force.size:
        return
    lowest = int(np.argmin(force[:, 1]))
    if force[lowest, 1] < -LIFTED * np.abs(force[:, 0]).max():
        key = "closure.pressure" if closure.type == "bag" else "closure.force"
        total, resin = force[lowest, 0], force[lowest, 2]
        yield (
            f"the resin pushes with {resin:.3g} N against the {total:.3g} N of the closure at "
            f"{time_in_words(filled.history.time[lowest])}: the part grows up to "
            f"{1e3 * filled.thickness.max():.3g} mm thick, held by fibres in tension across it, "
            f"which no textile bears; use less pressure in the gates, or more {key}"
        )


def _returned_volume(history: FillingHistory, gate: int) -> float:
    """Volume of the resin that flowed back out through a gate [m³]."""
    entered = np.diff(history.injected[:, gate])
    return float(np.maximum(-entered, 0.0).sum())


def _returned(filled: FilledPart, pores: float) -> Iterator[str]:
    """Yield a warning for each gate of a pressure that takes back a notable volume of resin."""
    history = filled.history
    for number, gate in enumerate(filled.setup.gates):
        volume = _returned_volume(history, number)
        if volume <= NOTABLE * pores:
            continue
        entered = np.diff(history.injected[:, number])
        back = history.time[1:][entered < 0.0]
        when = time_in_words(back[0])
        if len(back) > 1:
            when = f"between {when} and {time_in_words(back[-1])}"
        yield (
            f'the gate "{gate.name}" takes {1e6 * volume:.3g} ml of resin back ({when}): its '
            "pressure is below that of the resin around it; let it close before, or give it more "
            "pressure"
        )


def _gelled(filled: FilledPart) -> Iterator[str]:
    """Yield a warning where resin at the front has gelled, so that it no longer moves there."""
    gel, state, mesh = filled.setup.case.resin.gel_cure, filled.state, filled.setup.mesh
    if gel is None or filled.is_filled:
        return
    stiff = (state.cure >= gel) & (state.resin_volume > 0.0)
    dry = ~np.isfinite(state.fill_time)
    ends = mesh.edges
    at_front = np.concatenate([
        ends[stiff[ends[:, 0]] & dry[ends[:, 1]], 0], ends[stiff[ends[:, 1]] & dry[ends[:, 0]], 1]
    ])  # fmt: skip
    if len(at_front):
        places = mesh.points[np.unique(at_front)]
        yield (
            f"the resin has gelled (cure above {gel:g}) at the front, as at "
            f"{place_text(places[len(places) // 2])}, and does not move there any more; use more "
            "pressure or gates, a lower temperature, or a slower resin"
        )


def _largest(values: np.ndarray) -> float:
    known = values[np.isfinite(values)]
    return float(known.max()) if len(known) else 0.0
