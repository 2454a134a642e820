"""The error that a mapping adds: what a mapping on finer meshes, and one there and back, change."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from lcmchain.mapping.orientation import MappedDirections
from lcmchain.mapping.refinement import as_target, refined_sheet, refined_target
from lcmchain.mapping.sheet import PERMEABILITIES, PERMEABILITY_AXES, PrincipalPermeability, Sheet
from lcmchain.mapping.surface import Surface
from lcmchain.mapping.target import TargetMesh
from lcmchain.mapping.tensors import angles_between, squares, tensors_of
from lcmchain.mapping.transfer import ERROR, PERMEABILITY, MappedFields, covered_areas, transfer
from lcmchain.mapping.weights import COVERED, MappingWeights

#: Computes weights with the options of the mapping that is verified.
Weigh = Callable[[Sheet, TargetMesh], MappingWeights]


@dataclass(frozen=True)
class FieldError:
    """Estimated error of one mapped field, in its units (directions: rad).

    Parameters
    ----------
    worst, worst_cell : the largest error, and the cell that has it.
    root_mean_square : over the cells, weighted by their covered areas.
    there_and_back_worst, there_and_back : largest and root-mean-square change of the field on the
        faces of the sheet when it is mapped back from the target; None for solid targets.
    """

    units: str
    worst: float
    worst_cell: int
    root_mean_square: float
    there_and_back_worst: float | None = None
    there_and_back: float | None = None


@dataclass(frozen=True)
class Verification:
    """Errors of the mapped fields by name: cell by cell, shape (C,), and in numbers."""

    cells: dict[str, np.ndarray]
    fields: dict[str, FieldError]

    def as_dict(self) -> dict[str, dict[str, Any]]:
        """Plain values, ready for JSON."""
        return {name: asdict(found) for name, found in self.fields.items()}


def verify(
    sheet: Sheet,
    target: TargetMesh,
    weights: MappingWeights,
    mapped: MappedFields,
    weigh: Weigh,
) -> Verification:
    """Estimate the error that the mapping adds to every field, in every cell.

    Sheet and target are refined: each face and each cell becomes four in its own facet, and the
    faces' values a quadratic through those around (:mod:`lcmchain.mapping.reconstruction`). The
    same method maps between these, and what its means over the cells differ by from the mapped
    values is the estimate. It sees what the finite size of faces and cells costs; it holds as far
    as the fields are smooth over a few faces, and knows nothing of the error of the fields
    themselves.

    Parameters
    ----------
    weigh : computes weights as those of the mapping were; called on the refined meshes and, for
        the way back, with target and sheet exchanged.
    """
    fine_sheet = refined_sheet(sheet)
    fine_target, parent = refined_target(target)
    fine_weights = weigh(fine_sheet, fine_target)
    fine = transfer(fine_sheet, fine_target, fine_weights)
    share = _shares(fine_weights, parent, target.cell_count)
    cells = _differences(mapped, _means(fine, parent, share, target.cell_count))
    area = np.where(weights.mapped, covered_areas(weights), 0.0)
    area = area if area.sum() > 0.0 else weights.mapped.astype(float)
    back = _there_and_back(sheet, target, weights, mapped, weigh)
    return Verification(
        cells, {name: _judged(name, sheet, found, area, back) for name, found in cells.items()}
    )


# --- cell by cell ---------------------------------------------------------------------------------


def _shares(weights: MappingWeights, parent: np.ndarray, cell_count: int) -> np.ndarray:
    """Share of each part in the mean over its cell, shape (P,): as much of it as is covered."""
    area = np.where(weights.mapped, covered_areas(weights), 0.0)
    covered = np.bincount(parent, area, minlength=cell_count)
    alone = weights.mapped & (covered[parent] == 0.0)  # beyond the edge of the sheet
    area[alone] = np.where(weights.cell_area[alone] > 0.0, weights.cell_area[alone], 1.0)
    covered = np.bincount(parent, area, minlength=cell_count)
    return area / np.where(covered[parent] > 0.0, covered[parent], np.nan)


def _means(
    fine: MappedFields, parent: np.ndarray, share: np.ndarray, cell_count: int
) -> dict[str, np.ndarray]:
    """Means over the cells of scalars (C,) and of the tensors of all else (C, 3, 3)."""
    return {
        name: _summed(np.where(share.reshape(-1, *[1] * (values.ndim - 1)) > 0.0, values, 0.0),
                      parent, share, cell_count)
        for name, values in _comparable(fine).items()
    }  # fmt: skip


def _summed(
    values: np.ndarray, parent: np.ndarray, share: np.ndarray, cell_count: int
) -> np.ndarray:
    flat = values.reshape(len(values), -1)
    columns = [np.bincount(parent, share * column, minlength=cell_count) for column in flat.T]
    return np.stack(columns, axis=1).reshape(cell_count, *values.shape[1:])


def _comparable(mapped: MappedFields) -> dict[str, np.ndarray]:
    """Scalars (C,), and tensors (C, 3, 3) of directions and of the permeability."""
    found = {
        name: values
        for name, values in mapped.scalars.items()
        if name not in PERMEABILITIES and not name.endswith(ERROR)
    }
    found |= {name: squares(family.direction) for name, family in mapped.directions.items()}
    if mapped.axes and all(name in mapped.scalars for name in PERMEABILITIES):
        values = np.stack([mapped.scalars[name] for name in PERMEABILITIES], axis=1)
        axes = np.stack([mapped.axes[name] for name in PERMEABILITY_AXES], axis=1)
        found[PERMEABILITY] = tensors_of(values, axes)
    return found


def _differences(one: MappedFields, means: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Size of the differences, shape (C,): of scalars, angles of directions, norms of tensors."""
    cells = {}
    for name, values in _comparable(one).items():
        if name not in means:
            continue
        known = np.isfinite(means[name]).reshape(len(values), -1).all(axis=1)
        known &= np.isfinite(values).reshape(len(values), -1).all(axis=1)
        cells[name] = np.full(len(values), np.nan)
        if name in one.directions:
            axes = np.linalg.eigh(means[name][known])[1][:, :, 2]
            cells[name][known] = angles_between(one.directions[name].direction[known], axes)
        elif values.ndim == 3:
            difference = values[known] - means[name][known]
            cells[name][known] = np.abs(np.linalg.eigvalsh(difference)).max(axis=1, initial=0.0)
        else:
            cells[name][known] = np.abs(values[known] - means[name][known])
    return cells


def _judged(
    name: str, sheet: Sheet, errors: np.ndarray, area: np.ndarray, back: dict[str, np.ndarray]
) -> FieldError:
    known = np.isfinite(errors) & (area > 0.0)
    size = np.where(known, errors, 0.0)
    total = area[known].sum()
    changed = back.get(name, np.zeros(0))
    changed = changed[np.isfinite(changed)]
    if name in sheet.directions:
        units = "rad"
    elif name == PERMEABILITY:
        units = "m2"
    else:
        units = str(sheet.attributes.get(name, {}).get("units", "1"))
    return FieldError(
        units=units,
        worst=float(size.max(initial=0.0)),
        worst_cell=int(np.argmax(size)),
        root_mean_square=float(np.sqrt(area @ size**2 / total)) if total > 0.0 else 0.0,
        there_and_back_worst=float(changed.max()) if len(changed) else None,
        there_and_back=float(np.sqrt(np.mean(changed**2))) if len(changed) else None,
    )


# --- there and back -------------------------------------------------------------------------------


def _there_and_back(
    sheet: Sheet, target: TargetMesh, weights: MappingWeights, mapped: MappedFields, weigh: Weigh
) -> dict[str, np.ndarray]:
    """Changes on the faces that lie wholly over the target, not a number on others, shape (F,)."""
    there = weights.mapped
    if target.is_solid or not there.any():
        return {}
    permeability = None
    if mapped.axes and np.isfinite(mapped.scalars[PERMEABILITIES[0]][there]).all():
        permeability = PrincipalPermeability(
            np.stack([mapped.scalars[name][there] for name in PERMEABILITIES], axis=1),
            np.stack([mapped.axes[name][there] for name in PERMEABILITY_AXES], axis=1),
        )
    source = Sheet(
        Surface(target.points, target.surface.faces[there]),
        {n: values[there] for n, values in mapped.scalars.items() if n not in PERMEABILITIES},
        {name: family.direction[there] for name, family in mapped.directions.items()},
        permeability=permeability,
    )
    home, face = as_target(sheet.surface)
    back = weigh(source, home)
    returned = transfer(source, home, back)
    given = _given(sheet, face)
    found = _differences(returned, _comparable(given))
    whole = back.mapped & (back.coverage >= COVERED)
    return {name: np.where(whole, changed, np.nan) for name, changed in found.items()}


def _given(sheet: Sheet, face: np.ndarray) -> MappedFields:
    """Fields of the sheet in the form of mapped ones, in the order of the faces given."""
    scalars = {name: values[face] for name, values in sheet.scalars.items()}
    axes = {}
    if sheet.permeability is not None:
        for row, name in enumerate(PERMEABILITIES):
            scalars[name] = sheet.permeability.values[face, row]
        for row, name in enumerate(PERMEABILITY_AXES):
            axes[name] = sheet.permeability.axes[face, row]
    directions = {
        name: MappedDirections(vectors[face], np.ones(len(face)), np.zeros(len(face)))
        for name, vectors in sheet.directions.items()
    }
    return MappedFields(scalars, directions, axes)
