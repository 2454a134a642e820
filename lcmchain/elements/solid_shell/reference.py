"""The same element, plainly: one element at a time, operator matrices, Gauss points, NumPy.

For readers and tests: it follows the paper line by line (6x24 operators, a loop over integration
points) and shares no code with the compiled kernel but the reference geometry. Equation numbers in
round brackets are those of Schäfer, Mitsch, Kärger.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lcmchain.elements.solid_shell.geometry import MODES, reference_geometry
from lcmchain.materials.law import (
    Material,
    Step,
    bending_response,
    bending_stress_in_step,
    bends_at_reference_thickness,
    stabilising_tangent,
    stress_in_step,
    tangent_coupling_of,
)

TERMS = ("centre", "zeta", "zeta2", "xi", "eta", "eta_zeta", "xi_zeta")


@dataclass(frozen=True)
class ElementOptions:
    """Choices of the element where paper or benchmarks need one (manual: departures)."""

    integration_points: int = 3
    compaction_strain: str = "normal"
    cross_terms: bool = False
    in_plane_shear_hourglass: bool = True
    hourglass: str = "conservative"
    fibre_hourglass: float = 1.0
    bending_thickness: str = "current"
    type: str = "solid-shell"


@dataclass(frozen=True)
class ElementResult:
    """Forces (8, 3) [N] with their hourglass part, and stored energies [J]."""

    force: np.ndarray
    hourglass_force: np.ndarray
    energy: float
    hourglass_energy: float


class ReferenceElement:
    """One solid-shell element with its reference configuration.

    Parameters
    ----------
    nodes : (8, 3) reference positions [m], VTK hexahedron order.
    fibre_direction : (3,) first material axis.
    material : with ``stress_and_tangent``, ``bending_matrix`` and ``membrane_energy``.
    options : element options.
    curvature : β11, β22, β12, q shared with neighbours (``curvature.py``), for normal thickness.
    """

    def __init__(
        self,
        nodes: np.ndarray,
        fibre_direction: np.ndarray,
        material: Material,
        options: ElementOptions | None = None,
        curvature: Sequence[float] = (0.0, 0.0, 0.0, 0.0),
    ) -> None:
        self.material = material
        self.curvature = curvature
        self.options = options or ElementOptions()
        geometry = reference_geometry(np.asarray(nodes)[None], np.asarray(fibre_direction)[None])
        self.K, self.dK = geometry.K[0], geometry.dK[0]
        self.height, self.volume = geometry.height[0], geometry.volume[0]
        self._reference = _covariant_strain(geometry.modes[0])

    def strain(self, nodes: np.ndarray) -> tuple[dict, dict]:
        """Return Taylor coefficients Ê (6,) and operators B̂ (6, 24) by term, Eq. (10)."""
        a = MODES @ nodes
        products = _covariant_strain(a)
        operators = _covariant_operator(a)
        Ebar = {t: products[t] - self._reference[t] for t in TERMS}
        E = self._to_material(Ebar)
        B = self._to_material(operators)
        if not self.options.in_plane_shear_hourglass:
            # dropped in the covariant axes of the centre, from the sum: its parts from Ē^ξ and from
            # T^ξ Ē^0 cancel in a constant strain
            T = _transformation(self.K, self.K)
            keep = np.eye(6) - np.outer(T[:, 3], np.linalg.inv(T)[3])
            for term in ("xi", "eta"):
                E[term] = keep @ E[term]
                B[term] = keep @ B[term]
        if self.options.compaction_strain == "normal":
            E["centre"][2], B["centre"][2] = self._normal_compaction(a)
            b11, b22, b12, q = self.curvature
            for row, factor in ((0, b11), (1, b22), (3, b12)):
                E["centre"][2] += factor * products["zeta"][row]
                B["centre"][2] += factor * operators["zeta"][row]
            E["centre"][2] -= q
        own_thickness = bends_at_reference_thickness(self.material)
        if self.options.bending_thickness == "reference" or own_thickness:
            # bending strains over powers of the thickness stretch λ = (1 + 2 E33)^½
            stretch = np.sqrt(1.0 + 2.0 * E["centre"][2])
            for term, power in (("zeta", 1), ("zeta2", 2), ("eta_zeta", 1), ("xi_zeta", 1)):
                E[term] = E[term] / stretch**power
                B[term] = B[term] / stretch**power
                B[term] -= power / stretch**2 * np.outer(E[term], B["centre"][2])
        return E, B

    def evaluate(
        self, nodes: np.ndarray, past: np.ndarray | None = None, step: Step | None = None
    ) -> ElementResult:
        """Return internal forces, Eqs. (15)-(17), and energies at node positions (8, 3).

        past, step : what a law that knows the step remembers (history_count,), and the step.
        """
        E, B = self.strain(np.asarray(nodes, dtype=float))
        S_centre, C_M = stress_in_step(self.material, E["centre"], past, step)
        C_B = self.material.bending_matrix()
        S_zeta, _, excess = bending_response(self.material, E["zeta"], self.height)
        # what has no potential, and is in no energy here
        S_lost = bending_stress_in_step(self.material, E["zeta"], self.height, past, step)
        points, weights = np.polynomial.legendre.leggauss(self.options.integration_points)

        # Eq. (17): R_α is linear in α_e, so that one update from 0 is exact
        B_e = np.array([0.0, 0.0, self.height**-2, 0.0, 0.0, 0.0])
        R_alpha = S_alpha = 0.0
        for zeta, weight in zip(points, weights, strict=True):
            S = S_centre + zeta * S_zeta + zeta**2 * C_B @ E["zeta2"]
            R_alpha += weight * zeta * B_e @ S
            S_alpha += weight * zeta**2 * B_e @ C_M @ B_e
        alpha = -R_alpha / S_alpha
        # along ζ a fabric bends apart from its membrane: no shear by the enhanced strain
        C_e = np.diag(np.diag(C_M)) if self.material.is_diagonal else C_M

        force = np.zeros(24)
        bending_energy = 0.0
        for zeta, weight in zip(points, weights, strict=True):
            E_e = zeta * B_e * alpha
            E_linear, E_quadratic = zeta * E["zeta"], zeta**2 * E["zeta2"]
            # Eq. (19), the membrane law linearised along ζ about the centre
            S = S_centre + C_e @ E_e + zeta * (S_zeta + S_lost) + C_B @ E_quadratic
            force += weight * (B["centre"] + zeta * B["zeta"] + zeta**2 * B["zeta2"]).T @ S
            bending_energy += weight * (
                0.5 * (E_linear @ (zeta * S_zeta + C_e @ E_e) + zeta**2 * excess)
                + 0.5 * E_quadratic @ C_B @ E_quadratic
            )
            if self.options.cross_terms:
                # a potential only where C^M = C^B; their symmetric part otherwise
                bending_energy += 0.5 * weight * (S_centre + C_B @ E["centre"]) @ E_quadratic
            else:
                force -= weight * (B["centre"].T @ (C_B @ E_quadratic))
                force -= weight * zeta**2 * (B["zeta2"].T @ S_centre)
        four_J0 = 0.5 * self.volume
        force *= four_J0
        energy = self.volume * self.material.membrane_energy(E["centre"])
        energy += four_J0 * bending_energy
        hourglass, hourglass_energy = self._hourglass(E, B, C_M, C_B)
        total = (force + hourglass).reshape(8, 3)
        return ElementResult(total, hourglass.reshape(8, 3), float(energy), float(hourglass_energy))

    def _hourglass(
        self, E: dict, B: dict, C_M: np.ndarray, C_B: np.ndarray
    ) -> tuple[np.ndarray, float]:
        """Return the stabilising forces (24,) of Eq. (16), and their energy.

        C^M is in the ξ and η terms, C^B in the ηζ and ξζ terms.
        """
        hourglass = np.zeros(24)
        conservative = self.options.hourglass == "conservative"
        C_hg, slope, coupling = C_M.copy(), np.zeros(6), None
        terms = None
        if hasattr(self.material, "stabilising_terms"):
            terms = self.material.stabilising_terms(E["centre"])
            share = 1.0 + terms.fibre * (self.options.fibre_hourglass - 1.0)
            C_hg = terms.readers.T @ np.diag(share * terms.modulus) @ terms.readers
        elif conservative:
            C_hg, slope, _ = stabilising_tangent(self.material, E["centre"])
            coupling = tangent_coupling_of(self.material, E["centre"])
        if self.material.is_diagonal:
            for i in (0, 1):  # fibres within the plane
                C_hg[i, i] *= self.options.fibre_hourglass
                slope[i] *= self.options.fibre_hourglass
        hourglass_energy = 0.0
        for term, weight, C in (
            ("xi", 1.0 / 3.0, C_hg),
            ("eta", 1.0 / 3.0, C_hg),
            ("eta_zeta", 1.0 / 9.0, C_B),
            ("xi_zeta", 1.0 / 9.0, C_B),
        ):
            hourglass += self.volume * weight * B[term].T @ (C @ E[term])
            hourglass_energy += 0.5 * self.volume * weight * E[term] @ C @ E[term]
        if conservative:
            # derivative of that energy with respect to E⁰, on which the tangent of Eq. (18) depends
            squares = E["xi"] ** 2 + E["eta"] ** 2
            hourglass += self.volume / 6.0 * B["centre"].T @ (slope * squares)
            if terms is not None:
                for r, change in zip(terms.readers, terms.slope, strict=True):
                    both = (r @ E["xi"]) ** 2 + (r @ E["eta"]) ** 2
                    hourglass += self.volume / 6.0 * change * both * (r @ B["centre"])
            if coupling is not None:
                hourglass += self.volume / 6.0 * B["centre"][3] * coupling[0] * squares[2]
        return hourglass, hourglass_energy

    def _to_material(self, bar: dict) -> dict:
        """Apply T ≈ T⁰ + ξT^ξ + ηT^η + ζT^ζ to strains (6,) or operators (6, 24)."""
        T = _transformation(self.K, self.K)
        T_xi, T_eta, T_zeta = (
            _transformation(dK, self.K) + _transformation(self.K, dK) for dK in self.dK
        )
        return {
            "centre": T @ bar["centre"],
            "zeta": T @ bar["zeta"] + T_zeta @ bar["centre"],
            "zeta2": T @ bar["zeta2"] + T_zeta @ bar["zeta"],
            "xi": T @ bar["xi"] + T_xi @ bar["centre"],
            "eta": T @ bar["eta"] + T_eta @ bar["centre"],
            "eta_zeta": T @ bar["eta_zeta"] + T_eta @ bar["zeta"] + T_zeta @ bar["eta"],
            "xi_zeta": T @ bar["xi_zeta"] + T_xi @ bar["zeta"] + T_zeta @ bar["xi"],
        }

    def _normal_compaction(self, a: np.ndarray) -> tuple[float, np.ndarray]:
        """Return E33 of the normal thickness a3·n and its operator row (24,)."""
        a1, a2, a3 = a[:3]
        c = np.cross(a1, a2)
        t = a3 @ c / np.linalg.norm(c)
        n = c / np.linalg.norm(c)
        # δt = n·δa3 + a3·δn with |c| δn = (1 - n n)·(δa1 x a2 + a1 x δa2)
        w = (a3 - t * n) / np.linalg.norm(c)
        gradients = np.zeros((7, 3))
        gradients[0] = np.cross(a2, w)
        gradients[1] = np.cross(w, a1)
        gradients[2] = n
        row = t / self.height**2 * np.einsum("kn,kd->nd", MODES, gradients).ravel()
        return 0.5 * ((t / self.height) ** 2 - 1.0), row


def _transformation(K: np.ndarray, L: np.ndarray) -> np.ndarray:
    """Return the 6x6 map of Ē to ½(K_ia L_jb + L_ia K_jb) Ē_ij in Voigt notation."""
    pairs = ((0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (0, 2))
    T = np.zeros((6, 6))
    for row, (p, q) in enumerate(pairs):
        for column, (i, j) in enumerate(pairs):
            value = 0.5 * (K[i, p] * L[j, q] + K[i, q] * L[j, p])
            if i != j:
                value = 0.5 * (value + 0.5 * (K[j, p] * L[i, q] + K[j, q] * L[i, p]))
            T[row, column] = value * (1.0 if p == q else 2.0)
    return T


# Products a_k·a_l with their factor, in every component of every Taylor term (modes from 1):
# covariant strains after ANS at the collocation points A-D, E-H, J-M of Fig. 1b, Eqs. (6)-(8).
_PRODUCTS = {
    "centre": {
        0: [(0.5, 1, 1)],
        1: [(0.5, 2, 2)],
        2: [(0.5, 3, 3), (0.5, 5, 5), (0.5, 6, 6), (0.5, 7, 7)],
        3: [(1.0, 1, 2)],
        4: [(1.0, 2, 3), (1.0, 4, 6)],
        5: [(1.0, 1, 3), (1.0, 4, 5)],
    },
    "zeta": {
        0: [(1.0, 1, 6)],
        1: [(1.0, 2, 5)],
        3: [(1.0, 1, 5), (1.0, 2, 6)],
        4: [(1.0, 3, 5), (1.0, 6, 7)],
        5: [(1.0, 3, 6), (1.0, 5, 7)],
    },
    "zeta2": {0: [(0.5, 6, 6)], 1: [(0.5, 5, 5)], 3: [(1.0, 5, 6)]},
    "xi": {
        1: [(1.0, 2, 4)],
        2: [(1.0, 3, 6), (1.0, 5, 7)],
        3: [(1.0, 1, 4)],
        4: [(1.0, 2, 6), (1.0, 3, 4)],
    },
    "eta": {
        0: [(1.0, 1, 4)],
        2: [(1.0, 3, 5), (1.0, 6, 7)],
        3: [(1.0, 2, 4)],
        5: [(1.0, 1, 5), (1.0, 3, 4)],
    },
    "eta_zeta": {
        0: [(1.0, 1, 7), (1.0, 4, 6)],
        3: [(1.0, 2, 7), (1.0, 4, 5)],
        5: [(1.0, 3, 7), (1.0, 5, 6)],
    },
    "xi_zeta": {
        1: [(1.0, 2, 7), (1.0, 4, 5)],
        3: [(1.0, 1, 7), (1.0, 4, 6)],
        4: [(1.0, 3, 7), (1.0, 5, 6)],
    },
}


def _covariant_strain(a: np.ndarray) -> dict:
    """Return the covariant Taylor coefficients (6,) of ½ g_i·g_j after ANS by term."""
    result = {}
    for term, rows in _PRODUCTS.items():
        result[term] = np.zeros(6, dtype=a.dtype)
        for row, products in rows.items():
            result[term][row] = sum(f * (a[k - 1] @ a[m - 1]) for f, k, m in products)
    return result


def _covariant_operator(a: np.ndarray) -> dict:
    """Return the operators (6, 24) with δĒ = B̄ δu by term."""
    result = {}
    for term, rows in _PRODUCTS.items():
        result[term] = np.zeros((6, 24))
        for row, products in rows.items():
            gradient = np.zeros((8, 3))
            for f, k, m in products:
                gradient += f * np.outer(MODES[k - 1], a[m - 1])
                gradient += f * np.outer(MODES[m - 1], a[k - 1])
            result[term][row] = gradient.ravel()
    return result
