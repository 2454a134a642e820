"""Plies of a stack: each as a sheet of its own, and all as one, on the faces of the largest."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from lcmchain.errors import InputError
from lcmchain.fields.stack import REACH, StackedPly, faces_met
from lcmchain.mapping.fields import ATTRIBUTES
from lcmchain.mapping.sheet import HEIGHT, ORDER, SHARE, PrincipalPermeability, Sheet
from lcmchain.mapping.surfaces.averages import through_layers
from lcmchain.mapping.surfaces.search import closest_points
from lcmchain.mapping.surfaces.surface import Surface
from lcmchain.mapping.weights import MappingWeights

#: Share of a cell that one ply may have more than another one by rounding: the first one leads.
EVEN = 1e-9
#: Share of a ply's area that may lie beside the largest one without a word.
LEAST_BEYOND = 1e-3
#: Share of a face from which on it counts as mapped, and part of the maximum distance from which
#: on plies count as apart.
HALF = 0.5


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


def each_ply(sheet: Sheet) -> list[Sheet]:
    """Return every ply of a stack as a sheet of its own; none for a single sheet."""
    return [of_ply(sheet, number) for number in range(len(sheet.ply_names))]


def described(sheet: Sheet, variable: str) -> dict[str, Any]:
    """Attributes of a field of a mapping: unit, name and definition."""
    known = ATTRIBUTES | {key: dict(about) for key, about in sheet.attributes.items()}
    if variable in known or not sheet.is_stack:
        return known.get(variable, {})
    if variable == ORDER:
        text = "1 where the plies lie from first to last along the normal of the cell, else -1"
        return {"units": "1", "long_name": text, "comment": "also where one ply alone is left"}
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
    plies = each_ply(sheet)
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
    scalars, directions = leading_values(each, leading), leading_values(vectors, leading)
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


def too_far_off(sheet: Sheet, target: Surface, weights: MappingWeights) -> Iterator[str]:
    """Say of each ply of a stack where it lies too far off a shell that has the ply beside it.

    A ply that ends is no loss, nor is what lies beside a trimmed target. One that stands off the
    others may lie beyond the maximum distance, straight up or at a slant.
    """
    plies, covered = each_ply(sheet), weights.face_coverage >= HALF
    if covered.all():
        return
    stacked = [_stacked(ply) for ply in plies]
    numbers = [np.flatnonzero(sheet.plies == number) for number in range(len(plies))]
    beside = np.full(len(covered), -1)  # the face that the column of each face meets first
    lost = np.zeros(len(covered), dtype=bool)
    for k, (ply, own) in enumerate(zip(plies, numbers, strict=True)):
        centres = ply.surface.centroids
        nearest = np.full(len(own), np.inf)
        for j in [j for j in range(len(plies)) if j != k]:
            met = faces_met(stacked[k], stacked[j], 0, np.inf)
            away = np.linalg.norm(plies[j].surface.centroids[met] - centres, axis=1)
            nearer = (met >= 0) & (away < nearest)
            nearest[nearer], beside[own[nearer]] = away[nearer], numbers[j][met[nearer]]
        beyond = closest_points(target, centres, weights.maximum_distance).face < 0
        lost[own] = beyond | (nearest > HALF * weights.maximum_distance)
    lost &= ~covered & (beside >= 0)
    held = covered
    for _ in plies:  # the ply beside may be lost itself, for the same reason
        held = covered | (lost & held[beside])
    for name, ply, own in zip(sheet.ply_names, plies, numbers, strict=True):
        gone = lost[own] & held[own]
        share = ply.surface.areas[gone].sum() / ply.surface.areas.sum()
        if share > LEAST_BEYOND:
            yield (
                f'{100.0 * share:.2g} % of the ply "{name}" stand too far off the target (farthest '
                f"{1e3 * weights.maximum_distance:.3g} mm), which has the ply beside it: their "
                "fibres are missing; raise maximum_distance to have them"
            )


def _stacked(ply: Sheet) -> StackedPly:
    """Return what columns need of a ply."""
    faces = ply.surface.faces
    thickness = ply.scalars.get("thickness", np.ones(len(faces)))
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


def leading_values(each: list[dict[str, np.ndarray]], leading: np.ndarray) -> dict[str, np.ndarray]:
    """Values of the ply that leads in each cell, of the fields that any ply has."""
    chosen = {}
    for name in dict.fromkeys(name for fields in each for name in fields):
        shape = next(fields[name] for fields in each if name in fields).shape
        stacked = np.stack([fields.get(name, np.full(shape, np.nan)) for fields in each])
        chosen[name] = stacked[leading, np.arange(len(leading))]
    return chosen
