"""A mould that closes on a part while resin flows: textile and resin, coupled.

Every cell is compressed along its normal and does not move in its plane, as between rigid tools or
under a bag: fibres and resin bear Terzaghi's total pressure. The cells squeeze the resin that flows
between them (:class:`FillingPart`), and its pressure lifts them (:class:`LocalCompaction`).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np

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
from lcmchain.coupling.solids.stack_compaction import compaction_of
from lcmchain.scene.infiltration import boundaries as scene

# --- A mould that closes on a part while resin flows: textile and resin, brought to agree -------


#: Default number of windows of a filling, and the factors by which windows may shrink and grow.
WINDOWS = 200
SHORTEST = 1e-4
LONGEST = 4.0
#: Relaxation of the first iteration where resin bears most of a force, which overreacts.
CAREFUL = 0.01


class ClosingForce(NamedTuple):
    """Force on all cells along the direction of closing [N]: of fibres, of resin, and both."""

    total: float
    fibres: float
    resin: float


class Begun(NamedTuple):
    """Textile of a part under a closure, at the start of its filling.

    Parameters
    ----------
    law : of the textile.
    solid : its cells at their thickness.
    across : share of each cell's area across the direction of closing, (C,).
    wet : whether resin bears a part of the pressure from the start.
    """

    law: CompactionLaw
    solid: LocalCompaction
    across: np.ndarray
    wet: bool


def begin(part: FormedPart, fluid: FillingPart, case: scene.Closure) -> Begun:
    """Bring a filling and its textile to the start under a closure.

    Where the part is pressed dry, the fibres bear the whole pressure, which gives the thickness.
    Where it is pressed wet, cells with resin keep the thickness of the forming, and the resin bears
    the pressure that the fibres do not. The filling takes thickness and pressures.

    Raises
    ------
    InputError : the file of the part does not hold its textile.
    SimulationError : the textile cannot bear the pressure.
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
        wet[:] = wet.any()  # one gap for all: wet cells carry the tool
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
    """A filling under a closure; it advances in place of the filling.

    Parameters
    ----------
    part : that the resin flows through; :func:`begin` says how it is pressed at the start.
    filling : at its start; its thickness is set to that under the closure.
    case : closure of the scene.
    time : end of the filling [s].

    Raises
    ------
    InputError : the file of the part does not hold its textile.
    SimulationError : the textile cannot bear the pressure.
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
        """Convergence of the windows."""
        return self._system.history

    @property
    def force(self) -> ClosingForce:
        """Present force on the part."""
        pressure = self._fluid.get_fields([PORE_PRESSURE])[PORE_PRESSURE]
        area = self._across * self.solid.area
        fibres = float(area @ self.law.pressure(self.solid.thickness))
        resin = float(area @ pressure)
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

    def save(self) -> dict[str, Any]:
        """Return a copy of the whole state."""
        return self._system.save()

    def restore(self, saved: Mapping[str, Any]) -> None:
        """Go back to a saved state; going on from it is bit-identical."""
        self._system.restore(saved)


def _wet_cells(filling: Filling) -> np.ndarray:
    """Whether a cell has resin in the control volume of a corner (C,)."""
    cells = filling.mesh.cells
    return ((filling.state.fill[cells] > 0.0) & (cells >= 0)).any(axis=1)


def _swells(filling: Filling) -> bool:
    """Whether resin or air can enter the pores; through vents they only leave.

    Not asked under a bag: there cells exchange resin in any case, and the equations of the resin
    contain their compliance.
    """
    return bool(filling.supply.gates) or filling.film is not None or not filling.state.full.all()


def _borne(
    case: scene.Closure, law: CompactionLaw, start: np.ndarray, area: np.ndarray
) -> np.ndarray:
    """Return the pressure (C,) [Pa] that the resin bears at the start, before any flows out.

    Parameters
    ----------
    start : thickness of the cells (C,) [m].
    area : of the cells across the direction of closing (C,) [m²].
    """
    fibres = law.pressure(start)
    if isinstance(case, scene.Bag):
        return value_at(_over_time(case.pressure, case.times), 0.0) - fibres
    assert isinstance(case, scene.Press)
    force = value_at(_over_time(case.force, case.times), 0.0) - float(area @ fibres)
    return np.full_like(start, force / float(area.sum()))


def _press_resin(filling: Filling, of_cells: np.ndarray) -> None:
    """Set the pressure of full control volumes to the mean of their cells' pressures (C,) [Pa]."""
    state, network = filling.state, filling.medium.network
    of_nodes = network.corner_sum(network.corner_areas * of_cells[:, None])
    mean = of_nodes / filling.medium.node_area
    state.pressure = np.where(state.full, mean, state.pressure)


def closure_of(case: scene.Closure, formed: np.ndarray, across: np.ndarray) -> closures.Closure:
    """Return the closure of a scene for cells of a formed thickness (C,) [m].

    across : share of each cell's area across the direction of closing, (C,).
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
    """Return the share of each cell's area across a direction, |n·d| (C,); 1 without direction."""
    if direction is None:
        return np.ones(mesh.cell_count)
    unit = np.array(direction) / np.linalg.norm(direction)
    return np.abs(mesh.normals @ unit)


def _coupled(
    solid: LocalCompaction, fluid: FillingPart, case: scene.Closure, time: float, *, wet: bool
) -> CoupledSystem:
    """Return textile and resin as a system.

    Where the gap is prescribed, the pressure does not change the thickness: nothing is iterated.
    Under a bag every cell depends on its own pressure, and the equations of the resin contain this
    dependence (fixed-stress split). Under a press all cells have one gap, on which the pressure of
    a single cell has little influence: the quasi-Newton iteration finds it alone. Where resin bears
    most of the force from the start, as in a preform that is pressed wet, its first step is short.
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
