"""Cure and temperature, carried along by the resin."""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_matrix, csc_matrix
from scipy.sparse.linalg import splu


def carry(
    value: np.ndarray,
    before: np.ndarray,
    after: np.ndarray,
    source: np.ndarray,
    target: np.ndarray,
    moved: np.ndarray,
    entered: np.ndarray,
    inlet: np.ndarray,
) -> np.ndarray:
    """Carry a value per resin volume over a time step: upwind, implicit, conservative.

    W' y' - W y = Σ_in q y'_from - Σ_out q y' + q_entered y_inlet; y stays between its least and
    largest values for any step. First order: fronts of cure are smeared over some control volumes.

    Parameters
    ----------
    value : of the resin in each control volume, (N,); what stands where there is none is ignored.
    before, after : resin volumes [m3], (N,).
    source, target, moved : rows and volumes [m3] of all transfers between control volumes.
    entered : volume [m3] that came from outside into each control volume, with the value ``inlet``,
        (N,).

    Returns
    -------
    The values (N,); where no resin is, the inlet's.
    """
    count = len(value)
    back = moved < 0.0
    start, end = np.where(back, target, source), np.where(back, source, target)
    moved = np.abs(moved)
    # What comes in is known to round-off from both sides; its sum is the one that conserves.
    incoming = np.bincount(end, moved, minlength=count) + np.maximum(entered, 0.0)
    held = before + incoming
    wet = held > 0.0
    diagonal = np.where(wet, held, 1.0)
    right = np.where(wet, before * value + np.maximum(entered, 0.0) * inlet, inlet)
    rows = np.concatenate([np.arange(count), end])
    columns = np.concatenate([np.arange(count), start])
    entries = np.concatenate([diagonal, -moved])
    matrix = csc_matrix(coo_matrix((entries, (rows, columns)), shape=(count, count)))
    carried = splu(matrix).solve(right)
    return np.where(after > 0.0, carried, inlet)
