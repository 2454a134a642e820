"""Symmetric tensors of many cells: of directions without a sense, and of the permeability."""

from __future__ import annotations

import numpy as np

from lcmchain.mapping.sheet import PrincipalPermeability

# Pairs of indices that are stored of a symmetric 3x3 tensor.
_ROWS, _COLUMNS = np.array([0, 1, 2, 1, 0, 0]), np.array([0, 1, 2, 2, 2, 1])


def squares(vectors: np.ndarray) -> np.ndarray:
    """Return the tensors v v, shape (C, 3, 3), of vectors (C, 3)."""
    return np.einsum("ci,cj->cij", vectors, vectors)


def tensors_of(values: np.ndarray, axes: np.ndarray) -> np.ndarray:
    """Return tensors (C, 3, 3) with principal values (C, 3) and axes, one a row, (C, 3, 3)."""
    return np.einsum("ck,cki,ckj->cij", values, axes, axes)


def packed(tensors: np.ndarray) -> np.ndarray:
    """Return the six components of symmetric tensors, shape (C, 6)."""
    return tensors[:, _ROWS, _COLUMNS]


def unpacked(components: np.ndarray) -> np.ndarray:
    """Return symmetric tensors, shape (C, 3, 3), from their six components."""
    tensors = np.empty((len(components), 3, 3))
    tensors[:, _ROWS, _COLUMNS] = components
    tensors[:, _COLUMNS, _ROWS] = components
    return tensors


def principal_permeability(tensors: np.ndarray, normals: np.ndarray) -> PrincipalPermeability:
    """Principal values and axes: two in the plane, the larger one first, and through it.

    What the tensors have between the plane and its normal, rounding or a bend, is left out.
    """
    away = np.eye(3)[np.argmin(np.abs(normals), axis=1)]
    first = np.cross(normals, away)
    first /= np.linalg.norm(first, axis=1)[:, None]
    plane = np.stack([first, np.cross(normals, first)], axis=1)
    values, vectors = np.linalg.eigh(np.einsum("cai,cij,cbj->cab", plane, tensors, plane))
    in_plane = np.einsum("cak,cai->cki", vectors, plane)[:, ::-1]  # the larger one first
    through = np.einsum("ci,cij,cj->c", normals, tensors, normals)
    return PrincipalPermeability(
        np.concatenate([values[:, ::-1], through[:, None]], axis=1),
        np.concatenate([in_plane, normals[:, None]], axis=1),
    )


def angles_between(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Angles between axes [rad], exact for small ones."""
    sine = np.linalg.norm(np.cross(one, other), axis=1)
    return np.arctan2(sine, np.abs(np.einsum("ci,ci->c", one, other)))


def pointing_along(axes: np.ndarray, directions: np.ndarray) -> np.ndarray:
    """Return axes (C, 3) with the sense of directions (C, 3)."""
    against = np.einsum("ci,ci->c", axes, directions) < 0.0
    return np.where(against[:, None], -axes, axes)
