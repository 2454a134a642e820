"""Hard cases of the coupling: stiff exchange of pressure and volume between solid and fluid.

The core does not import what is built on it. ``lcmchain verify hard-cases`` imports this file, so
that its cases are on the list of all hard cases.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from lcmchain.coupling.iteration.consolidation import (
    Column,
    Direction,
    coupled_column,
    degree_of_consolidation,
    settlement_share,
)
from lcmchain.coupling.iteration.schemes import (
    Scheme,
    aitken,
    fixed_point,
    gauss_seidel,
    iqn_ils,
)
from lcmchain.coupling.iteration.system import CoupledSystem
from lcmchain.errors import SimulationError
from lcmchain.verification.hard_cases.case import CaseResult, guarded, hard_case

THEME = "Coupling"

PRESSURE, THICKNESS = "fluid.pore_pressure", "solid.thickness"


@hard_case("consolidation", THEME, reduced="100 windows instead of 1,000")
def consolidation(name: str, full: bool) -> Iterator[CaseResult]:
    """Terzaghi's column as two parts, pressure from the fluid, coupled by IQN-ILS.

    Hard because a part answers to a small change of the other by a large one: a staggered scheme
    diverges at once. The settlement must follow the series.
    """
    column, windows = Column(), 1000 if full else 100
    for time_factor in (0.197, 0.848):
        time = time_factor * column.time_scale
        system = coupled_column(column, iqn_ils(), time / windows)
        system.advance(time)
        expected = degree_of_consolidation(time_factor)
        error = abs(settlement_share(system, column) / expected - 1.0)
        yield CaseResult(
            name,
            f"T = {time_factor:g}: settlement against the series, U = {expected:.4f}",
            100.0 * error,
            1.0,
            "%",
            without=_staggered(column, time / windows),
        )


@hard_case("staggered_coupling", THEME)
def staggered_coupling(name: str, full: bool) -> Iterator[CaseResult]:
    """A soft saturated column of low permeability in windows that are short for it.

    Hard because the plain fixed point multiplies an error of the pressure by -41 in every
    iteration. Aitken and IQN-ILS must converge soon, and to the same answer.
    """
    column = Column(modulus=1e5)
    for scheme, limit in ((aitken(), 20.0), (iqn_ils(), 8.0)):
        system = _run(column, scheme, "pressure_from_fluid")
        yield CaseResult(
            name,
            f"gain 41: iterations per window of {scheme.name}",
            system.history.mean_iterations,
            limit,
            without=_staggered(column, 1.0),
        )
    systems = (
        _run(column, aitken(most_iterations=200), "pressure_from_fluid", relative=1e-9),
        _run(column, iqn_ils(), "pressure_from_fluid", relative=1e-9),
        _run(column, fixed_point(), "fixed_stress", relative=1e-9),
    )
    first, *others = (system.get_fields([PRESSURE])[PRESSURE] for system in systems)
    distance = max(np.abs(other - first).max() / column.load for other in others)
    yield CaseResult(name, "pressure of three schemes over the load", float(distance), 1e-6)


@hard_case("undrained_column", THEME)
def undrained_column(name: str, full: bool) -> Iterator[CaseResult]:
    """A column whose fluid cannot leave: no change of volume, the fluid carries the load.

    Hard because the gain grows without bound as the permeability falls. The fixed-stress split
    must converge in a few iterations whatever it is.
    """
    for permeability in (1e-14, 1e-16, 1e-20):
        column = Column(permeability=permeability)
        system = _run(column, fixed_point(), "fixed_stress")
        fields = system.get_fields([PRESSURE, THICKNESS])
        lower = slice(0, column.cell_count // 2)
        yield CaseResult(
            name,
            f"K = {permeability:.0e} m²: iterations per window",
            system.history.mean_iterations,
            3.0,
            without=_plain(column),
        )
        if permeability < 1e-15:
            pressure = fields[PRESSURE][lower] / column.load
            strain = fields[THICKNESS][lower] / column.cell - 1.0
            drained = column.load / column.modulus
            yield CaseResult(
                name,
                f"K = {permeability:.0e} m²: pressure of the lower half against the load",
                100.0 * float(np.abs(pressure - 1.0).max()),
                0.1,
                "%",
            )
            yield CaseResult(
                name,
                f"K = {permeability:.0e} m²: its strain over the drained one",
                100.0 * float(np.abs(strain).max()) / drained,
                0.1,
                "%",
            )


@hard_case("hardening_column", THEME)
def hardening_column(name: str, full: bool) -> Iterator[CaseResult]:
    """A compaction law that stiffens a hundredfold under the load, at low permeability.

    Hard because what a quasi-Newton scheme has learnt no longer holds in the next iteration, and
    in the first one the pressure is far beyond the load. The split takes the slope as it is.
    """
    column = Column(modulus=1e5, hardening=8.0, load=1.25e6, permeability=1e-14)
    system = _run(column, fixed_point(), "fixed_stress")
    yield CaseResult(
        name,
        "fixed-stress split: iterations per window",
        system.history.mean_iterations,
        5.0,
        without=_plain(column),
    )
    tight = _run(column, fixed_point(), "fixed_stress", relative=1e-10)
    one, other = (s.get_fields([PRESSURE])[PRESSURE] for s in (system, tight))
    # Every window may add its tolerance.
    yield CaseResult(
        name,
        "pressure at tolerance 1e-6 against 1e-10, over the load, after 20 windows",
        float(np.abs(one - other).max() / column.load),
        2e-5,
    )


@hard_case("coupling_that_fails", THEME)
def coupling_that_fails(name: str, full: bool) -> Iterator[CaseResult]:
    """A fixed point that cannot converge must stop the run, not go on with what it has.

    The message names the exchange, the cell, its place and the excess.
    """
    column = Column(modulus=1e5)
    yield guarded(
        name,
        "plain fixed point at a gain of 41: stopped with exchange, value, place and excess",
        lambda: _run(column, fixed_point(), "pressure_from_fluid"),
        "fluid.pore_pressure -> solid.pore_pressure",
        "from 0 s",
        "is allowed (",
        "near (0.00, 0.00, 0.12) mm",
    )


def _run(
    column: Column, scheme: Scheme, direction: Direction, *, relative: float = 1e-6
) -> CoupledSystem:
    """Run 20 windows of 1 s."""
    system = coupled_column(column, scheme, 1.0, direction=direction, relative=relative)
    system.advance(20.0)
    return system


def _staggered(column: Column, window: float) -> str:
    """Return what an explicit scheme does in 20 windows."""
    system = coupled_column(column, gauss_seidel(), window, prediction=0)
    system.advance(20 * window)
    pressure = float(np.abs(system.get_fields([PRESSURE])[PRESSURE]).max()) / column.load
    return f"staggered: pressure {pressure:.0e} times the load after 20 windows"


def _plain(column: Column) -> str:
    """Return what becomes of the coupling without the split."""
    words = []
    for scheme in (fixed_point(), iqn_ils()):
        try:
            system = _run(column, scheme, "pressure_from_fluid")
        except SimulationError:
            words.append(f"{scheme.name} fails")
        else:
            words.append(f"{scheme.name} {system.history.mean_iterations:.1f}")
    return f"without the split: {', '.join(words)}"
