"""What every format takes and returns: fields of a target's cells, and the report of an export.

The report says what the format cannot hold, with the worst error that this causes.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from lcmchain.errors import InputError, first_few
from lcmchain.fields.ugrid import TIME
from lcmchain.mapping.fields import MappedFields
from lcmchain.mapping.sheet import FIBRE_FAMILIES, PERMEABILITIES, PERMEABILITY_AXES
from lcmchain.mapping.target import TargetMesh
from lcmchain.mapping.target.variables import cell_variables
from lcmchain.quantities.fields import FIELD_OF_VARIABLE

if TYPE_CHECKING:
    import xarray as xr


_COMPONENT = re.compile(r"(.+)_([xyz])")


@dataclass(frozen=True)
class MappedCells:
    """Fields on the cells of a target mesh.

    Parameters
    ----------
    scalars : by name, each of shape (C,); not a number where a cell is unmapped.
    vectors : by name, each of shape (C, 3).
    attributes : ``units`` and ``long_name`` of each variable that has them.
    provenance : what the mapped file says of its origin.
    time : of the saved state [s], if it is known.
    left_out : names of fields with more than one value per cell, such as those of plies.
    """

    target: TargetMesh
    scalars: Mapping[str, np.ndarray]
    vectors: Mapping[str, np.ndarray]
    attributes: Mapping[str, dict] = field(default_factory=dict)
    provenance: Mapping[str, object] = field(default_factory=dict)
    time: float | None = None
    left_out: tuple[str, ...] = ()

    @cached_property
    def mapped(self) -> np.ndarray:
        """Whether a cell has values, shape (C,)."""
        known = np.ones(self.target.cell_count, dtype=bool)
        for name in ("thickness", "areal_fibre_mass"):
            if name in self.scalars:
                known &= np.isfinite(self.scalars[name])
        return known

    @property
    def normals(self) -> np.ndarray:
        """Unit normals of shell cells, right-handed about their nodes, shape (C, 3)."""
        return self.target.surface.normals

    def scalar(self, name: str, wanted_by: str) -> np.ndarray:
        """Return a scalar field, shape (C,).

        Raises
        ------
        InputError : the mapped result does not have it.
        """
        return self._taken(self.scalars, name, wanted_by)

    def families(self, wanted_by: str, prefix: str = "") -> tuple[np.ndarray, ...]:
        """Return the directions of all fibre families, unit vectors of shape (C, 3).

        prefix : before the names of a ply's fields.

        Raises
        ------
        InputError : the mapped result has none, or of another one only some cells.
        """
        first, *others = (f"{prefix}{family}" for family in FIBRE_FAMILIES)
        further = [name for name in others if name in self.vectors]
        return tuple(self._taken(self.vectors, name, wanted_by) for name in (first, *further))

    def permeability(self, wanted_by: str) -> tuple[np.ndarray, np.ndarray]:
        """Return the two principal permeabilities in the plane [m2], (C, 2), and the larger's axis.

        Raises
        ------
        InputError : the mapped result has no permeability, or cells without it.
        """
        missing = [name for name in PERMEABILITIES[:2] if name not in self.scalars]
        if missing or PERMEABILITY_AXES[0] not in self.vectors:
            raise InputError(
                f"the export {wanted_by} needs the permeability and the mapped result has none: "
                "form with a [permeability] table",
                file=self.target.file,
            )
        values = np.stack([self.scalars[name] for name in PERMEABILITIES[:2]], axis=1)
        axis = self.vectors[PERMEABILITY_AXES[0]]
        self.require_whole(np.isfinite(values).all(axis=1), "no permeability", wanted_by)
        self.require_whole((values > 0.0).all(axis=1), "a permeability of zero", wanted_by)
        return values, axis

    def require_whole(self, sound: np.ndarray | np.bool, what: str, wanted_by: str) -> None:
        """Refuse a result in which cells lack something that the format has no hole for.

        Raises
        ------
        InputError : some cell is not sound, shape (C,).
        """
        bad = self.target.cell_ids[~sound]
        if len(bad):
            raise InputError(
                f"{len(bad)} cells have {what} ({first_few(bad)}) and the format {wanted_by} "
                "needs it in every cell; trim the target, or raise the maximum distance",
                file=self.target.file,
            )

    def require_shells(self, wanted_by: str) -> None:
        """Refuse a solid target.

        Raises
        ------
        InputError : the cells are solids.
        """
        if self.target.is_solid:
            raise InputError(
                f"the format {wanted_by} describes shells and the target has solid cells; map "
                "onto a mesh of triangles or quadrilaterals",
                file=self.target.file,
            )

    def _taken(self, fields: Mapping[str, np.ndarray], name: str, wanted_by: str) -> np.ndarray:
        if name not in fields:
            known = ", ".join([*self.scalars, *self.vectors]) or "nothing"
            raise InputError(
                f"the export {wanted_by} needs {name} and the mapped result does not have it "
                f"(it has {known})",
                file=self.target.file,
            )
        return fields[name]


def mapped_cells(mapped: xr.Dataset | MappedFields, target: TargetMesh) -> MappedCells:
    """Gather the fields of the cells from a mapped dataset, or from the fields themselves.

    The last one of several saved states is taken.

    Raises
    ------
    InputError : the fields lie on nodes, or belong to another mesh.
    """
    if isinstance(mapped, MappedFields):
        names = [*mapped.scalars, *(f"{stem}_x" for stem in mapped.vectors)]
        known = {name: FIELD_OF_VARIABLE[name] for name in names if name in FIELD_OF_VARIABLE}
        about = {
            name: {"units": field.units, "long_name": field.long_name}
            for name, field in known.items()
        }
        return MappedCells(target, mapped.scalars, mapped.vectors, about)
    if TIME in mapped.dims:
        mapped = mapped.isel({TIME: -1})
    place = "volume" if target.is_solid else "face"
    # Numbers, parts and sets of the cells are no fields: they come from the target.
    about_cells = cell_variables(target)
    own = {
        str(name): variable
        for name, variable in mapped.data_vars.items()
        if variable.attrs.get("location") == place
        and variable.dtype.kind in "fiu"
        and name not in about_cells
    }
    # How the cells were mapped is on them also where the fields are not.
    fields_of_cells = [name for name in own if not name.startswith("mapping_")]
    on_nodes = any(v.attrs.get("location") == "node" for v in mapped.data_vars.values())
    if not fields_of_cells and on_nodes:
        raise InputError(
            "the fields lie on the nodes and exports take those of cells; map onto cells",
            file=target.file,
        )
    numbers = mapped.get("cell_id")
    others = numbers is not None and not np.array_equal(numbers.values, target.cell_ids)
    if not own or others or any(v.shape[-1:] != (target.cell_count,) for v in own.values()):
        raise InputError(
            f"the mapped result is not one on this mesh of {target.cell_count} cells",
            file=target.file,
        )
    left_out = tuple(name for name, variable in own.items() if variable.ndim > 1)
    own = {name: variable for name, variable in own.items() if name not in left_out}
    scalars, vectors = _scalars_and_vectors(own)
    time = mapped.get(TIME)
    return MappedCells(
        target,
        scalars,
        vectors,
        {name: dict(variable.attrs) for name, variable in own.items()},
        dict(mapped.attrs),
        float(time) if time is not None and time.ndim == 0 else None,
        left_out,
    )


def _scalars_and_vectors(
    variables: Mapping[str, xr.DataArray],
) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray]]:
    """Variables by name; those that are three components of one become a vector."""
    stems: dict[str, int] = {}
    for name in variables:
        if match := _COMPONENT.fullmatch(name):
            stems[match[1]] = stems.get(match[1], 0) + 1
    vectors = {
        stem: np.stack([variables[f"{stem}_{axis}"].values for axis in "xyz"], axis=1)
        for stem, count in stems.items()
        if count == 3
    }
    in_vectors = {f"{stem}_{axis}" for stem in vectors for axis in "xyz"}
    scalars = {
        name: np.asarray(variable.values, dtype=float)
        for name, variable in variables.items()
        if name not in in_vectors
    }
    return scalars, vectors


def require_numbers(
    numbers: np.ndarray, what: str, file: Path | None, largest: int, misfit: str, form: str
) -> None:
    """Refuse numbers of cells or nodes that a format does not hold.

    Parameters
    ----------
    what : they are of, ``"cell"`` or ``"node"``. file : of the target. largest : that it holds.
    misfit : what is said of a number that is none of 1 to this. form : name of the format.

    Raises
    ------
    InputError : a number that it does not hold, or that stands for two.
    """
    bad = numbers[(numbers < 1) | (numbers > largest)]
    if len(bad):
        raise InputError(
            f"the {what} number {bad[0]} {misfit}; number the {what}s of the target from 1",
            file=file,
        )
    if len(np.unique(numbers)) != len(numbers):
        raise InputError(
            f"two {what}s of the target have the same number; {form} needs different ones",
            file=file,
        )


# --- what an export wrote, and what its format cannot hold ----------------------------------------


# Errors below these are told in the report only: they are far below those of any measurement.
NOTABLE = {"rad": np.radians(0.1), "m": 1e-5, "1": 1e-3}


@dataclass(frozen=True)
class Loss:
    """Something that a format cannot hold.

    Parameters
    ----------
    what : what is left out or taken otherwise, as the beginning of a sentence.
    error : largest error that this causes, in ``unit``; None where it has no number.
    unit : ``rad``, ``m`` or ``1`` (relative).
    cell : number of the cell with that error in the target's file, or of what ``place`` names.
    mean : mean over the area [unit], where it is known.
    place : ``cell`` or ``node``.
    """

    what: str
    error: float | None = None
    unit: str = "1"
    cell: int | None = None
    mean: float | None = None
    place: str = "cell"

    @property
    def notable(self) -> bool:
        """Whether the error is worth a warning; one without a number is."""
        return self.error is None or self.error >= NOTABLE[self.unit]

    def sentence(self) -> str:
        """Say it in one sentence, angles in degrees and shares in percent."""
        if self.error is None:
            return self.what
        mean = "" if self.mean is None else f" (mean {_shown(self.mean, self.unit)})"
        where = "" if self.cell is None else f" in {self.place} {self.cell}"
        return f"{self.what}: wrong by up to {_shown(self.error, self.unit)}{where}{mean}"


@dataclass
class ExportReport:
    """Result of one export; SI units, in the file as here.

    Parameters
    ----------
    format : name of the format, one of :data:`~lcmchain.mapping.formats.FORMATS`.
    files : names of the files that were written.
    cells : number of cells with values in them.
    losses : what the format cannot hold.
    notes : sentences on what the user has to add or to know.
    details : further numbers of the format, ready for JSON.
    """

    format: str
    files: list[str]
    cells: int
    losses: list[Loss] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    details: dict = field(default_factory=dict)

    @property
    def warnings(self) -> list[str]:
        """Sentences for the terminal and the report of the mapping: what is worth telling."""
        said = [loss.sentence() for loss in self.losses if loss.notable] + self.notes
        return [f"export {self.format}: {sentence}" for sentence in said]

    def as_dict(self) -> dict:
        """Plain values, ready for JSON."""
        return asdict(self)


#: Writes an export whose input has been found sound.
Saver = Callable[[], ExportReport]


def worst(
    what: str,
    error: np.ndarray,
    numbers: np.ndarray,
    *,
    unit: str,
    area: np.ndarray | None = None,
    place: str = "cell",
) -> Loss:
    """Loss with the largest of many errors, shape (C,); not-a-number counts for none.

    Parameters
    ----------
    numbers : number of each cell, or of what ``place`` names, in the target's file, shape (C,).
    area : of each cell [m2], for the mean, shape (C,).
    """
    size = np.where(np.isfinite(error), np.abs(error), -1.0)
    row = int(np.argmax(size))
    mean = None
    if area is not None:
        known = size >= 0.0
        mean = float(np.average(size[known], weights=area[known]))
    return Loss(what, max(float(size[row]), 0.0), unit, int(numbers[row]), mean, place)


def _shown(value: float, unit: str) -> str:
    if unit == "rad":
        return f"{np.degrees(value):.2g} degrees"
    return f"{100.0 * value:.2g} %" if unit == "1" else f"{value:.2g} {unit}"
