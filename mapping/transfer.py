"""A sheet onto a target: the weights between the two, and all fields, of one ply or of several.

The plies of a stack are mapped one by one onto the cells of a surface, and together onto solid
cells, where they share the thickness. Fields of the stack follow from those of its plies.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from lcmchain.errors import InputError
from lcmchain.mapping.fields import MappedFields, carried, facing, heights
from lcmchain.mapping.plies import EVEN, each_ply, leading_values, of_ply
from lcmchain.mapping.sheet import (
    HEIGHT,
    ORDER,
    PERMEABILITIES,
    PERMEABILITY_AXES,
    SHARE,
    PrincipalPermeability,
    Sheet,
)
from lcmchain.mapping.solids.weights import compute_solid_weights
from lcmchain.mapping.surfaces.averages import MappedDirections, mean_over_cells, through_layers
from lcmchain.mapping.surfaces.pairing import surface_weights
from lcmchain.mapping.target import TargetMesh
from lcmchain.mapping.weights import MappingWeights, Status, mesh_key, present

METHODS = ("overlap", "closest")

# Highest order of the fields within a face: 1 takes them as constant, 2 as linear.
ORDERS = (1, 2)


def compute_weights(
    sheet: Sheet,
    target: TargetMesh,
    *,
    method: str = "overlap",
    order: int = 2,
    maximum_distance: float | None = None,
) -> MappingWeights:
    """Compute the weights that carry face fields of a sheet to the cells of a target.

    Parameters
    ----------
    method : ``"overlap"`` averages over the part of the sheet that lies over the cell, measured
        on the cell's tangent plane; ``"closest"`` takes the place closest to the cell's centroid.
    order : 1 takes a field as constant within each face, 2 as linear.
    maximum_distance : how far [m] from the sheet a cell may lie; by default one edge length of
        the sheet, or the radius of a typical cell where that is larger.

    Raises
    ------
    InputError : unknown method or order, or a distance that is not positive.
    """
    if method not in METHODS:
        raise InputError(f'"{method}" is no mapping method; write one of {", ".join(METHODS)}')
    if order not in ORDERS:
        raise InputError(f"the order of a mapping is 1 or 2, not {order}")
    if target.is_solid and method == "overlap":
        return compute_solid_weights(sheet, target, order=order, maximum_distance=maximum_distance)
    plies = each_ply(sheet) if sheet.is_stack else [sheet]
    each = [
        surface_weights(ply, target, method=method, order=order, maximum_distance=maximum_distance)
        for ply in plies
    ]
    return _joined(sheet, plies, each) if sheet.is_stack else each[0]


def transfer(sheet: Sheet, target: TargetMesh, weights: MappingWeights) -> MappedFields:
    """Carry every field of the sheet to the target.

    The fibre volume fraction is that of the mapped fibre mass in the mapped thickness.
    """
    if sheet.is_stack:
        return _of_stack(sheet, target, weights)
    return carried(sheet, weights, _planes(target))


def _planes(target: TargetMesh) -> tuple[np.ndarray, np.ndarray] | None:
    """Centres [m] and unit normals of the cells, (C, 3) each; None of solids."""
    return None if target.is_solid else (target.surface.centroids, target.surface.normals)


# --- weights of plies -----------------------------------------------------------------------------


def _joined(sheet: Sheet, plies: list[Sheet], each: list[MappingWeights]) -> MappingWeights:
    """Join the weights of plies that were mapped one by one, as onto a surface.

    A ply's share in the average of a cell is that of its thickness.

    each : weights of each ply.
    """
    coverage = np.stack([weights.coverage for weights in each])
    mapped = np.stack([weights.mapped for weights in each])
    thickness = np.stack([_thickness(ply, weights) for ply, weights in zip(plies, each)])
    share = np.where(mapped, thickness * present(coverage), 0.0)
    share = share / np.where(share.sum(axis=0) > 0.0, share.sum(axis=0), 1.0)
    faces = [np.flatnonzero(sheet.plies == number) for number in range(len(plies))]
    cell = np.concatenate([weights.cell for weights in each])
    face = np.concatenate([own[weights.face] for own, weights in zip(faces, each)])
    average = [part[weights.cell] * weights.average for part, weights in zip(share, each)]
    content = [weights.content for weights in each]
    place = [weights.place for weights in each]
    order = np.lexsort((face, cell))
    face_coverage = np.zeros(sheet.surface.face_count)
    missed = np.zeros(sheet.surface.face_count, dtype=bool)
    for own, weights in zip(faces, each):
        face_coverage[own], missed[own] = weights.face_coverage, weights.missed
    status = np.stack([weights.status for weights in each])
    undecided = (status == Status.AMBIGUOUS).any(axis=0)
    distance = np.where(mapped, np.stack([weights.distance for weights in each]), np.inf)
    nearest = distance.min(axis=0)
    return replace(
        each[0],
        cell=cell[order],
        face=face[order],
        average=np.concatenate(average)[order],
        content=np.concatenate(content)[order],
        place=np.concatenate(place)[order],
        status=np.where(undecided, Status.AMBIGUOUS, status.min(axis=0)).astype(np.int8),
        coverage=coverage.max(axis=0),
        distance=np.where(np.isfinite(nearest), nearest, np.nan),
        face_coverage=face_coverage,
        missed=missed,
        wedge_correction=max(weights.wedge_correction for weights in each),
        moved=max(weights.moved for weights in each),
        maximum_distance=max(weights.maximum_distance for weights in each),
        source_key=mesh_key(sheet.surface.points, sheet.surface.faces),
        ply_coverage=coverage,
    )


def _weights_of(
    sheet: Sheet, weights: MappingWeights, number: int, shares: np.ndarray
) -> MappingWeights:
    """Weights of one ply, as if it were alone."""
    faces = np.flatnonzero(sheet.plies == number)
    local = np.full(sheet.surface.face_count, -1, dtype=np.int64)
    local[faces] = np.arange(len(faces))
    chosen = sheet.plies[weights.face] == number
    cell = weights.cell[chosen]
    # faces that lie too far off to be mapped have no share, though they are listed
    held = (np.bincount(cell, minlength=weights.cell_count) > 0) & (shares[number] > 0.0)
    share = np.where(held, shares[number], 1.0)
    own = replace(
        weights,
        cell=cell,
        face=local[weights.face[chosen]],
        average=weights.average[chosen] / share[cell],
        content=weights.content[chosen],
        place=weights.place[chosen],
        status=np.where(held, weights.status, Status.UNMAPPED).astype(np.int8),
        coverage=weights.ply_coverage[number],
        distance=np.where(held, weights.distance, np.nan),
        face_coverage=weights.face_coverage[faces],
        ply_coverage=np.zeros((0, 0)),
    )
    if not len(weights.solid_thickness):
        return own
    # of the solid the ply has its share of the volume, and its part of the thickness
    ply, parts = of_ply(sheet, number), present(weights.ply_coverage)[number]
    part = _thickness(ply, own) * parts / weights.formed_thickness
    solid = np.where(held, weights.solid_thickness * part, np.nan)
    volume = weights.cell_area * weights.solid_thickness * share
    return replace(own, solid_thickness=solid, cell_area=volume / np.where(held, solid, 1.0))


def _shares(sheet: Sheet, weights: MappingWeights) -> np.ndarray:
    """Share of each cell that every ply has, shape (P, C)."""
    count = len(sheet.ply_names)
    key = sheet.plies[weights.face] * weights.cell_count + weights.cell
    shares = np.bincount(key, weights=weights.average, minlength=count * weights.cell_count)
    return shares.reshape(count, weights.cell_count)


def _thickness(ply: Sheet, weights: MappingWeights) -> np.ndarray:
    """Mean thickness of a ply over each cell [m], or one where it is not known, shape (C,)."""
    if "thickness" not in ply.scalars:
        return np.ones(weights.cell_count)
    return np.nan_to_num(mean_over_cells(ply.surface, weights, ply.scalars["thickness"]))


# --- fields of plies ------------------------------------------------------------------------------


def _of_stack(sheet: Sheet, target: TargetMesh, weights: MappingWeights) -> MappedFields:
    """Carry the fields of several plies to the target.

    Every field of a ply has the ply's name before its own, and so have all of its values: a cell
    without the ply has none. ``ply_share_NAME`` is the share of the cell that a ply has: of its
    volume, or of a shell's thickness. ``ply_height_NAME`` is how far the ply's mid-surface lies
    from a shell along its normal, which tells the order of the plies there; ``ply_order`` tells
    which way they go, also where one ply alone is left. Without the name of a ply, thickness, areal
    mass and fibre volume fraction are those of all plies, and the permeability is that of the
    layers together. Any other field without such a name is that of the ply with the largest share,
    the first one where shares are equal.
    """
    names = sheet.ply_names
    shares = _shares(sheet, weights)
    plies = each_ply(sheet)
    own = [_weights_of(sheet, weights, number, shares) for number in range(len(names))]
    each = [carried(ply, ply_weights, _planes(target)) for ply, ply_weights in zip(plies, own)]
    leading = np.argmax(shares >= shares.max(axis=0) - EVEN, axis=0)
    scalars = leading_values([mapped.scalars for mapped in each], leading)
    scalars |= _totals(weights, own, each, shares)
    axes = leading_values([mapped.axes for mapped in each], leading)
    directions = _leading_directions([mapped.directions for mapped in each], leading)
    if sheet.permeability is not None:
        found = _permeability(
            [(mapped.scalars, mapped.axes) for mapped in each],
            np.where(weights.mapped, shares, 0.0),
            axes[PERMEABILITY_AXES[2]] if target.is_solid else target.surface.normals,
        )
        scalars |= dict(zip(PERMEABILITIES, found.values.T.copy(), strict=True))
        axes |= {name: found.axes[:, row].copy() for row, name in enumerate(PERMEABILITY_AXES)}
    for name, mapped, share in zip(names, each, shares):
        scalars |= {f"{name}_{key}": values for key, values in mapped.scalars.items()}
        axes |= {f"{name}_{key}": values for key, values in mapped.axes.items()}
        directions |= {f"{name}_{key}": found for key, found in mapped.directions.items()}
        scalars[f"{SHARE}{name}"] = np.where(weights.mapped, share, np.nan)
    if not target.is_solid:
        centres, normals = target.surface.centroids, target.surface.normals
        for name, ply, ply_weights in zip(names, plies, own):
            scalars[f"{HEIGHT}{name}"] = heights(ply, ply_weights, centres, normals)
        side = facing(sheet, weights, normals)
        scalars[ORDER] = np.where(weights.mapped, side, np.nan)
    return replace(each[0], scalars=scalars, directions=directions, axes=axes)


def _totals(
    weights: MappingWeights,
    own: list[MappingWeights],
    each: list[MappedFields],
    shares: np.ndarray,
) -> dict[str, np.ndarray]:
    """Thickness, areal mass and fibre volume fraction of all plies together, each (C,)."""
    parts = present(weights.ply_coverage)

    def summed(values: list[np.ndarray]) -> np.ndarray:
        total = np.zeros(weights.cell_count)
        for part, ply_weights, found in zip(parts, own, values):
            total += np.where(ply_weights.mapped, part * found, 0.0)
        return np.where(weights.mapped, total, np.nan)

    common = set.intersection(*(set(mapped.scalars) for mapped in each))
    names = {"thickness", "areal_fibre_mass", "fibre_volume_fraction"} & common
    totals = {
        name: summed([mapped.scalars[name] for mapped in each])
        for name in sorted(names - {"fibre_volume_fraction"})
    }
    if len(weights.solid_thickness):
        return totals | _totals_of_solids(weights, own, each, shares, names)
    if {"thickness", "fibre_volume_fraction"} <= names:
        volume = summed([m.scalars["thickness"] * m.scalars["fibre_volume_fraction"] for m in each])
        totals["fibre_volume_fraction"] = volume / totals["thickness"]
    return totals


def _totals_of_solids(
    weights: MappingWeights,
    own: list[MappingWeights],
    each: list[MappedFields],
    shares: np.ndarray,
    names: set[str],
) -> dict[str, np.ndarray]:
    """Totals of solid cells: of masses by the cell's area, of fibre volumes by its volume."""
    solid = np.where(weights.mapped, weights.solid_thickness, np.nan)
    totals = {"solid_thickness": solid} if "thickness" in names else {}
    if "thickness" in names:
        totals["thickness"] = np.where(weights.mapped, weights.formed_thickness, np.nan)
        totals["thickness_difference"] = solid / totals["thickness"] - 1.0
    held = np.stack([ply_weights.mapped for ply_weights in own])
    areas = np.stack([ply_weights.cell_area for ply_weights in own]) / weights.cell_area
    for name, part in (("areal_fibre_mass", areas), ("fibre_volume_fraction", shares)):
        if name in names:
            values = np.stack([mapped.scalars[name] for mapped in each])
            total = np.where(held, part * values, 0.0).sum(axis=0)
            totals[name] = np.where(weights.mapped, total, np.nan)
    return totals


def _leading_directions(
    each: list[dict[str, MappedDirections]], leading: np.ndarray
) -> dict[str, MappedDirections]:
    parts = [
        leading_values(
            [{name: found[k] for name, found in fields.items()} for fields in each], leading
        )
        for k in range(len(MappedDirections._fields))
    ]
    return {name: MappedDirections(*(part[name] for part in parts)) for name in parts[0]}


def _permeability(
    each: list[tuple[dict[str, np.ndarray], dict[str, np.ndarray]]],
    shares: np.ndarray,
    normals: np.ndarray,
) -> PrincipalPermeability:
    """Return the permeability of all plies together, from the values and axes of each."""
    count = len(normals)
    layers = []
    for scalars, axes in each:
        if PERMEABILITIES[0] not in scalars:
            layers.append(
                PrincipalPermeability(np.full((count, 3), np.nan), np.full((count, 3, 3), np.nan))
            )
            continue
        layers.append(
            PrincipalPermeability(
                np.stack([scalars[name] for name in PERMEABILITIES], axis=1),
                np.stack([axes[name] for name in PERMEABILITY_AXES], axis=1),
            )
        )
    return through_layers(shares, layers, normals)
