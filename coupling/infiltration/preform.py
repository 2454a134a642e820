"""Preform: thickness, porosity and permeability of every cell of a flow mesh."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from lcmchain.errors import InputError

if TYPE_CHECKING:
    import xarray as xr

#: Factor on the permeability (C,) from the fibre volume fractions (C,) now and in the beginning.
PermeabilityFactor = Callable[[np.ndarray, np.ndarray], np.ndarray]


def kozeny_factor(now: np.ndarray, before: np.ndarray) -> np.ndarray:
    """Factor on the permeability after Kozeny and Carman, (1 - v)³ / v² now over that before."""
    return ((1.0 - now) / (1.0 - before)) ** 3 * (before / now) ** 2


@dataclass(frozen=True)
class Preform:
    """Material of the cells of a flow mesh.

    Parameters
    ----------
    thickness : [m], shape (C,) or one number.
    porosity : share of the volume that resin can fill, between 0 and 1, shape (C,) or one number.
    permeability : [m2], symmetric tensors in space, shape (C, 3, 3); (3, 3) for all cells, or one
        number for an isotropic preform. Its part in the plane of the cell counts.
    through_permeability : permeability through the thickness [m2], shape (C,) or one number; None
        where nothing flows through the thickness.
    factor : how the permeability follows the fibre volume fraction of a preform that is
        compacted, see :data:`PermeabilityFactor`.

    Raises
    ------
    InputError : a thickness or permeability that is not positive, a porosity outside 0 to 1; the
        message names the first cells.
    """

    thickness: np.ndarray
    porosity: np.ndarray
    permeability: np.ndarray
    through_permeability: np.ndarray | None = None
    factor: PermeabilityFactor = kozeny_factor

    def __post_init__(self) -> None:
        given = [self.thickness, self.porosity, self.through_permeability]
        tensor = np.asarray(self.permeability, dtype=float)
        if tensor.ndim == 0:
            tensor = tensor * np.eye(3)
        count = max(
            [1 if value is None else np.size(value) for value in given]
            + [len(tensor) if tensor.ndim == 3 else 1]
        )
        tensor = np.array(np.broadcast_to(tensor, (count, 3, 3)))
        thickness, porosity, through = (
            None if value is None else np.array(np.broadcast_to(value, (count,)), dtype=float)
            for value in given
        )
        made = {
            "thickness": thickness, "porosity": porosity, "permeability": tensor,
            "through_permeability": through,
        }  # fmt: skip
        for name, value in made.items():
            object.__setattr__(self, name, value)
        self._check()

    def _check(self) -> None:
        _refuse("thickness", self.thickness, ~(self.thickness > 0.0), "it has to be positive")
        _refuse(
            "porosity", self.porosity, ~((self.porosity > 0.0) & (self.porosity < 1.0)),
            "it lies between 0 and 1 (neither included); a fibre volume fraction of 1 or more "
            "leaves the resin no room",
        )  # fmt: skip
        tensor = self.permeability
        size = np.abs(tensor).max(axis=(1, 2))
        skew = np.abs(tensor - tensor.transpose(0, 2, 1)).max(axis=(1, 2))
        _refuse("permeability", skew, ~(skew <= 1e-9 * size), "the tensor has to be symmetric")
        least = np.linalg.eigvalsh(np.where(np.isfinite(tensor), tensor, -1.0))
        # In the plane two values count; the third may be 0 where nothing is known through it.
        _refuse(
            "permeability", least[:, 1], ~(least[:, 1] > 0.0) | (least[:, 0] < -1e-9 * size),
            "principal permeabilities in the plane have to be positive",
        )  # fmt: skip
        if self.through_permeability is not None:
            through = self.through_permeability
            _refuse("through_permeability", through, ~(through > 0.0), "it has to be positive")

    def of_cells(self, count: int) -> Preform:
        """Return this preform with values for each of so many cells.

        Raises
        ------
        InputError : it has values for another number of cells.
        """
        if len(self.thickness) == count:
            return self
        if len(self.thickness) != 1:
            raise InputError(
                f"the preform has values for {len(self.thickness)} cells, the mesh has {count}"
            )
        through = self.through_permeability
        return Preform(
            np.full(count, self.thickness[0]), np.full(count, self.porosity[0]),
            np.repeat(self.permeability, count, axis=0),
            None if through is None else np.full(count, through[0]), self.factor,
        )  # fmt: skip

    @classmethod
    def from_principal(
        cls,
        thickness: np.ndarray,
        porosity: np.ndarray,
        values: np.ndarray,
        axes: np.ndarray,
        **others: Any,
    ) -> Preform:
        """Return a preform from principal permeabilities and their axes in the plane.

        Parameters
        ----------
        values : principal permeabilities [m2], shape (C, 2) or (C, 3); a third one is that
            through the thickness.
        axes : unit vectors, shape (C, 2, 3) or (C, 3, 3); their sign has no meaning.
        """
        values, axes = np.asarray(values, dtype=float), np.asarray(axes, dtype=float)
        tensor = np.einsum("cm,cmi,cmj->cij", values[:, :2], axes[:, :2], axes[:, :2])
        if values.shape[1] > 2:
            others.setdefault("through_permeability", values[:, 2])
        return cls(thickness, porosity, tensor, **others)

    @classmethod
    def from_mapped(cls, mapped: xr.Dataset, *, frame: int = -1, **others: Any) -> Preform:
        """Return the preform that a mapping wrote: thickness, fibre content, permeability.

        Parameters
        ----------
        mapped : dataset with ``thickness``, ``fibre_volume_fraction``, ``permeability_1`` to
            ``_3`` and the vectors ``permeability_direction_1_x`` and so on, one value per face.
        frame : of datasets with a dimension ``time``, the saved state to take.

        Raises
        ------
        InputError : a variable is missing (the message says which), a cell has no value.
        """
        needed = ["thickness", "fibre_volume_fraction", "permeability_1", "permeability_2"]
        needed += [f"permeability_direction_{m}_{axis}" for m in (1, 2) for axis in "xyz"]
        missing = [name for name in needed if name not in mapped]
        if missing:
            raise InputError(
                f"the mapped result lacks {', '.join(missing)}; give the scene a table "
                "[permeability] and map again"
            )

        def values(name: str) -> np.ndarray:
            array = mapped[name]
            return np.asarray((array.isel(time=frame) if "time" in array.dims else array).values)

        numbers = [m for m in (1, 2, 3) if f"permeability_{m}" in mapped]
        axes = np.stack(
            [
                np.stack([values(f"permeability_direction_{m}_{axis}") for axis in "xyz"], axis=1)
                for m in (1, 2)
            ],
            axis=1,
        )
        principal = np.stack([values(f"permeability_{m}") for m in numbers], axis=1)
        porosity = 1.0 - values("fibre_volume_fraction")
        return cls.from_principal(values("thickness"), porosity, principal, axes, **others)


def _refuse(name: str, values: np.ndarray, wrong: np.ndarray, why: str) -> None:
    rows = np.flatnonzero(wrong)
    if len(rows):
        few = ", ".join(str(row) for row in rows[:5]) + (", ..." if len(rows) > 5 else "")
        raise InputError(
            f"{name} of {len(rows)} cells (row {few}) is {values[rows[0]]:.6g}: {why}",
            key=f"preform.{name}",
        )
