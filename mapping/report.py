"""What a mapping did, in numbers: coverage, status counts, distances, conservation, warnings."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from lcmchain.atomic import replacing
from lcmchain.errors import first_few
from lcmchain.mapping.fields import (
    MappedFields,
    content_of_cells,
    content_of_sheet,
    covered_areas,
    facing,
)
from lcmchain.mapping.formats.format import ExportReport
from lcmchain.mapping.plies import too_far_off
from lcmchain.mapping.registration import Registration
from lcmchain.mapping.sheet import FIBRE_FAMILIES, PERMEABILITIES, Sheet
from lcmchain.mapping.surfaces.averages import perpendicular_family_error
from lcmchain.mapping.target import TargetMesh
from lcmchain.mapping.weights import COVERED, MappingWeights, Status

# Below this the families or layers in a cell disagree so much that one direction misleads:
# 0.75 is the mean of two axes 60 degrees apart.
LOW_ALIGNMENT = 0.75
# Beyond this the fibres of the sheet and the cell's plane belong to different shapes.
LARGE_TILT = np.radians(30.0)
# Changes of content beyond this come from a target that covers the sheet more than once.
LARGE_CORRECTION = 0.25
# Below this the thickness of a solid mesh is the formed one for all that a report can say.
NOTABLE_DIFFERENCE = 0.01
# Below this a shear angle is within what a perpendicular second family misrepresents harmlessly.
NOTABLE_ANGLE = np.radians(1.0)


@dataclass
class MappingReport:
    """Result of one mapping; angles in rad, lengths in m, shares between 0 and 1.

    ``conservation_error`` is the relative difference between the fibre mass on the covered target
    area and on the covered sheet area. Overlap weights keep it by scaling each face's shares;
    ``wedge_correction`` is the largest such scaling, and ``moved`` the share of the mass that was
    moved between neighbouring cells to even it out, so all are stated. ``registration`` says how
    the target lies to the sheet (:class:`lcmchain.mapping.registration.Registration`), and
    ``registered`` whether its motion was applied before the mapping. ``opposite_normals`` is the
    number of cells whose normals point to the lower side of the sheet, None for solids.
    ``verification`` holds the error that the mapping adds to each field
    (:class:`lcmchain.mapping.verify.FieldError`), where that was asked for.
    ``exports`` holds an :class:`lcmchain.mapping.formats.ExportReport` of each further format.
    """

    name: str
    kind: str
    method: str
    source: str
    target: str
    maximum_distance: float
    cell_count: int
    status_count: dict[str, int]
    target_coverage: float
    source_coverage: float
    worst_distance: float
    worst_distance_cell: int
    conservation_error: float | None
    wedge_correction: float
    moved: float
    fibre_mass_of_covered_sheet: float | None
    fibre_mass_on_target: float | None
    second_family_error_max: float | None
    second_family_error_cell: int | None
    fields: list[str]
    ignored_cells: dict[str, int]
    ignored_fields: list[str]
    opposite_normals: int | None = None
    registration: dict[str, Any] | None = None
    registered: bool = False
    verification: dict[str, dict[str, Any]] | None = None
    warnings: list[str] = field(default_factory=list)
    files: dict[str, str] = field(default_factory=dict)
    exports: list[dict[str, Any]] = field(default_factory=list)

    def add_exports(self, exports: list[ExportReport]) -> None:
        """Take up what was written for other programs, and what their formats cannot hold."""
        self.exports += [export.as_dict() for export in exports]
        self.warnings += [warning for export in exports for warning in export.warnings]

    def as_dict(self) -> dict:
        """Plain values, ready for JSON."""
        return asdict(self)

    def save(self, path: Path | str) -> None:
        """Write as JSON, complete or not at all."""
        with replacing(path) as temporary:
            text = json.dumps(self.as_dict(), indent=2, allow_nan=False) + "\n"
            temporary.write_text(text, encoding="utf-8")

    def summary(self) -> str:
        """What was mapped and how well the two lie together, for the terminal."""
        counts = ", ".join(f"{n} {name}" for name, n in self.status_count.items() if n)
        return (
            f"{self.name}: {self.cell_count} cells ({counts}); "
            f"{100 * self.target_coverage:.1f} % of the target area and "
            f"{100 * self.source_coverage:.1f} % of the sheet covered; "
            f"farthest {1e3 * self.worst_distance:.2f} mm off the sheet{self._place()}"
        )

    def _place(self) -> str:
        """How the target lies to the sheet, and the motion that was applied to it."""
        if self.registration is None:
            return ""
        registration = Registration(**self.registration)
        text = f"; {registration.distance_in_words()}"
        if self.registered:
            after = f"{1e3 * registration.root_mean_square_after:.3f} mm"
            text += f"; mapped as if {registration.motion_in_words()}, which leaves {after}"
        return text


def mapping_report(
    sheet: Sheet,
    target: TargetMesh,
    weights: MappingWeights,
    mapped: MappedFields,
    *,
    name: str,
    kind: str,
    registration: Registration | None = None,
    registered: bool = False,
) -> MappingReport:
    """Gather the numbers of a mapping and the warnings that follow from them."""
    status_count = {s.name.lower(): int(np.sum(weights.status == s)) for s in Status}
    area = weights.cell_area.sum()
    distance = np.where(weights.mapped, weights.distance, -1.0)
    worst = int(np.argmax(distance))
    masses = _fibre_mass(sheet, weights, mapped)
    error_cell, error = _second_family_error(mapped)
    sheet_area = sheet.surface.areas
    opposite = _opposite_normals(sheet, target, weights)
    return MappingReport(
        name=name,
        kind=kind,
        method=weights.method,
        source=sheet.name,
        target=str(target.file) if target.file else "mesh",
        maximum_distance=weights.maximum_distance,
        cell_count=target.cell_count,
        status_count=status_count,
        target_coverage=float(covered_areas(weights).sum() / area) if area > 0.0 else 0.0,
        source_coverage=float((weights.face_coverage * sheet_area).sum() / sheet_area.sum()),
        worst_distance=max(float(distance[worst]), 0.0),
        worst_distance_cell=worst,
        conservation_error=masses[2],
        wedge_correction=weights.wedge_correction,
        moved=weights.moved,
        fibre_mass_of_covered_sheet=masses[0],
        fibre_mass_on_target=masses[1],
        second_family_error_max=error,
        second_family_error_cell=error_cell,
        fields=[*mapped.scalars, *mapped.vectors],
        ignored_cells=dict(target.ignored),
        ignored_fields=list(sheet.unused),
        opposite_normals=opposite,
        registration=None if registration is None else registration.as_dict(),
        registered=registered,
        warnings=[
            *([] if registration is None or registered else registration.warnings()),
            *_normal_warnings(opposite, weights),
            *_warnings(weights, target, sheet, mapped, kind, error, error_cell),
        ],
    )


def _fibre_mass(sheet: Sheet, weights: MappingWeights, mapped: MappedFields):
    name = "areal_fibre_mass"
    # Several solids may lie over each other in the thickness: their sections have no common area.
    if name not in mapped.scalars or np.all(weights.cell_area == 0.0):
        return None, None, None
    source = content_of_sheet(sheet, weights, sheet.scalars[name])
    target = content_of_cells(weights, mapped.scalars[name])
    if source == 0.0 or (weights.method == "overlap" and not weights.conservative):
        return source, None, None
    return source, target, (target - source) / source


def _second_family_error(mapped: MappedFields) -> tuple[int | None, float | None]:
    if sum(name in mapped.directions for name in FIBRE_FAMILIES) != 2:
        return None, None  # one family has no second, and three are at other angles
    first, second = (mapped.directions[name] for name in FIBRE_FAMILIES[:2])
    error = perpendicular_family_error(first.direction, second.direction)
    if np.isnan(error).all():
        return None, None
    worst = int(np.nanargmax(error))
    return worst, float(error[worst])


def _opposite_normals(sheet: Sheet, target: TargetMesh, weights: MappingWeights) -> int | None:
    if target.is_solid:
        return None
    shown = facing(sheet, weights, target.surface.normals)[weights.mapped]
    return int(np.sum(shown < 0.0))


def _normal_warnings(opposite: int | None, weights: MappingWeights) -> list[str]:
    mapped = int(weights.mapped.sum())
    if not opposite or opposite == mapped:
        return []
    return [
        f"the normals of {opposite} cells point to the lower side of the sheet and those of "
        f"{mapped - opposite} to the upper one: shear_angle, which is counted about them, changes "
        "its sign between; make the normals of the target consistent"
    ]


def _warnings(weights, target, sheet, mapped, kind, error, error_cell) -> list[str]:
    warnings = []
    if "thickness" not in sheet.scalars:
        warnings.append(
            "the forming result holds no thickness (a 2D approach predicts none): mapped are "
            f"{', '.join([*mapped.scalars, *mapped.vectors])}"
        )
    extrapolated = np.flatnonzero(weights.status == Status.EXTRAPOLATED)
    if len(extrapolated):
        warnings.append(
            f"{len(extrapolated)} cells reach beyond the edge of the sheet and take the values of "
            f"its nearest part ({first_few(extrapolated)})"
        )
    unmapped = np.flatnonzero(~weights.mapped)
    if len(unmapped):
        warnings.append(f"{len(unmapped)} cells are unmapped and hold no values (NaN) "
                     f"({first_few(unmapped)})")  # fmt: skip
    if weights.missed.any():
        faces = np.flatnonzero(weights.missed)
        share = sheet.surface.areas[faces].sum() / sheet.surface.areas.sum()
        warnings.append(
            f"{len(faces)} faces of the sheet lie over the target and no cell takes from them "
            f"({100 * share:.2g} % of its area; {first_few(faces, what='face')}): the sheet lies "
            "in folds or walls there that the target lacks, and their fibres are missing"
        )
    if sheet.is_stack and not target.is_solid:
        warnings += too_far_off(sheet, target.surface, weights)
    warnings += _permeability_warnings(weights, mapped)
    warnings += _solid_warnings(weights, mapped)
    if weights.wedge_correction > LARGE_CORRECTION:
        warnings.append(
            "the target bends sharply or covers parts of the sheet more than once: contents were "
            f"scaled by up to {100 * weights.wedge_correction:.0f} % to keep the fibre mass"
        )
    for name in FIBRE_FAMILIES:
        family = mapped.directions.get(name)
        if family is None:
            continue
        mixed = np.flatnonzero(family.alignment < LOW_ALIGNMENT)
        if len(mixed):
            warnings.append(
                f"{name} varies strongly within {len(mixed)} cells ({first_few(mixed)}); refine "
                "the target there"
            )
        tilted = np.flatnonzero(family.tilt > LARGE_TILT)
        if len(tilted):
            warnings.append(
                f"{name} leaves the plane of {len(tilted)} cells by up to "
                f"{np.degrees(np.nanmax(family.tilt)):.0f} degrees ({first_few(tilted)}); the "
                "target has another shape there"
            )
    if kind == "structure" and error is not None and error > NOTABLE_ANGLE:
        warnings.append(
            "both fibre directions are kept here; a solver deck with one orientation per element "
            "takes the second family as perpendicular to the first and is wrong by up to "
            f"{np.degrees(error):.1f} degrees (cell {error_cell})"
        )
    if target.ignored:
        cells = ", ".join(f"{count} {name}" for name, count in target.ignored.items())
        warnings.append(f"cells of the target file left aside: {cells}")
    warnings += target.notes
    if sheet.unused:
        warnings.append(f"fields left aside, no scalars or with holes: {', '.join(sheet.unused)}")
    return warnings


def _solid_warnings(weights: MappingWeights, mapped: MappedFields) -> list[str]:
    """Cells of a solid that hold less textile than they have room for, and their thickness."""
    warnings: list[str] = []
    if not len(weights.solid_thickness):
        return warnings
    difference = np.abs(mapped.scalars.get("thickness_difference", np.zeros(0)))
    if len(difference) and np.nanmax(difference) > NOTABLE_DIFFERENCE:
        worst = int(np.nanargmax(difference))
        signed = mapped.scalars["thickness_difference"][worst]
        warnings.append(
            f"the solid mesh is up to {100.0 * abs(signed):.2g} % "
            f"{'thicker' if signed > 0.0 else 'thinner'} than the formed textile (cell {worst}); "
            "its fibre volume fraction is that of the formed fibre mass in its own thickness"
        )
    partly = np.flatnonzero(weights.mapped & (weights.coverage < COVERED))
    if len(partly):
        warnings.append(
            f"{len(partly)} cells lie beyond the sheet in part or whole and hold fibre only where "
            f"it is ({first_few(partly)})"
        )
    return warnings


def _permeability_warnings(weights: MappingWeights, mapped: MappedFields) -> list[str]:
    if not mapped.axes:
        return []
    missing = np.flatnonzero(weights.mapped & np.isnan(mapped.scalars[PERMEABILITIES[0]]))
    if len(missing) == 0:
        return []
    return [
        f"{len(missing)} cells have no permeability (NaN): they take from faces whose fibre volume "
        f"fraction the permeability law does not reach ({first_few(missing)})"
    ]
