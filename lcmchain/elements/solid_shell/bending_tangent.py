"""Bending at the reference thickness in the tangent: see :mod:`.bending` (NumPy)."""

from __future__ import annotations

import numpy as np

# Taylor terms of the bending, in the order of ``packing.TERMS``, and their powers of ζ
BENDING = [1, 2, 5, 6]
POWER = np.array([1.0, 2.0, 1.0, 1.0])
CENTRE, NORMAL = 0, 2


def at_reference_thickness(B: np.ndarray, E: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return gradients (E, 7, 6, 21) and strains (E, 7, 6) with the bending over powers of λ."""
    scale, r = _scale(E)
    strains, gradients = E.copy(), B.copy()
    strains[:, BENDING] *= scale[..., None]
    gradients[:, BENDING] *= scale[..., None, None]
    change = (POWER * r)[..., None] * strains[:, BENDING]
    gradients[:, BENDING] -= change[..., None] * B[:, CENTRE, NORMAL][:, None, None]
    return gradients, strains


def geometric_part(B: np.ndarray, E: np.ndarray, R: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return what the second derivatives of the scaled strains add to the tangent.

    Parameters
    ----------
    B : (E, 7, 6, 21) gradients before the scaling; E : (E, 7, 6) strains after it.
    R : (E, 7, 6) resultants of the scaled strains.

    Returns
    -------
    The products of first derivatives (E, 21, 21), and the resultants (E, 7, 6) of the unscaled
    strains, whose second derivatives the caller knows.
    """
    scale, r = _scale(E)
    b33 = B[:, CENTRE, NORMAL]
    work = np.einsum("eti,eti->et", R[:, BENDING], E[:, BENDING])
    along = np.einsum("et,eti,etij->ej", POWER * r * scale, R[:, BENDING], B[:, BENDING])
    pair = along[:, :, None] * b33[:, None, :]
    itself = np.sum(POWER * (POWER + 2.0) * r**2 * work, axis=1)
    K = itself[:, None, None] * b33[:, :, None] * b33[:, None, :]
    K -= pair + pair.transpose(0, 2, 1)
    unscaled = R.copy()
    unscaled[:, BENDING] *= scale[..., None]
    unscaled[:, CENTRE, NORMAL] -= np.sum(POWER * r * work, axis=1)
    return K, unscaled


def _scale(E: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return λ^-n of the bending terms (E, 4) and λ^-2 (E, 1)."""
    r = 1.0 / (1.0 + 2.0 * E[:, CENTRE, NORMAL, None])
    return r ** (0.5 * POWER), r
