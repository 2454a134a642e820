"""Plies of a forming result: to which of the bodies formed together each face belongs."""

from __future__ import annotations

from collections.abc import Hashable
from typing import TYPE_CHECKING

import numpy as np

from lcmchain.errors import InputError

if TYPE_CHECKING:
    import xarray as xr

BODY = "body"

#: A ply that covers this share of what the others cover is there as a whole: the outlines of two
#: meshes of one curved shape differ by about as much.
WHOLE = 0.99


def plies_of(
    dataset: xr.Dataset, face_dimension: Hashable, name: str
) -> tuple[np.ndarray | None, tuple[str, ...]]:
    """Return the number of the ply of each face, shape (F,), and the plies' names.

    A result with one body has neither.

    Raises
    ------
    InputError : the flags of the faces do not say which body they mean.
    """
    variable = dataset.get(BODY)
    if variable is None or variable.dtype.kind not in "iu" or variable.dims != (face_dimension,):
        return None, ()
    names = tuple(str(variable.attrs.get("flag_meanings", "")).split())
    flags = np.atleast_1d(variable.attrs.get("flag_values", np.arange(len(names))))
    values = np.asarray(variable.values)
    if len(set(names)) != len(flags) or not np.isin(values, flags).all():
        raise InputError(
            f'the faces of several bodies are marked by "{BODY}", but its flag_values and '
            "flag_meanings do not name them all",
            file=name,
        )
    # bodies without a face are no plies
    used, ply = np.unique(values, return_inverse=True)
    if len(used) < 2:
        return None, ()
    order = {int(flag): word for flag, word in zip(flags, names, strict=True)}
    return ply.reshape(-1).astype(np.int64), tuple(order[int(flag)] for flag in used)


def without_films(
    dataset: xr.Dataset, face_dimension: Hashable, films: tuple[str, ...]
) -> xr.Dataset:
    """Return a forming result without the faces of its films."""
    names = str(dataset[BODY].attrs.get("flag_meanings", "")).split()
    flags = np.atleast_1d(dataset[BODY].attrs.get("flag_values", np.arange(len(names))))
    gone = [flag for flag, name in zip(flags, names, strict=True) if name in films]
    kept = np.flatnonzero(~np.isin(dataset[BODY].values, gone))
    return dataset.isel({face_dimension: kept})


def holes_of(values: np.ndarray, ply: np.ndarray | None) -> np.ndarray:
    """Faces without a value, shape (H,); a ply that does not have the field at all has no holes."""
    bad = ~np.isfinite(values)
    if ply is not None and bad.any() and not bad.all():
        absent = np.bincount(ply, weights=~bad) == 0.0
        bad &= ~absent[ply]
    return np.flatnonzero(bad)


def present(coverage: np.ndarray) -> np.ndarray:
    """Which part of what covers each cell every ply covers, shape (P, C): 1 where all do.

    coverage : of each cell by every ply, shape (P, C).
    """
    capped = np.minimum(coverage, 1.0)
    most = capped.max(axis=0)
    part = np.where(most > 0.0, capped / np.where(most > 0.0, most, 1.0), 1.0)
    return np.where(part >= WHOLE, 1.0, part)
