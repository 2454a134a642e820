"""A mould that closes on a part while resin flows: textile and resin, brought to agree.

Every cell is compressed along its normal by what presses on it, and lies still in its plane, as
between rigid tools or under a bag: Terzaghi's total pressure is borne by fibres and resin. The
cells squeeze the resin that flows between them (:class:`FillingPart`); its pressure lifts them
(:class:`LocalCompaction`).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from lcmchain.coupling.closing.textile import compaction_of
from lcmchain.coupling.filling_part import FillingPart
from lcmchain.coupling.infiltration.filling import Filling
from lcmchain.coupling.infiltration.flow.preform import FlowMesh
from lcmchain.coupling.infiltration.formed_part import FormedPart
from lcmchain.coupling.iteration import (
    CoupledSystem,
    Exchange,
    History,
    Tolerance,
    WindowControl,
    fixed_stress_exchanges,
    gauss_seidel,
    iqn_ils,
)
from lcmchain.coupling.iteration.interface import PORE_PRESSURE, VOLUME_RATE
from lcmchain.coupling.solids import closures
from lcmchain.coupling.solids.closures import value_at
from lcmchain.coupling.solids.compaction_law import CompactionLaw
from lcmchain.coupling.solids.local import LocalCompaction
from lcmchain.scene.infiltration import boundaries as scene

#: Windows of a filling where its scene does not say; they may become so much shorter and longer.
WINDOWS = 200
SHORTEST = 1e-4
LONGEST = 4.0
#: Share of the first correction where resin bears most of a force: it answers many times over.
CAREFUL = 0.01


class ClosingForce(NamedTuple):
    """What presses on all cells along the direction of closing [N]: fibres, resin, and both."""

    total: float
    fibres: float
    resin: float


class Begun(NamedTuple):
    """Textile of a part that a closure presses, at the start of its filling.

    law, solid : of the textile, and its cells at their thickness. across : share of each cell's
    area that the direction of closing sees, (C,). wet : whether resin bears a part from the start.
    """

    law: CompactionLaw
    solid: LocalCompaction
    across: np.ndarray
    wet: bool


def begin(part: FormedPart, fluid: FillingPart, case: scene.Closure) -> Begun:
    """Bring a filling and its textile to the start that a closure asks for.

    Where the part is pressed dry, cells have the thickness that their fibres bear alone. Where it
    is pressed wet, cells with resin have that of the forming, and the resin the pressure that the
    fibres leave. The filling takes thickness and pressures.

    Raises
    ------
    InputError : the part does not say what textile it is.
    SimulationError : the textile cannot bear what presses on it.
    """
    filling = fluid.filling
    law, mesh = compaction_of(part), filling.mesh
    formed = filling.state.thickness.copy()
    across = seen_across(mesh, getattr(case, "direction", None))
    outside = closure_of(case, formed, across)
    pressure = fluid.get_fields([PORE_PRESSURE])[PORE_PRESSURE]
    wet = np.zeros(mesh.cell_count, dtype=bool)
    if getattr(case, "pressed", "dry") != "dry":
        wet = _wet_cells(filling)
    if isinstance(case, scene.Press):
        wet[:] = wet.any()  # one gap for all: what is wet carries the tool
    past = law.history.copy()
    solid = LocalCompaction(
        law, outside, mesh.areas, pore_pressure=pressure, centres=mesh.centroids
    )
    if wet.any():
        law.history = past  # cells with resin have not been pressed yet
        start = np.where(wet, formed, solid.thickness)
        borne = _borne(case, law, start, across * mesh.areas)
        _press_resin(filling, np.where(wet, np.maximum(borne, pressure), pressure))
        solid = LocalCompaction(
            law, outside, mesh.areas,
            pore_pressure=fluid.get_fields([PORE_PRESSURE])[PORE_PRESSURE],
            centres=mesh.centroids, start=start,
            swells=isinstance(case, scene.Bag) or _swells(filling),
        )  # fmt: skip
    filling.start_at(solid.thickness)
    return Begun(law, solid, across, bool(wet.any()))


class Mould:
    """A filling whose part is pressed together; stands in for the filling where it advances.

    Parameters
    ----------
    part : that the resin flows through. It is pressed dry, before its resin comes, or wet: then
        it is as thick as it was formed where resin is, and the resin bears what the fibres do not.
    filling : at its start; its thickness is set to what the closure makes of it.
    case : closure of the scene. time : when the filling ends [s].

    Raises
    ------
    InputError : the part does not say what textile it is.
    SimulationError : the textile cannot bear what presses on it.
    """

    def __init__(
        self, part: FormedPart, filling: Filling, case: scene.Closure, time: float
    ) -> None:
        fluid = FillingPart(filling)
        begun = begin(part, fluid, case)
        self.filling, self.solid, self.law = filling, begun.solid, begun.law
        self._fluid, self._across = fluid, begun.across
        self._system = _coupled(begun.solid, fluid, case, time, wet=begun.wet)

    @property
    def history(self) -> History:
        """How the windows converged."""
        return self._system.history

    @property
    def force(self) -> ClosingForce:
        """What presses on the part now."""
        pressure = self._fluid.get_fields([PORE_PRESSURE])[PORE_PRESSURE]
        seen = self._across * self.solid.area
        fibres = float(seen @ self.law.pressure(self.solid.thickness))
        resin = float(seen @ pressure)
        return ClosingForce(fibres + resin, fibres, resin)

    def advance(
        self, until: float, on_step: Callable[[Filling], None] | None = None
    ) -> tuple[str, str]:
        """Go on to a time [s]; return outcome and message as :meth:`Filling.advance` does.

        ``on_step`` is called after every window.

        Raises
        ------
        NotConverged : textile and resin do not agree in the shortest window.
        SimulationError : a part cannot do its step.
        """

        def after_window(system: CoupledSystem) -> None:
            if on_step is not None:
                on_step(self.filling)

        self._system.advance_to(until, after_window)
        if self.filling.state.full.all():
            return "filled", f"all pores are full, and {until:.6g} s are reached"
        return "reached", f"{until:.6g} s are reached"

    def save(self) -> Any:
        """Return a copy of the whole state."""
        return self._system.save()

    def restore(self, saved: Any) -> None:
        """Go back to a saved state; going on from it is bit-identical."""
        self._system.restore(saved)


def _wet_cells(filling: Filling) -> np.ndarray:
    """Cells (C,) with resin in the control volume of a corner."""
    cells = filling.mesh.cells
    return ((filling.state.fill[cells] > 0.0) & (cells >= 0)).any(axis=1)


def _swells(filling: Filling) -> bool:
    """Whether resin or air can come into the pores: vents let only out.

    Under a bag cells exchange resin in any case, and the equations of the resin know how they
    answer to its pressure.
    """
    return bool(filling.supply.gates) or filling.film is not None or not filling.state.full.all()


def _borne(
    case: scene.Closure, law: CompactionLaw, start: np.ndarray, seen: np.ndarray
) -> np.ndarray:
    """Pressure (C,) [Pa] that is left for the resin at the start, before any of it has left."""
    fibres = law.pressure(start)
    if isinstance(case, scene.Bag):
        return value_at(_over_time(case.pressure, case.times), 0.0) - fibres
    assert isinstance(case, scene.Press)
    force = value_at(_over_time(case.force, case.times), 0.0) - float(seen @ fibres)
    return np.full_like(start, force / float(seen.sum()))


def _press_resin(filling: Filling, of_cells: np.ndarray) -> None:
    """Give the resin the pressure of the cells (C,) [Pa] that its control volumes lie in."""
    state, network = filling.state, filling.medium.network
    of_nodes = network.corner_sum(network.corner_areas * of_cells[:, None])
    mean = of_nodes / filling.medium.node_area
    state.pressure = np.where(state.full, mean, state.pressure)


def closure_of(case: scene.Closure, formed: np.ndarray, across: np.ndarray) -> closures.Closure:
    """Return what presses on cells of a formed thickness (C,) [m].

    across : share of a cell's area that the direction of closing sees, (C,).
    """
    if isinstance(case, scene.Bag):
        return closures.Bag(_over_time(case.pressure, case.times))
    if isinstance(case, scene.Press):
        return closures.Press(_over_time(case.force, case.times), across=across)
    if case.closing_time is None:
        return closures.Gap(_over_time(case.thickness, case.times), formed)
    return closures.ClosingGap(formed, case.thickness[0], case.closing_time)


def _over_time(
    values: tuple[float, ...], times: tuple[float, ...] | None
) -> float | Callable[[float], float]:
    if times is None:
        return values[0]
    return lambda time: float(np.interp(time, times, values))


def seen_across(mesh: FlowMesh, direction: tuple[float, float, float] | None) -> np.ndarray:
    """Share of each cell's area that a direction sees, |n·d|; all of it along the normals."""
    if direction is None:
        return np.ones(mesh.cell_count)
    unit = np.array(direction) / np.linalg.norm(direction)
    return np.abs(mesh.normals @ unit)


def _coupled(
    solid: LocalCompaction, fluid: FillingPart, case: scene.Closure, time: float, *, wet: bool
) -> CoupledSystem:
    """Textile and resin; where the gap is given, no iteration can change the thickness.

    Under a bag every cell answers to its own pressure, and the resin takes that answer into its
    equations (fixed-stress split). Under a press all cells have one gap, to which the pressure of
    none matters much: the quasi-Newton iteration finds it by itself. Where resin bears most of the
    force from the start, as in a preform that is pressed wet, its first step is a careful one.
    """
    first = min(time / WINDOWS if case.window is None else case.window, time)
    exchanges = [
        Exchange("solid", "fluid", VOLUME_RATE, of_window="mean", within="held",
                 tolerance=Tolerance(10.0 * case.tolerance)),
        Exchange("fluid", "solid", PORE_PRESSURE, tolerance=Tolerance(case.tolerance)),
    ]  # fmt: skip
    window, scheme = WindowControl(first), gauss_seidel()
    if not isinstance(case, scene.Gap):
        window = WindowControl(
            first, smallest=SHORTEST * first, largest=LONGEST * first, few_iterations=8
        )
        split = isinstance(case, scene.Bag)
        scheme = iqn_ils(relaxation=1.0 if split else CAREFUL if wet else 0.3)
        if split:
            exchanges += fixed_stress_exchanges("solid", "fluid")
    return CoupledSystem(
        {"solid": solid, "fluid": fluid}, exchanges, scheme, window=window, prediction=0
    )
