"""What a structural analysis did, in numbers."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass, field
from pathlib import Path

import numpy as np

from lcmchain.atomic import replacing
from lcmchain.mapping.structure.calculix import SolverRun
from lcmchain.mapping.structure.deck import Materials, idle_loads
from lcmchain.mapping.structure.mesh import TOO_STIFF, DeckMesh
from lcmchain.mapping.structure.results import StructuralResults
from lcmchain.mapping.structure.sections import Sections
from lcmchain.mapping.target import TargetMesh
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
            strain = np.abs(results.fibre_strain).max(axis=1)
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
