"""Several plies on one target: fields of each ply, and those of all of them together."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from lcmchain.errors import InputError
from lcmchain.fields.stack import REACH, StackedPly, faces_met
from lcmchain.mapping.averages import mean_over_cells
from lcmchain.mapping.bodies import present
from lcmchain.mapping.orientation import MappedDirections
from lcmchain.mapping.permeability import through_layers
from lcmchain.mapping.sheet import (
    PERMEABILITIES,
    PERMEABILITY_AXES,
    PrincipalPermeability,
    Sheet,
)
from lcmchain.mapping.solids.fields import ATTRIBUTES
from lcmchain.mapping.surface import Surface
from lcmchain.mapping.target import TargetMesh
from lcmchain.mapping.transfer import MappedFields, transfer
from lcmchain.mapping.weights import MappingWeights, Status, mesh_key

#: Share of a cell that one ply may have more than another one by rounding: the first one leads.
EVEN = 1e-9
#: What the share of a ply in the cells is called, before the name of the ply.
SHARE = "ply_share_"
#: What its place along the normal of a shell is called.
HEIGHT = "ply_height_"
#: Share of a ply's area that may lie beside the largest one without a word.
LEAST_BEYOND = 1e-3


def of_ply(sheet: Sheet, number: int) -> Sheet:
    """Return one ply as a sheet of its own, with the fields that it has."""
    faces = np.flatnonzero(sheet.plies == number)
    permeability = sheet.permeability
    if permeability is not None:
        permeability = PrincipalPermeability(permeability.values[faces], permeability.axes[faces])
        if np.isnan(permeability.values).all():
            permeability = None

    def own(fields):
        chosen = {name: values[faces] for name, values in fields.items()}
        return {name: values for name, values in chosen.items() if not np.isnan(values).all()}

    return replace(
        sheet,
        surface=Surface(sheet.surface.points, sheet.surface.faces[faces]),
        scalars=own(sheet.scalars),
        directions=own(sheet.directions),
        permeability=permeability,
        ply=None,
        ply_names=(),
    )


def weights_of_plies(sheet: Sheet, compute: Callable[[Sheet], MappingWeights]) -> MappingWeights:
    """Join the weights of plies that are mapped one by one, as onto a surface.

    A ply's share in the average of a cell is that of its thickness.

    compute : weights of a sheet with one ply.
    """
    plies = [of_ply(sheet, number) for number in range(len(sheet.ply_names))]
    each = [compute(ply) for ply in plies]
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
    for own, weights in zip(faces, each):
        face_coverage[own] = weights.face_coverage
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
        wedge_correction=max(weights.wedge_correction for weights in each),
        moved=max(weights.moved for weights in each),
        maximum_distance=max(weights.maximum_distance for weights in each),
        source_key=mesh_key(sheet.surface.points, sheet.surface.faces),
        ply_coverage=coverage,
    )


def transfer_plies(sheet: Sheet, target: TargetMesh, weights: MappingWeights) -> MappedFields:
    """Carry the fields of several plies to the target.

    Every field of a ply has the ply's name before its own, and so have all of its values: a cell
    without the ply has none. ``ply_share_NAME`` is the share of the cell that a ply has: of its
    volume, or of a shell's thickness. ``ply_height_NAME`` is how far the ply's mid-surface lies
    from a shell along its normal, which tells the order of the plies there. Thickness, areal mass
    and fibre volume fraction without a name are those of all plies, and the permeability is that
    of the layers that they make; any other field without a name is that of the ply with the
    largest share, of several the first.
    """
    names = sheet.ply_names
    shares = _shares(sheet, weights)
    plies = [of_ply(sheet, number) for number in range(len(names))]
    own = [_weights_of(sheet, weights, number, shares) for number in range(len(names))]
    each = [transfer(ply, target, ply_weights) for ply, ply_weights in zip(plies, own)]
    leading = np.argmax(shares >= shares.max(axis=0) - EVEN, axis=0)
    scalars = _leading([mapped.scalars for mapped in each], leading)
    scalars |= _totals(weights, own, each, shares)
    axes = _leading([mapped.axes for mapped in each], leading)
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
        for name, ply, ply_weights in zip(names, plies, own):
            scalars[f"{HEIGHT}{name}"] = _heights(ply, target, ply_weights)
    return replace(each[0], scalars=scalars, directions=directions, axes=axes)


def described(sheet: Sheet, variable: str) -> dict[str, Any]:
    """Attributes of a field of a mapping: unit, name and definition."""
    known = ATTRIBUTES | {key: dict(about) for key, about in sheet.attributes.items()}
    if variable in known or not sheet.is_stack:
        return known.get(variable, {})
    for name in sorted(sheet.ply_names, key=len, reverse=True):
        if variable == f"{SHARE}{name}":
            text = f"share of the cell that the ply {name} has"
            return {"units": "1", "long_name": text, "comment": "of a shell, of its thickness"}
        if variable == f"{HEIGHT}{name}":
            text = f"place of the mid-surface of the ply {name} along the normal of the cell"
            return {"units": "m", "long_name": text, "comment": "from the cell's own plane"}
        about = known.get(variable.removeprefix(f"{name}_"))
        if variable.startswith(f"{name}_") and about is not None:
            return about | {"long_name": f"{about.get('long_name', variable)}, ply {name}"}
    return {}


def on_faces_of_one(sheet: Sheet) -> tuple[Sheet, tuple[str, ...]]:
    """Return a stack as one sheet, on the faces of its largest ply, and what a user should know.

    At every face count the layers that its normal meets, itself among them
    (:mod:`lcmchain.fields.stack`). Fields have the names of :func:`transfer_plies`.

    Raises
    ------
    InputError : a ply has no thickness.
    """
    names = sheet.ply_names
    plies = [of_ply(sheet, number) for number in range(len(names))]
    for name, ply in zip(names, plies, strict=True):
        if "thickness" not in ply.scalars:
            raise InputError(
                f'the ply "{name}" has no thickness; form it with element = "solid-shell"',
                file=sheet.name,
            )
    stacked = [_stacked(ply) for ply in plies]
    reach = REACH * sum(float(ply.scalars["thickness"].max()) for ply in plies)
    base = int(np.argmax([ply.surface.areas.sum() for ply in plies]))
    own = plies[base].surface
    met = [
        np.arange(own.face_count) if other is stacked[base]
        else faces_met(stacked[base], other, 0, reach)
        for other in stacked
    ]  # fmt: skip
    there = np.stack([faces >= 0 for faces in met])

    def gathered(fields):
        return [
            {name: _at(values, faces) for name, values in fields(ply).items()}
            for ply, faces in zip(plies, met, strict=True)
        ]

    each, vectors = gathered(lambda ply: ply.scalars), gathered(lambda ply: ply.directions)
    thickness = np.where(there, np.stack([fields["thickness"] for fields in each]), 0.0)
    shares = thickness / thickness.sum(axis=0)
    leading = np.argmax(shares >= shares.max(axis=0) - EVEN, axis=0)
    scalars, directions = _leading(each, leading), _leading(vectors, leading)
    scalars["thickness"] = thickness.sum(axis=0)
    for name, part in (("areal_fibre_mass", there), ("fibre_volume_fraction", shares)):
        if all(name in fields for fields in each):
            values = np.stack([fields[name] for fields in each])
            scalars[name] = np.where(there, part * values, 0.0).sum(axis=0)
    permeability = None
    if sheet.permeability is not None:
        unknown = PrincipalPermeability(np.full((1, 3), np.nan), np.full((1, 3, 3), np.nan))
        layers = [
            PrincipalPermeability(*(_at(values, faces) for values in ply.permeability))
            if ply.permeability is not None
            else PrincipalPermeability(*(_at(values, 0 * faces) for values in unknown))
            for ply, faces in zip(plies, met, strict=True)
        ]
        permeability = through_layers(thickness, layers, own.normals)
    for name, fields, found, share in zip(names, each, vectors, shares, strict=True):
        scalars |= {f"{name}_{key}": values for key, values in fields.items()}
        directions |= {f"{name}_{key}": values for key, values in found.items()}
        scalars[f"{SHARE}{name}"] = share
    variables = [*scalars, *(f"{stem}_{axis}" for stem in directions for axis in "xyz")]
    one = replace(
        sheet, surface=own, scalars=scalars, directions=directions, permeability=permeability,
        attributes={name: described(sheet, name) for name in variables} | dict(sheet.attributes),
        ply=None, ply_names=(),
    )  # fmt: skip
    return one, tuple(_beyond(names, stacked, plies, base, reach))


def _stacked(ply: Sheet) -> StackedPly:
    """Return what columns need of a ply."""
    faces, thickness = ply.surface.faces, ply.scalars["thickness"]
    last = np.where(faces[:, 3] < 0, faces[:, 2], faces[:, 3])
    return StackedPly(
        np.column_stack([faces[:, :3], last]),
        ply.surface.points[None],
        thickness[None],
        float(thickness.max()),
        np.ones((1, len(faces))),
        None,
    )


def _at(values: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Return values at faces, not a number where there is none (-1)."""
    return np.where((faces >= 0).reshape(-1, *[1] * (values.ndim - 1)), values[faces], np.nan)


def _beyond(
    names: tuple[str, ...],
    stacked: list[StackedPly],
    plies: list[Sheet],
    base: int,
    reach: float,
) -> Iterator[str]:
    """Say of each ply what of it lies beside the one whose faces are taken."""
    for name, other, ply in zip(names, stacked, plies, strict=True):
        if other is stacked[base]:
            continue
        areas = ply.surface.areas
        share = areas[faces_met(other, stacked[base], 0, reach) < 0].sum() / areas.sum()
        if share > LEAST_BEYOND:
            yield (
                f'{100.0 * share:.2g} % of the ply "{name}" lie beside "{names[base]}", the '
                "largest ply, on whose faces the stack is taken: they are left out; map onto a "
                "mesh of the part (--mesh) to have them"
            )


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


def _shares(sheet: Sheet, weights: MappingWeights) -> np.ndarray:
    """Share of each cell that every ply has, shape (P, C)."""
    count = len(sheet.ply_names)
    key = sheet.plies[weights.face] * weights.cell_count + weights.cell
    shares = np.bincount(key, weights=weights.average, minlength=count * weights.cell_count)
    return shares.reshape(count, weights.cell_count)


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


def _thickness(ply: Sheet, weights: MappingWeights) -> np.ndarray:
    """Mean thickness of a ply over each cell [m], or one where it is not known, shape (C,)."""
    if "thickness" not in ply.scalars:
        return np.ones(weights.cell_count)
    return np.nan_to_num(mean_over_cells(ply.surface, weights, ply.scalars["thickness"]))


def _heights(ply: Sheet, target: TargetMesh, weights: MappingWeights) -> np.ndarray:
    """Distance of a ply's mid-surface from each cell along the normal of the cell [m], (C,)."""
    places = [mean_over_cells(ply.surface, weights, x) for x in ply.surface.centroids.T]
    away = np.stack(places, axis=1) - target.surface.centroids
    return np.einsum("ci,ci->c", away, target.surface.normals)


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
    found = {"solid_thickness": solid} if "thickness" in names else {}
    if "thickness" in names:
        found["thickness"] = np.where(weights.mapped, weights.formed_thickness, np.nan)
        found["thickness_difference"] = solid / found["thickness"] - 1.0
    held = np.stack([ply_weights.mapped for ply_weights in own])
    areas = np.stack([ply_weights.cell_area for ply_weights in own]) / weights.cell_area
    for name, part in (("areal_fibre_mass", areas), ("fibre_volume_fraction", shares)):
        if name in names:
            values = np.stack([mapped.scalars[name] for mapped in each])
            total = np.where(held, part * values, 0.0).sum(axis=0)
            found[name] = np.where(weights.mapped, total, np.nan)
    return found


def _leading(each: list[dict[str, np.ndarray]], leading: np.ndarray) -> dict[str, np.ndarray]:
    """Values of the ply that leads in each cell, of the fields that any ply has."""
    found = {}
    for name in dict.fromkeys(name for fields in each for name in fields):
        shape = next(fields[name] for fields in each if name in fields).shape
        stacked = np.stack([fields.get(name, np.full(shape, np.nan)) for fields in each])
        found[name] = stacked[leading, np.arange(len(leading))]
    return found


def _leading_directions(
    each: list[dict[str, MappedDirections]], leading: np.ndarray
) -> dict[str, MappedDirections]:
    parts = [
        _leading([{name: found[k] for name, found in fields.items()} for fields in each], leading)
        for k in range(len(MappedDirections._fields))
    ]
    return {name: MappedDirections(*(part[name] for part in parts)) for name in parts[0]}
