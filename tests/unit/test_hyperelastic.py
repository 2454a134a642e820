"""Films that keep their volume: laws against closed forms, the element, its bound."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import fsolve

from lcmchain.effects.supports import Support
from lcmchain.elements.solid_shell.reference import ElementOptions, ReferenceElement
from lcmchain.errors import InputError
from lcmchain.materials.law import bending_bound, bending_stiffness, membrane_response
from lcmchain.materials.neo_hooke import NeoHookeMaterial
from lcmchain.materials.ogden import OgdenMaterial
from lcmchain.materials.stiffness import orthotropic_rows
from lcmchain.model import assemble_sheet, build_model
from lcmchain.scene import scene_from_text
from lcmchain.solver.simulation import Simulation
from lcmchain.verification import random_elements as make

SHEET = {"thickness": "1 mm", "density": "1100 kg/m^3"}
#: Ogden's constants for Treloar's rubber [MPa] (Proc. R. Soc. A 326 (1972) 565, table 1).
TRELOAR = {"mu": "0.63 0.0012 -0.01 MPa", "alpha": [1.3, 5.0, -2.0]}
ONE_TERM = {"mu": "0.5 MPa", "alpha": 2.4}
MATERIALS = {
    "neo-hooke": NeoHookeMaterial.model_validate({**SHEET, "shear_modulus": "0.4 MPa"}).build(),
    "ogden of one term": OgdenMaterial.model_validate({**SHEET, **ONE_TERM}).build(),
    "ogden of three": OgdenMaterial.model_validate({**SHEET, **TRELOAR}).build(),
}
MU, ALPHA = (0.63e6, 1.2e3, -1e4), (1.3, 5.0, -2.0)

each_law = pytest.mark.parametrize("material", MATERIALS.values(), ids=MATERIALS)


def strain_of(F):
    C = F.T @ F
    return np.array(
        [0.5 * (C[0, 0] - 1), 0.5 * (C[1, 1] - 1), 0.5 * (C[2, 2] - 1), C[0, 1], C[1, 2], C[0, 2]]
    )


def strains():
    """Large ones at random, and some whose principal stretches are equal, or nearly so."""
    rng = np.random.default_rng(5)
    found = [strain_of(np.eye(3) + 0.4 * rng.uniform(-1, 1, (3, 3))) for _ in range(20)]
    for apart in (0.0, 1e-9, 1e-4, 1e-2, 0.03, 0.1):  # around the switch to the series
        found.append(strain_of(np.diag([1.4, 1.4 + apart, 0.6])))
        turned = strain_of(
            np.diag([1.4, 1.4 + apart, 0.6]) @ np.linalg.qr(rng.normal(size=(3, 3)))[0]
        )
        found.append(turned)
    return found


def relative(found, expected):
    return np.abs(np.asarray(found) - expected).max() / np.abs(expected).max()


# --- the laws -------------------------------------------------------------------------------------


@each_law
def test_stress_and_tangent_are_derivatives_of_the_energy(material):
    """By the complex step, which loses no digits; the compiled law and the plain one agree."""
    for E in strains():
        step = 1e-30j
        stress = [material.membrane_energy(E + step * e).imag / 1e-30 for e in np.eye(6)]
        S, C = material.stress_and_tangent(E)
        assert relative(S, np.array(stress)) < 1e-12
        tangent = np.array([material.stress_and_tangent(E + step * e)[0].imag for e in np.eye(6)])
        assert relative(C, tangent / 1e-30) < 1e-7
        compiled = membrane_response(material.law, tuple(E), ())
        assert relative(compiled[0], S) < 1e-12
        assert relative(compiled[1], C) < 1e-8
        np.testing.assert_array_equal(compiled[1], np.transpose(compiled[1]))


def stretched(material, stretch, free):
    """Return nominal stresses (3,) of stretches whose unknown ones are found so that S is zero.

    free : maps the unknowns to the three stretches and to the components that carry no stress.
    """

    def lacking(unknown):
        stretches, bare = free(np.exp(unknown))
        S = material.stress_and_tangent(0.5 * (np.array([*stretches, 1, 1, 1]) ** 2 - 1.0))[0]
        return S[list(bare)] / material.law.shear

    guess = -np.log(stretch) * np.ones(len(free(np.ones(2))[1]))
    unknown = fsolve(lambda x: lacking(np.append(x, 0.0)), guess, xtol=1e-12)
    stretches, _ = free(np.exp(np.append(unknown, 0.0)))
    E = 0.5 * (np.array([*stretches, 1, 1, 1]) ** 2 - 1.0)
    return np.array(stretches) * material.stress_and_tangent(E)[0][:3], np.array(stretches)


def nominal(mu, alpha, stretch, contraction):
    """Closed form Σ µ_p (λ^(α_p - 1) - λ^(-c α_p - 1)) of Ogden; c = 1/2, 2 or 1."""
    return sum(
        m * (stretch ** (a - 1) - stretch ** (-contraction * a - 1)) for m, a in zip(mu, alpha)
    )


@pytest.mark.parametrize("stretch", [0.8, 1.3, 2.0, 4.0])
@pytest.mark.parametrize(
    ("name", "mu", "alpha"),
    [("neo-hooke", (0.4e6,), (2.0,)), ("ogden of three", MU, ALPHA)],
)
def test_uniaxial_equibiaxial_and_planar_tension(name, mu, alpha, stretch):
    """The closed forms are of exactly incompressible rubber, though K is 25 µ only."""
    material = MATERIALS[name]
    uniaxial = stretched(material, stretch, lambda x: ((stretch, x[0], x[1]), (1, 2)))
    equal = stretched(material, stretch, lambda x: ((stretch, stretch, x[0]), (2,)))
    planar = stretched(material, stretch, lambda x: ((stretch, 1.0, x[0]), (2,)))
    for (P, found), contraction in ((uniaxial, 0.5), (equal, 2.0), (planar, 1.0)):
        assert P[0] == pytest.approx(nominal(mu, alpha, stretch, contraction), rel=1e-9)
        assert np.prod(found) == pytest.approx(1.0, rel=1e-10)


def test_a_balloon_has_its_largest_pressure_at_the_root_of_the_sixth_power_of_seven():
    """p = 2 µ (H/R) (1/λ - 1/λ^7), from the law's equibiaxial stress: p = 2 H P/(R λ²)."""
    material = MATERIALS["neo-hooke"]
    stretches = np.linspace(1.2, 1.6, 4001)
    E = np.zeros((stretches.size, 6))
    E[:, :2] = 0.5 * (stretches[:, None] ** 2 - 1.0)
    E[:, 2] = 0.5 * (stretches**-4 - 1.0)
    pressure = 2e-2 * material.stress_and_tangent(E)[0][:, 0] / stretches
    expected = 2e-2 * 0.4e6 * (1.0 / stretches - stretches**-7)
    np.testing.assert_allclose(pressure, expected, rtol=1e-9)
    assert stretches[np.argmax(pressure)] == pytest.approx(7.0 ** (1.0 / 6.0), abs=2e-4)


@each_law
def test_a_pressure_on_the_faces_adds_itself_in_all_directions(material):
    """A stretched sheet, pressed: each Cauchy stress falls by the pressure, J by p/K."""
    p = 0.02 * material.law.bulk
    E = 0.5 * (np.array([1.5, 1.2, 1.0 / 1.8, 1, 1, 1]) ** 2 - 1.0)
    free = material.stress_and_tangent(E)[0]
    J = 1.0 - p / material.law.bulk
    pressed = E.copy()
    pressed[2] = 0.5 * ((J / 1.8) ** 2 - 1.0)
    S = material.stress_and_tangent(pressed)[0]
    squares = 1.0 + 2.0 * pressed[:3]
    change = (squares * S[:3] - (1.0 + 2.0 * E[:3]) * free[:3]) / J
    np.testing.assert_allclose(change, -p, rtol=1e-9)


# --- the element ----------------------------------------------------------------------------------


def deformed(shape, count=32):
    rng = np.random.default_rng(7)
    reference = make.flat_reference if shape == "flat" else make.curved_reference
    references, x = [reference(rng) for _ in range(count)], []
    for number, element in enumerate(references):
        size = (0.9, 1.0, 1.4, 2.0)[number % 4]
        a, b = size * (1.0 + 0.1 * rng.uniform(-1, 1, 2))
        gradient = np.diag([a, b, rng.uniform(0.97, 1.03) / (a * b)])
        gradient[0, 1] = 0.2 * rng.uniform(-1, 1)
        warp = rng.uniform(0.0, 0.05)
        x.append(make.deformed(rng, *element, gradient=gradient, warp=warp))
    return references, np.array(x)


@pytest.mark.parametrize("shape", ["flat", pytest.param("curved", marks=pytest.mark.slow)])
def test_the_kernel_is_the_reference_element_and_its_bound_holds(shape):
    """The bound of a film stretched to 2 is within some per cent: no step is given away."""
    material = MATERIALS["neo-hooke"]
    references, x = deformed(shape)
    X, fibres = (np.array(part) for part in zip(*references, strict=True))
    model = make.separate_elements(X, fibres, material, ElementOptions())
    kernel = make.corner_forces(model, make.positions_of(x))
    for element, nodes, found in zip(references, x, kernel, strict=True):
        expected = ReferenceElement(*element, material, ElementOptions()).evaluate(nodes)
        assert relative(found, expected.force) < 1e-10
    bound, true = make.bounds_and_frequencies(references, x, material)
    assert (bound / true).min() > 1.0 - 1e-6
    assert (bound / true).mean() < 1.1


def test_forces_derive_from_the_energy():
    references, x = deformed("flat", count=4)
    element = ReferenceElement(*references[2], MATERIALS["ogden of three"], ElementOptions())
    found = element.evaluate(x[2])
    slope = np.empty(24)
    for i in range(24):
        way = 1e-8 * np.eye(24)[i].reshape(8, 3)
        ends = [element.evaluate(x[2] + s * way) for s in (1, -1)]
        slope[i] = (ends[0].energy + ends[0].hourglass_energy) / 2e-8
        slope[i] -= (ends[1].energy + ends[1].hourglass_energy) / 2e-8
    assert relative(found.force.ravel(), slope) < 1e-6


@each_law
def test_bending_is_that_of_the_plain_matrix(material):
    plain = material.bending_matrix()
    np.testing.assert_array_equal(bending_bound(material.law), plain)
    np.testing.assert_array_equal(orthotropic_rows(bending_stiffness(material.law)), plain)


def test_a_thickness_that_vibrates_keeps_its_energy_at_three_steps_a_period():
    """A force that stiffens gives energy to it there: the reason for (J - 1)² (hyperelastic.py)."""
    text = """
    process = { time = "1 ms", frames = 2, mass_damping = "0 1/s" }
    blank = { size = ["5 mm", "5 mm"], edge_length = "2.5 mm" }
    [material]
    law = "neo-hooke"
    shear_modulus = "0.4 MPa"
    thickness = "1 mm"
    density = "1100 kg/m^3"
    """
    held = [Support("plane", np.arange(18), "xy")]
    simulation = Simulation(build_model(scene_from_text(text), lambda mesh: held))
    height = simulation.model.node_positions[:, 2]
    velocity = np.zeros((3, simulation.model.node_count))
    velocity[2] = 5.0 * np.sign(height)  # by a twentieth of the thickness to and fro
    simulation.set_velocity(velocity)
    start = 0.5 * (simulation.model.nodes.mass * velocity**2).sum()
    step = np.sqrt(3.0) / 2.0 * simulation.critical_step()
    largest = 0.0
    for _ in range(40):
        simulation.make_steps(25, step)
        energy = simulation.energy()
        largest = max(largest, abs(energy["balance_error"]))
    assert largest < 0.05 * start


# --- the scene ------------------------------------------------------------------------------------


def scene(material):
    text = (
        'process = { time = "2 ms" }\nblank = { size = ["30 mm", "20 mm"], edge_length = "5 mm" }\n'
    )
    return scene_from_text(f'{text}material = {{ thickness = "1 mm", {material} }}')


@pytest.mark.parametrize(
    ("material", "message"),
    [
        ('law = "neo-hooke", density = "1 g/cm^3"', "material.shear_modulus: is missing"),
        ('law = "ogden", density = "1 g/cm^3", mu = "1 2 MPa", alpha = [2.0]',
         r"material.alpha: has 1 exponents for 2 moduli"),
        ('law = "ogden", density = "1 g/cm^3", mu = "1 -2 MPa", alpha = [2.0, 2.0]',
         r"material.alpha: has 2 as entry \[1\], whose product .* is not above 0"),
        ('law = "ogden", density = "1 g/cm^3", mu = "1 1 1 1 MPa", alpha = [1.0, 2.0, 3.0, 4.0]',
         "material.mu: has 4 moduli; at most 3 are read"),
    ],
)  # fmt: skip
def test_a_law_that_cannot_be_is_refused(material, message):
    with pytest.raises(InputError, match=message):
        scene(material)


def test_the_published_hourglass_is_refused():
    mesh = (
        scene('law = "neo-hooke", density = "1 g/cm^3", shear_modulus = "1 MPa"')
        .stack[0]
        .build_blank()
    )
    with pytest.raises(InputError, match='is "published", which is derived for a diagonal'):
        assemble_sheet(mesh, MATERIALS["neo-hooke"], ElementOptions(hourglass="published"))
