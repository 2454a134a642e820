"""What a structural analysis found: its report in numbers, and a picture."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import NamedTuple

import matplotlib
import numpy as np

from lcmchain.atomic import replacing
from lcmchain.mapping.picture import skin
from lcmchain.mapping.structure.calculix import SolverRun
from lcmchain.mapping.structure.deck import Materials, idle_loads
from lcmchain.mapping.structure.mesh import TOO_STIFF, DeckMesh
from lcmchain.mapping.structure.results import StructuralResults
from lcmchain.mapping.structure.sections import Sections
from lcmchain.mapping.target import TargetMesh
from lcmchain.report.renderer import axes_at, draw_colour_bar, draw_facets, draw_triad, fit_axis
from lcmchain.report.style import FAINT, RC, Shown, colour_scale, headline, new_figure, save
from lcmchain.report.view import View, boundary_edges, hangs_down, oblique
from lcmchain.scene.structure import Structure

#: A difference between thicknesses of cell and nodes that a user should know of.
NOTABLE = 0.05


@dataclass
class StructureReport:
    """Result of one structural analysis; SI units.

    ``solved`` is False where CalculiX is not installed or was not asked for: the deck is there.
    ``thickness_error_max`` is the largest relative difference between the thickness of a cell and
    the mean of its nodes, which the deck has; ``material_error_max`` that of a stiffness from
    sharing materials. ``mass`` is that of the part (shells only).
    """

    name: str
    target: str
    elements: list[str]
    cell_count: int
    node_count: int
    material_count: int
    material_error_max: float
    thickness_error_max: float | None
    thickness_error_cell: int | None
    fibre_volume_fraction_min: float
    fibre_volume_fraction_max: float
    second_family_error_max: float
    mass: float | None
    solved: bool = False
    solver: str | None = None
    displacement_max: float | None = None
    displacement_max_node: int | None = None
    fibre_strain_max: float | None = None
    fibre_strain_max_cell: int | None = None
    eigenfrequencies: list[float | None] = field(default_factory=list)
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
        parts = [
            f"{self.name}: {self.cell_count} {'/'.join(self.elements)} elements, "
            f"{self.material_count} materials"
        ]
        if self.displacement_max is not None:
            parts.append(
                f"largest displacement {1e3 * self.displacement_max:.4g} mm at node "
                f"{self.displacement_max_node}"
            )
        if self.fibre_strain_max is not None:
            parts.append(
                f"largest strain along fibres {100 * self.fibre_strain_max:.3g} % in cell "
                f"{self.fibre_strain_max_cell}"
            )
        if self.eigenfrequencies:
            told = ", ".join(
                "none" if value is None else f"{value:.5g}" for value in self.eigenfrequencies[:6]
            )
            parts.append(f"eigenfrequencies {told} Hz")
        return "; ".join(parts)

    def add_results(self, run: SolverRun, results: StructuralResults, mesh: DeckMesh) -> None:
        """Note what CalculiX found."""
        self.solved, self.solver = True, f"CalculiX {run.version}"
        self.warnings += [f"CalculiX warns: {warning}" for warning in run.warnings]
        if results.displacement is not None and results.fibre_strain is not None:
            size = np.linalg.norm(results.displacement, axis=1)
            node = int(np.nanargmax(size))
            self.displacement_max, self.displacement_max_node = (
                float(size[node]),
                int(mesh.node_ids[node]),
            )
            # cells whose leading ply has fewer families than others have no value for the rest
            strain = np.nanmax(np.abs(results.fibre_strain), axis=1)
            cell = int(np.argmax(strain))
            self.fibre_strain_max, self.fibre_strain_max_cell = (
                float(strain[cell]),
                int(mesh.cell_ids[cell]),
            )
        self.eigenfrequencies = [
            float(value) if np.isfinite(value) else None for value in results.frequencies
        ]


def deck_report(
    name: str,
    target: TargetMesh,
    mesh: DeckMesh,
    sections: Sections,
    materials: Materials,
    structure: Structure,
) -> StructureReport:
    """Gather the numbers of a deck and the warnings that follow from them."""
    v, error = sections.fibre_volume_fraction, sections.thickness_error
    mass = None
    if sections.thickness is not None:
        mass = float((sections.density * sections.thickness * target.surface.areas).sum())
    report = StructureReport(
        name=name,
        target=str(target.file) if target.file else "mesh",
        elements=mesh.elements,
        cell_count=mesh.cell_count,
        node_count=int(mesh.used.sum()),
        material_count=len(materials.density),
        material_error_max=materials.error,
        thickness_error_max=None if error is None else error[0],
        thickness_error_cell=None if error is None else int(target.cell_ids[error[1]]),
        fibre_volume_fraction_min=float(v.min()),
        fibre_volume_fraction_max=float(v.max()),
        second_family_error_max=sections.second_family_error,
        mass=mass,
        warnings=list(sections.warnings),
    )
    for element in mesh.elements:
        if element in TOO_STIFF:
            report.warnings.append(
                f"{element} elements are too stiff in bending: the deflection of a thin plate on "
                f'20 x 20 cells {TOO_STIFF[element]}; write elements = "quadratic"'
            )
    if error is not None and error[0] > NOTABLE:
        report.warnings.append(
            f"the thickness varies by up to {100 * error[0]:.0f} % between neighbouring cells "
            f"(cell {report.thickness_error_cell}); shells take it as the mean at their nodes"
        )
    report.warnings += idle_loads(mesh, structure)
    if sections.through is not None:
        report.warnings.append(
            "layers give every element a thickness of its own, and CalculiX makes the joints "
            "between elements of different thickness rigid (a plate whose thickness varies by 10 % "
            "came out 4 % too stiff, its frequencies up to 8 % too high)"
        )
    return report


# --- picture: the deformed part, and its first modes ----------------------------------------------


PANEL = 4.2  # width of one panel [in]
LEFT, GAP, BAR, BOTTOM, TOP = 0.25, 0.3, 1.2, 0.25, 0.95  # around the panels [in]
MOST_MODES = 3
EXAGGERATION = 0.06  # largest displacement drawn, as a share of the part's size

DISPLACEMENT = Shown("displacement", "Displacement", "mm", 1e3, "viridis", False, 3, lowest=0.0)
MODE = Shown("mode", "Mode shape", "", 1.0, "magma", False, 2, lowest=0.0)


class _Panel(NamedTuple):
    title: str
    shown: Shown
    moves: np.ndarray  # (N, 3)


def draw_results(
    path: Path | str, target: TargetMesh, results: StructuralResults, report: StructureReport
) -> None:
    """Draw the static displacement and the first three modes on the deformed part (PNG)."""
    panels = _panels(results)
    view = oblique(from_below=not target.is_solid and hangs_down(target.points, _rim(target)))
    columns = min(len(panels), 2)
    rows = -(-len(panels) // columns)
    corners, _ = skin(target)
    height = _height(view, 1e3 * target.points[corners])
    with matplotlib.rc_context(RC):
        width = LEFT + columns * (PANEL + BAR) + (columns - 1) * GAP
        figure = new_figure(width, TOP + rows * (height + GAP) + BOTTOM)
        for number, panel in enumerate(panels):
            row, column = divmod(number, columns)
            left = LEFT + column * (PANEL + BAR + GAP)
            bottom = BOTTOM + (rows - 1 - row) * (height + GAP)
            axis = axes_at(figure, left, bottom, PANEL, height)
            bar = axes_at(figure, left + PANEL + 0.1, bottom + 0.2 * height, 0.14, 0.6 * height)
            _draw(figure, axis, bar, panel, target, corners, view)
        headline(figure, f"{report.name}: structural analysis", _subtitle(report))
        save(figure, path)


def _panels(results: StructuralResults) -> list[_Panel]:
    panels = []
    if results.displacement is not None:
        panels.append(_Panel("static loads", DISPLACEMENT, results.displacement))
    pairs = zip(results.frequencies[:MOST_MODES], results.modes)
    for number, (frequency, shape) in enumerate(pairs, start=1):
        panels.append(_Panel(f"mode {number}: {frequency:.4g} Hz", MODE, shape))
    return panels


def _draw(figure, axis, bar, panel: _Panel, target, corners: np.ndarray, view: View) -> None:
    size = np.linalg.norm(panel.moves, axis=1)
    largest = float(np.nanmax(size))
    extent = np.linalg.norm(np.ptp(target.points[np.unique(corners)], axis=0))
    factor = EXAGGERATION * extent / largest if largest > 0.0 else 0.0
    count = len(target.points)
    moved = 1e3 * (target.points + factor * panel.moves[:count])
    values = panel.shown.factor * size[corners].mean(axis=1)
    colours = colour_scale(values, panel.shown)
    rim = None if target.is_solid else moved[_rim(target)]
    draw_facets(axis, moved[corners], view, colours.to_rgba(values), rim=rim)
    fit_axis(axis, view.on_screen(moved[corners]).reshape(-1, 2), 0.02)
    axis.set_axis_off()
    axis.set_title(_title(panel, largest, float(factor)), color=FAINT, loc="left")
    draw_triad(axis, view)
    # The colour of a facet is the mean of its corners: the largest stands in the title.
    draw_colour_bar(figure, bar, colours, values, panel.shown, extremes=False)


def _title(panel: _Panel, largest: float, factor: float) -> str:
    if panel.shown is MODE:
        return panel.title
    return f"{panel.title}: at most {1e3 * largest:.3g} mm, drawn {factor:.3g} times"


def _rim(target: TargetMesh) -> np.ndarray:
    return boundary_edges(skin(target)[0])


def _height(view: View, points: np.ndarray) -> float:
    width, height = np.ptp(view.on_screen(points).reshape(-1, 2), axis=0)
    return PANEL * float(np.clip(height / max(width, 1e-12), 0.25, 1.2))


def _subtitle(report: StructureReport) -> str:
    parts = [f"{report.cell_count:,} {'/'.join(report.elements)} elements"]
    if report.mass is not None:
        parts.append(f"mass {1e3 * report.mass:.4g} g")
    parts.append(f"largest angle of the second family from perpendicular "
                 f"{np.degrees(report.second_family_error_max):.1f}°")  # fmt: skip
    return "  ·  ".join([*parts, report.solver or ""])
