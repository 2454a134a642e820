"""Single-element forces against an evaluation that shares nothing with the package but the law.

Written here from the paper alone: trilinear shape functions, strains sampled at points, the ANS
collocation done with numbers, Taylor coefficients by fitting the sampled polynomials, the change
of axes and all operators by complex steps, Gauss points along the thickness. Round brackets are
the equation numbers of Schäfer, Mitsch, Kärger.
"""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from lcmchain.elements.solid_shell.reference import ElementOptions, ReferenceElement

CORNERS = np.array(
    [
        [-1, -1, -1], [1, -1, -1], [1, 1, -1], [-1, 1, -1],
        [-1, -1, 1], [1, -1, 1], [1, 1, 1], [-1, 1, 1],
    ]
)  # fmt: skip
VOIGT = ((0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (0, 2))
STEP = 1e-100  # of complex differentiation

# --- the independent element ----------------------------------------------------------------------


def base_vectors(x, point):
    """g_i = Σ x_I ∂N_I/∂ξ_i (3, ..., 3 components) of nodes x (..., 8, 3), Eqs. (4), (5)."""
    factors = 1.0 + CORNERS * np.asarray(point)
    gradients = np.empty((8, 3), dtype=factors.dtype)
    for i in range(3):
        others = [j for j in range(3) if j != i]
        gradients[:, i] = CORNERS[:, i] * factors[:, others].prod(axis=1) / 8.0
    return np.einsum("ni,...nd->i...d", gradients, x)


def dot(a, b):
    """Scalar product without conjugation, so that complex steps pass through."""
    return np.sum(a * b, axis=-1)


def covariant_strain(x, X, point):
    """Green-Lagrange strain ½(g_i·g_j − G_i·G_j) in Voigt notation (..., 6), engineering shear."""
    g, G = base_vectors(x, point), base_vectors(X, point)
    E = [0.5 * (dot(g[i], g[j]) - dot(G[i], G[j])) for i, j in VOIGT]
    return np.stack([e * (1.0 if i == j else 2.0) for e, (i, j) in zip(E, VOIGT)], axis=-1)


def assumed_strain(x, X, points):
    """Covariant strains (P, ..., 6), the transverse ones interpolated from collocation points.

    ζζ at A-D = (±1, ±1, 0), Eq. (6); ηζ at E-H = (±1, 0, ±1), Eq. (7); ξζ at J-M = (0, ±1, ±1),
    Eq. (8).
    """
    E = np.stack([covariant_strain(x, X, point) for point in points])
    for row, (p, q) in ((2, (0, 1)), (4, (0, 2)), (5, (1, 2))):
        E[..., row] = 0.0
        for signs in itertools.product((-1, 1), repeat=2):
            collocation = np.zeros(3)
            collocation[[p, q]] = signs
            at_collocation = covariant_strain(x, X, collocation)[..., row]
            weights = 0.25 * (1 + signs[0] * points[:, p]) * (1 + signs[1] * points[:, q])
            E[..., row] += np.multiply.outer(weights, at_collocation)
    return E


# the strains times the linear change of T are quadratic in ξ and η, cubic in ζ
SAMPLES = np.array(list(itertools.product((-1, 0, 1), (-1, 0, 1), (-1, -0.4, 0.3, 1))))
EXPONENTS = list(itertools.product(range(3), range(3), range(4)))
POWERS = np.prod(SAMPLES[:, None, :] ** np.array(EXPONENTS), axis=2)
FIT = np.linalg.inv(POWERS)
TERMS = {
    "centre": (0, 0, 0),
    "zeta": (0, 0, 1),
    "zeta2": (0, 0, 2),
    "xi": (1, 0, 0),
    "eta": (0, 1, 0),
    "eta_zeta": (0, 1, 1),
    "xi_zeta": (1, 0, 1),
}


def coefficients(samples):
    """Coefficients by term of the polynomial through samples (P, ..., 6)."""
    fitted = np.tensordot(FIT, samples, axes=1)
    return {term: fitted[EXPONENTS.index(power)] for term, power in TERMS.items()}


def values(polynomial):
    """Samples (P, ..., 6) of a polynomial given by its coefficients by term."""
    columns = [EXPONENTS.index(TERMS[term]) for term in polynomial]
    return np.tensordot(POWERS[:, columns], np.stack(list(polynomial.values())), axes=1)


def strain_map(K):
    """T (6, 6) of Ê = T Ē with E_ab = K_ia Ē_ij K_jb."""
    T = np.zeros((6, 6), dtype=K.dtype)
    for column, (i, j) in enumerate(VOIGT):
        unit = np.zeros((3, 3))
        unit[i, j] = unit[j, i] = 1.0 if i == j else 0.5
        E = K.T @ unit @ K
        T[:, column] = [E[a, b] * (1.0 if a == b else 2.0) for a, b in VOIGT]
    return T


class IndependentElement:
    def __init__(self, X, fibre, law, tangent, bending, options, is_fabric=True):
        self.X, self.law, self.tangent, self.is_fabric = X, law, tangent, is_fabric
        self.bending, self.options = bending, options
        G1, G2, G3 = base_vectors(X, (0, 0, 0))
        e3 = np.cross(G1, G2) / np.linalg.norm(np.cross(G1, G2))
        e1 = fibre - (fibre @ e3) * e3
        e1 /= np.linalg.norm(e1)
        axes = np.array([e1, np.cross(e3, e1), e3])

        def transformation(point):
            jacobian = axes @ base_vectors(X, point).T  # columns G_i in material axes
            return strain_map(np.linalg.inv(jacobian))

        self.T0 = transformation(np.zeros(3))
        self.dT = [transformation(1j * STEP * np.eye(3)[i]).imag / STEP for i in range(3)]
        self.J0 = np.linalg.det(base_vectors(X, (0, 0, 0)))
        self.height = G3 @ e3

    def strains(self, x):
        """Taylor coefficients (..., 6) of Ê_c by term, Eq. (10), for nodes x (..., 8, 3)."""
        # E^ξη is dropped, and with it all that the expansion does not list
        covariant = coefficients(assumed_strain(x, self.X, SAMPLES))
        change = self.T0 + np.tensordot(SAMPLES, np.stack(self.dT), axes=1)
        E = coefficients(np.einsum("pij,p...j->p...i", change, values(covariant)))
        if not self.options.in_plane_shear_hourglass:
            for term in ("xi", "eta"):
                at_centre = np.linalg.solve(self.T0, E[term][..., None])[..., 0]
                at_centre[..., 3] = 0.0
                E[term] = at_centre @ self.T0.T
        if self.options.compaction_strain == "normal":
            a1, a2, a3 = base_vectors(x, (0, 0, 0))
            c = np.cross(a1, a2)
            t = dot(a3, c) / np.sqrt(dot(c, c))
            E["centre"][..., 2] = 0.5 * ((t / self.height) ** 2 - 1.0)
        return E

    def hourglass_tangent(self, E):
        """Return C^hg: the tangent, Eq. (18), with the departures that the options ask for."""
        E = E.copy()
        if self.options.hourglass == "conservative" and self.is_fabric:
            w = np.sin(np.radians(5.0))
            if abs(E[3].real) < w:
                E[3] = w * (3.0 + 6.0 * (E[3] / w) ** 2 - (E[3] / w) ** 4) / 8.0
        C = self.tangent(E)
        for i in (0, 1):
            if self.is_fabric:
                C[i, i] *= self.options.fibre_hourglass
        return C

    def force(self, x):
        """Return R_u* + R_u^hg, Eqs. (15)-(17), and its hourglass part."""
        E = {term: e.real for term, e in self.strains(x.astype(complex)).items()}
        steps = 1j * STEP * np.eye(24).reshape(24, 8, 3)
        # the strains do not depend on a translation: taking it out saves digits
        x = x - x.mean(axis=0)
        B = {term: e.imag.T / STEP for term, e in self.strains(x + steps).items()}
        tangent = np.stack(
            [self.law(E["centre"] + 1j * STEP * unit).imag / STEP for unit in np.eye(6)], axis=1
        )
        np.testing.assert_allclose(tangent, self.tangent(E["centre"]).real, rtol=1e-12)
        S_c, C_B = self.law(E["centre"]), self.bending
        B_e = self.T0 @ [0.0, 0.0, 1.0, 0.0, 0.0, 0.0]  # Eq. (9) without its ζ
        points, weights = np.polynomial.legendre.leggauss(self.options.integration_points)

        residual = slope = 0.0  # Eq. (17) from α = 0
        for zeta, w in zip(points, weights):
            S = S_c + C_B @ (zeta * E["zeta"] + zeta**2 * E["zeta2"])
            residual += w * 4 * self.J0 * zeta * B_e @ S
            slope += w * 4 * self.J0 * zeta * B_e @ tangent @ (zeta * B_e)
        alpha = -residual / slope

        force = np.zeros(24)
        for zeta, w in zip(points, weights):
            even = C_B @ (zeta**2 * E["zeta2"])
            odd = C_B @ (zeta * E["zeta"]) + tangent @ (zeta * B_e * alpha)
            B0, B1, B2 = B["centre"], zeta * B["zeta"], zeta**2 * B["zeta2"]
            if self.options.cross_terms:
                work = (B0 + B1 + B2).T @ (S_c + odd + even)
            else:
                work = B0.T @ (S_c + odd) + B1.T @ (S_c + odd + even) + B2.T @ (odd + even)
            force += w * 4 * self.J0 * work

        hourglass = np.zeros(24)  # Eq. (16)
        C_hg = self.hourglass_tangent(E["centre"]).real
        for term, share, C in (
            ("xi", 8 / 3, C_hg),
            ("eta", 8 / 3, C_hg),
            ("eta_zeta", 8 / 9, C_B),
            ("xi_zeta", 8 / 9, C_B),
        ):
            hourglass += share * self.J0 * B[term].T @ (C @ E[term])
        if self.options.hourglass == "conservative":
            # the energy 4/3 J⁰ (E^ξ:C(E⁰):E^ξ + ...) of these forces depends on E⁰ as well
            for i, unit in enumerate(np.eye(6)):
                change = self.hourglass_tangent(E["centre"] + 1j * STEP * unit).imag / STEP
                for term in ("xi", "eta"):
                    stress = 4 / 3 * self.J0 * E[term] @ change @ E[term]
                    hourglass += stress * B["centre"][i]
        return (force + hourglass).reshape(8, 3), hourglass.reshape(8, 3)


def fabric_law(p):
    """Membrane and compaction stress of the fabric, Eqs. (19)-(23), for complex steps."""

    def stress(E):
        e12 = 0.5 * E[3] * np.sign(E[3].real)
        C12 = p.s0 + p.s1 * e12 + p.s2 * e12**2 + p.s3 * e12**3 + p.s4 * e12**4
        C33 = p.c0 * np.exp(p.c1 * (-E[2]) ** p.c2) if E[2].real < 0.0 else p.c0
        stiffness = np.array([p.C11, p.C22, C33, C12, p.C23, p.C13])
        return stiffness * E

    return stress


def fabric_tangent(p):
    """Derivative of :func:`fabric_law` by hand, checked against it in every comparison."""

    def tangent(E):
        e12 = 0.5 * E[3] * np.sign(E[3].real)
        C12 = sum((i + 1) * s * e12**i for i, s in enumerate((p.s0, p.s1, p.s2, p.s3, p.s4)))
        X = p.c1 * (-E[2]) ** p.c2 if E[2].real < 0.0 else 0.0
        return np.diag([p.C11 + 0j, p.C22, p.c0 * np.exp(X) * (1 + p.c2 * X), C12, p.C23, p.C13])

    return tangent


def independent(X, fibre, material, options):
    if material.is_diagonal:
        p = material.law
        bending = np.diag([p.B11, p.B22, p.B33, p.B12, p.B23, p.B13])
        return IndependentElement(X, fibre, fabric_law(p), fabric_tangent(p), bending, options)
    C_M = material.C_membrane
    return IndependentElement(
        X, fibre, lambda E: C_M @ E, lambda E: C_M + 0j, material.C_bending, options, False
    )


# --- comparison -----------------------------------------------------------------------------------

OPTIONS = [
    ElementOptions(),
    ElementOptions(cross_terms=True),
    ElementOptions(cross_terms=True, compaction_strain="director"),
    ElementOptions(cross_terms=True, in_plane_shear_hourglass=False),
    ElementOptions(compaction_strain="director", in_plane_shear_hourglass=False),
    *(ElementOptions(cross_terms=True, integration_points=n) for n in (2, 4, 5, 6, 7)),
    ElementOptions(integration_points=2),
    ElementOptions(fibre_hourglass=0.3),
    ElementOptions(cross_terms=True, hourglass="published"),
    ElementOptions(
        cross_terms=True, hourglass="published", compaction_strain="director", integration_points=2
    ),
    ElementOptions(
        cross_terms=True, hourglass="published", compaction_strain="director", fibre_hourglass=0.3
    ),
]


def name_of(options):
    return (
        f"n={options.integration_points} {options.compaction_strain}"
        f"{' cross' if options.cross_terms else ''}"
        f"{'' if options.in_plane_shear_hourglass else ' no-shear-row'} {options.hourglass}"
        f"{'' if options.fibre_hourglass == 1.0 else f' fibres {options.fibre_hourglass:g}'}"
    )


def largest_difference(X, fibre, x, material, options):
    expected, expected_hourglass = independent(X, fibre, material, options).force(x)
    result = ReferenceElement(X, fibre, material, options).evaluate(x)
    scale = abs(expected).max()
    assert abs(expected_hourglass).max() > 1e-6 * scale  # the comparison sees the stabilisation
    return (
        max(
            abs(result.force - expected).max(),
            abs(result.hourglass_force - expected_hourglass).max(),
        )
        / scale
    )


def test_forces_at_small_shear_that_changes_over_the_element(make):
    """Where the stabilising tangent is rounded: 1° at the centre, 8° from edge to edge."""
    rng = np.random.default_rng(6)
    X, fibre = make.flat_reference(rng)
    x = make.deformed(rng, X, fibre, gradient=make.sheared(np.radians(1.0)), warp=0.05)
    for options in (ElementOptions(), ElementOptions(hourglass="published")):
        assert largest_difference(X, fibre, x, make.md600(), options) < 1e-10


@pytest.mark.parametrize("options", OPTIONS, ids=name_of)
@pytest.mark.parametrize("kind", ["fabric", "full"])
def test_forces_of_distorted_elements(make, kind, options):
    rng = np.random.default_rng(1)
    for reference in (make.flat_reference, make.curved_reference, make.curved_reference):
        material = make.md600() if kind == "fabric" else make.coupled(rng)
        X, fibre = reference(rng)
        x = make.deformed(rng, X, fibre)
        assert largest_difference(X, fibre, x, material, options) < 1e-10


@pytest.mark.parametrize("strain", ["normal", "director"])
@pytest.mark.parametrize(
    "shear, compaction", [(1.0, 1.0), (0.3, 0.7), (-0.8, 0.6), (0.0, 1.2), (0.1, 0.9)]
)
def test_forces_of_formed_fabric(make, shear, compaction, strain):
    """Sheared up to 57 degrees, compacted to 0.6 or thickened, on a strongly warped reference."""
    rng = np.random.default_rng(2)
    options = ElementOptions(compaction_strain=strain)
    X, fibre = make.curved_reference(rng, warp=0.25)
    x = make.deformed(rng, X, fibre, gradient=make.sheared(shear, compaction, 1.002), warp=0.05)
    assert largest_difference(X, fibre, x, make.md600(), options) < 1e-10
