"""Off-axis tension: a strip whose fibres lie at an angle to the pull, stretched evenly.

The state is affine: with X along the pull and Y across, x = λ X + k Y, y = μ Y. Lines across the
strip tilt by k, which oblique clamps let them do; nothing acts on the sides and the faces,

    S22 = S33 = S12 = 0 in the axes of the strip,

three equations for E22, E33 and E12 at a given λ, solved by Newton's method with the law's own
stress and tangent. The force is F = w0 t0 λ S11. For small strains and constant moduli it is that
of the apparent modulus of a lamina, 1/E = c⁴/E1 + s⁴/E2 + c² s²/G without Poisson's ratio.

Sources: Sun, Chung, "An oblique end-tab design for testing off-axis composite specimens",
Composites 24 (1993) 619; the modulus: any book on laminates.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from lcmchain.errors import InputError
from lcmchain.materials.law import Material, fibre_angles
from lcmchain.mesh.sheet_mesh import change_of_angle

#: Steps of the stretch between two asked ones, and of Newton's method.
LONGEST_STEP = 2e-3
MOST_STEPS = 60
#: What is left of the stresses that have to vanish, over the stiffness.
TOLERANCE = 1e-12
# Voigt components 22, 33, 12 in the axes of the strip
FREE = (1, 2, 3)


@dataclass(frozen=True)
class AffineTension:
    """States of a strip, (T,) each.

    stretch : λ along the pull. tilt : k of the lines across. across : μ.
    stress : S11 along the pull [Pa].
    """

    stretch: np.ndarray
    tilt: np.ndarray
    across: np.ndarray
    stress: np.ndarray

    def gradient(self) -> np.ndarray:
        """Return the deformation gradient in the plane (T, 2, 2)."""
        F = np.zeros((len(self.stretch), 2, 2))
        F[:, 0, 0], F[:, 0, 1], F[:, 1, 1] = self.stretch, self.tilt, self.across
        return F

    def force(self, width: float, thickness: float) -> np.ndarray:
        """Return the force [N] on a strip of this width and thickness at the start [m]."""
        return width * thickness * self.stretch * self.stress

    def shear_angle(self, angle: float, apart: float) -> np.ndarray:
        """Return by how much the angle between two lines has become smaller [rad].

        angle : of the first line from the pull. apart : of the second from the first [rad].
        """
        lines = np.array([[math.cos(a), math.sin(a)] for a in (angle, angle + apart)])
        carried = np.einsum("tij,lj->lti", self.gradient(), lines)
        first, second = np.concatenate([carried, np.zeros((*carried.shape[:2], 1))], axis=2)
        return change_of_angle(first, second, np.array([0.0, 0.0, 1.0]), apart)


def axes_turned(angle: float) -> np.ndarray:
    """Return what gives the strain in axes turned by an angle [rad] about the normal, (6, 6)."""
    c, s = math.cos(angle), math.sin(angle)
    R = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
    pairs = ((0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (0, 2))
    T = np.zeros((6, 6))
    for row, (p, q) in enumerate(pairs):
        for column, (i, j) in enumerate(pairs):
            both = R[p, i] * R[q, j] + (R[p, j] * R[q, i] if i != j else 0.0)
            T[row, column] = both * (1.0 if p == q else 2.0) * (1.0 if i == j else 0.5)
    return T


def affine_tension(material: Material, turn: float, stretch: ArrayLike) -> AffineTension:
    """Return the states of a strip at rising stretches (T,).

    Parameters
    ----------
    turn : of the first axis of the ply from the pull [rad].

    Raises
    ------
    InputError : no state is found; the law softens, or the strip has locked.
    """
    T = axes_turned(turn)
    wanted = np.asarray(stretch, dtype=float)
    strain, states, reached = np.zeros(6), [], 1.0
    for end in wanted:
        count = max(1, math.ceil(abs(end - reached) / LONGEST_STEP))
        for now in np.linspace(reached, end, count + 1)[1:]:
            strain[0] = 0.5 * (now**2 - 1.0)
            stress = _relax(material, T, strain, now)
        reached = float(end)
        states.append((*strain[[1, 3]], stress))
    E22, g12, S11 = np.array(states).reshape(-1, 3).T
    tilt = g12 / wanted
    return AffineTension(wanted, tilt, np.sqrt(1.0 + 2.0 * E22 - tilt**2), S11)


def _relax(material: Material, T: np.ndarray, strain: np.ndarray, stretch: float) -> float:
    """Move the free strains to where nothing acts on sides and faces; return S11."""
    free = list(FREE)
    for _ in range(MOST_STEPS):
        S, C = material.stress_and_tangent(T @ strain)
        stress, tangent = T.T @ S, T.T @ C @ T
        inner = tangent[np.ix_(free, free)]
        change = np.linalg.solve(inner, -stress[free])
        if np.abs(change).max() < TOLERANCE:
            return float(stress[0])
        # no jump over the kinks of a law
        strain[free] += change * min(1.0, 0.02 / np.abs(change).max())
    raise InputError(
        f"no even state of the strip is found at a stretch of {stretch:.4g}; the law has no "
        "stiffness there, or the strip has locked: pull less far",
        key="displacement",
    )


def lines_of(material: Material) -> tuple[float, float]:
    """Return the angle of the first family from the ply's axis, and how far the next line is on.

    That is the second family; of a single one the line across it.
    """
    first, *others = fibre_angles(material)
    return first, (others[0] - first if others else 0.5 * math.pi)
