"""What a structural analysis did, in numbers."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass, field
from pathlib import Path

from lcmchain.atomic import replacing


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
            temporary.write_text(json.dumps(self.as_dict(), indent=2, allow_nan=False) + "\n")

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
