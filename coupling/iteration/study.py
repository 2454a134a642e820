"""Coupling schemes over stiffness and permeability: where each diverges, and what it costs."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from lcmchain.coupling.iteration.consolidation import (
    Column,
    Direction,
    coupled_column,
    settlement_share,
)
from lcmchain.coupling.iteration.interface import THICKNESS
from lcmchain.coupling.iteration.schemes import (
    Scheme,
    aitken,
    fixed_point,
    gauss_seidel,
    iqn_ils,
    iqn_mvj,
    jacobi,
)
from lcmchain.errors import SimulationError
from lcmchain.manual.tables import markdown_table

WINDOW, WINDOWS = 1.0, 20  # [s], number
MODULI = (1e5, 1e6, 1e7)  # [Pa]
PERMEABILITIES = (1e-10, 1e-12, 1e-14, 1e-16)  # [m2]
#: An explicit scheme has diverged where its settlement is off by more than this.
DIVERGED = 1.0

SchemeMaker = Callable[[], Scheme]


@dataclass(frozen=True)
class Entry:
    """One column of the table: a scheme in a direction."""

    label: str
    direction: Direction
    scheme: SchemeMaker


DIRECTIONS: dict[Direction, str] = {
    "pressure_from_fluid": "Pressure from the fluid",
    "fixed_stress": "Pressure from the fluid, fixed-stress split",
    "pressure_from_solid": "Pressure from the solid",
}


def _implicit(direction: Direction) -> list[Entry]:
    makers: list[SchemeMaker] = [fixed_point, aitken, iqn_ils, iqn_mvj]
    return [Entry(make().name, direction, make) for make in makers]


ENTRIES: tuple[Entry, ...] = (
    Entry("Jacobi", "pressure_from_fluid", jacobi),
    Entry("Gauss-Seidel", "pressure_from_fluid", gauss_seidel),
    Entry("fixed point, 0.1", "pressure_from_fluid", lambda: fixed_point(0.1, most_iterations=200)),
    *_implicit("pressure_from_fluid"),
    Entry("IQN-ILS, parallel", "pressure_from_fluid", lambda: iqn_ils(order="parallel")),
    Entry("Gauss-Seidel", "fixed_stress", gauss_seidel),
    *_implicit("fixed_stress"),
    Entry("Gauss-Seidel", "pressure_from_solid", gauss_seidel),
    *_implicit("pressure_from_solid"),
)


@dataclass(frozen=True)
class Outcome:
    """How a scheme did in a case.

    ``iterations`` per window; ``error`` of the settlement and of the cells' thickness over the
    final settlement, against the same windows solved tightly; ``window`` in which it stopped (from
    1), 0 where it did not; ``reason`` in the words of the error.
    """

    iterations: float
    error: float
    window: int = 0
    reason: str = ""
    explicit: bool = False

    @property
    def converged(self) -> bool:
        return self.window == 0 and self.error <= DIVERGED

    @property
    def text(self) -> str:
        if not self.converged:
            return "diverges" if self.explicit or "diverged" in self.reason else "fails"
        if self.explicit:
            percent = 100.0 * self.error
            return f"off by {percent:.2g} %" if percent >= 0.01 else "off by < 0.01 %"
        return f"{self.iterations:.1f}"


def gain(column: Column, window: float) -> float:
    """Return the eigenvalue, without its sign, of the slowest mode in the plain fixed point.

    C/(a dt) with the compliance C and conductance a of the lowest mode: 4 H^2 mu/(pi^2 K M dt).
    """
    return 4.0 / math.pi**2 * column.time_scale / window


def run_case(column: Column, entry: Entry, reference: np.ndarray | None = None) -> Outcome:
    """Run the windows of the study with one scheme.

    Parameters
    ----------
    reference : thickness of the cells to compare with, (n,); None: no error is found.
    """
    scheme = entry.scheme()
    # Extrapolation is left to the schemes that iterate; explicit ones it would make less stable.
    system = coupled_column(
        column,
        scheme,
        WINDOW,
        direction=entry.direction,
        prediction=0 if scheme.explicit else 1,
    )
    try:
        with np.errstate(over="ignore", invalid="ignore"):
            system.advance(WINDOWS * WINDOW)
    except SimulationError as failure:
        window = len(system.history.accepted) + 1
        return Outcome(math.nan, math.nan, window, str(failure), scheme.explicit)
    error = 0.0
    if reference is not None:
        thickness = system.get_fields([f"solid.{THICKNESS}"])[f"solid.{THICKNESS}"]
        error = _distance(column, thickness, reference)
    return Outcome(system.history.mean_iterations, error, explicit=scheme.explicit)


def solved_tightly(column: Column) -> tuple[np.ndarray, float]:
    """Return the thickness (n,) after the study's windows, and the share of the settlement."""
    system = coupled_column(
        column,
        fixed_point(most_iterations=200),
        WINDOW,
        direction="fixed_stress",
        relative=1e-10,
        prediction=0,
    )
    system.advance(WINDOWS * WINDOW)
    thickness = system.get_fields([f"solid.{THICKNESS}"])[f"solid.{THICKNESS}"]
    return thickness, settlement_share(system, column)


def _distance(column: Column, thickness: np.ndarray, reference: np.ndarray) -> float:
    """Return the largest error of a cell's thickness over the strain of the drained column."""
    final = column.cell * column.load / column.modulus
    return float(np.abs(thickness - reference).max() / final)


@dataclass
class SchemeStudy:
    """The results: one row per case, one outcome per entry."""

    entries: tuple[Entry, ...]
    rows: list[tuple[Column, float, list[Outcome]]] = field(default_factory=list)

    def markdown(self) -> str:
        """Return the page of the manual."""
        lines = [
            "# Coupling table",
            "",
            "Written by `lcmchain verify coupling --out FILE.md`; [Coupling](coupling.md) explains "
            "the schemes.",
            "",
            f"A saturated column of {1e3 * Column.height:g} mm under {Column.load / 1e5:g} bar "
            f"consolidates in {WINDOWS} windows of {WINDOW:g} s; µ = {Column.viscosity:g} Pa s, "
            f"{Column.cell_count} cells, tolerance 1e-6 of the field, windows are not shortened. "
            "M is the stiffness of the solid, in the lower half it hardens (exponent "
            f"{self._hardening():g}); K the permeability; the gain is the eigenvalue of the "
            "slowest mode in the plain fixed point. U is the settlement reached over its final "
            "value. Cells hold the iterations per window; where a scheme is explicit its largest "
            "error of a cell's thickness over the drained one, against the same windows solved "
            "tightly; *fails*: a window does not converge in 50 iterations (0.1: in 200), "
            "*diverges*: residuals or errors grow without bound.",
            "",
        ]
        for direction, title in DIRECTIONS.items():
            chosen = [i for i, entry in enumerate(self.entries) if entry.direction == direction]
            if chosen:
                lines += [f"## {title}", "", self._table(chosen)]
        return "\n".join(lines)

    def _hardening(self) -> float:
        return max((column.hardening for column, _, _ in self.rows), default=0.0)

    def _table(self, chosen: list[int]) -> str:
        heading = ["M [MPa]", "K [m²]", "gain", "U", *(self.entries[i].label for i in chosen)]
        rows = []
        for column, share, outcomes in self.rows:
            modulus = f"{column.modulus / 1e6:g}" + (", hardens" if column.hardening else "")
            case = [modulus, f"{column.permeability:.0e}", f"{gain(column, WINDOW):.2g}"]
            rows.append([*case, f"{share:.3g}", *(outcomes[i].text for i in chosen)])
        return markdown_table(heading, rows)


def study_schemes(
    moduli: Sequence[float] = MODULI,
    permeabilities: Sequence[float] = PERMEABILITIES,
    *,
    hardening: Sequence[float] = (0.0, 8.0),
    entries: Sequence[Entry] = ENTRIES,
    progress: Callable[[float, float, str], None] | None = None,
) -> SchemeStudy:
    """Run all schemes over stiffness [Pa] and permeability [m2]; return the table.

    ``hardening`` are exponents of the compaction law; 0 is linear.
    """
    study = SchemeStudy(tuple(entries))
    cases = [
        Column(modulus=modulus, permeability=permeability, hardening=exponent)
        for exponent in hardening
        for modulus in moduli
        for permeability in permeabilities
    ]
    for number, column in enumerate(cases):
        if progress is not None:
            progress(number, len(cases), f"M {column.modulus:.0e} Pa, K {column.permeability:.0e}")
        reference, share = solved_tightly(column)
        outcomes = [run_case(column, entry, reference) for entry in study.entries]
        study.rows.append((column, share, outcomes))
    return study
