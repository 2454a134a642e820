"""Elements of fibre families: kernel, plain element, tangent, energy, frequency; the fabric's."""

from __future__ import annotations

import numpy as np
import pytest
from of_families import across, fabric, fibres, like_md600, pair, triaxial, unidirectional

from lcmchain.elements.solid_shell.reference import ElementOptions, ReferenceElement
from lcmchain.elements.solid_shell.tangent import linearise, node_stiffness
from lcmchain.errors import InputError
from lcmchain.verification import random_elements as make

COUNT = 12
# a share of the fibres that is not that of the strips
OPTIONS = ElementOptions(fibre_hourglass=0.1)
THREE = fabric(
    fibres(10.0, compression=40.0),
    fibres(70.0, tension=None, compression=700.0)
    | {"tension_curve": {"strain": [0.005, 0.02], "stress": "1 20 MPa"}},
    fibres(-50.0),
    shear=[pair(1, 2, locking_angle="25 deg", locking_stiffness="80 MPa"), pair(2, 3)],
)

SPACED = fabric(fibres(20.0, compression=20.0), across=across(compressed="spacing"))


class Batch:
    """Formed elements that share no node: compacted, sheared, with fibres in compression too."""

    def __init__(self, material, options=OPTIONS):
        rng = np.random.default_rng(8)
        self.references = [make.curved_reference(rng) for _ in range(COUNT)]
        x = []
        for element in self.references:
            gradient = make.sheared(rng.uniform(-0.8, 0.8), 0.75, rng.uniform(0.99, 1.01))
            x.append(make.deformed(rng, *element, gradient=gradient, warp=0.06))
        self.x = np.array(x)
        X, self.fibres = (np.array(part) for part in zip(*self.references, strict=True))
        self.X, self.material, self.options = X, material, options
        self.model = make.separate_elements(X, self.fibres, material, options)
        self.positions = make.positions_of(self.x)
        self.curvature = make.random_curvature(rng, self.model)
        self.history = make.shared_history(self.model, self.curvature)

    def forces(self, x):
        return make.corner_forces(self.model, make.positions_of(x), self.history)

    def difference_tangents(self):
        step = 1e-6 * self.model.only_body().geometry.height.min()
        K = np.zeros((COUNT, 24, 24))
        for i, dx in enumerate(step * np.eye(24).reshape(24, 8, 3)):
            near = self.forces(self.x + dx) - self.forces(self.x - dx)
            far = self.forces(self.x + 2 * dx) - self.forces(self.x - 2 * dx)
            K[:, :, i] = ((8 * near - far) / (12 * step)).reshape(COUNT, 24)
        return K


@pytest.fixture(scope="module")
def batch():
    return Batch(THREE.build())


def test_the_kernel_agrees_with_the_plain_element(batch):
    force = batch.forces(batch.x)
    for k in range(COUNT):
        element = ReferenceElement(
            batch.X[k], batch.fibres[k], batch.material, OPTIONS, batch.curvature[k]
        )
        plain = element.evaluate(batch.x[k]).force
        np.testing.assert_allclose(force[k], plain, rtol=0.0, atol=1e-9 * abs(plain).max())


@pytest.mark.parametrize(
    "material", [unidirectional(20.0), pytest.param(SPACED, marks=pytest.mark.slow)],
    ids=["line", "spacing"],
)  # fmt: skip
def test_only_fibres_have_a_share_in_the_hourglass_stiffness(material):
    """A single family: what is across its fibres stabilises the element with its whole modulus."""
    own = Batch(material.build())
    force = own.forces(own.x)
    for k in range(COUNT):
        element = ReferenceElement(own.X[k], own.fibres[k], own.material, OPTIONS, own.curvature[k])
        plain = element.evaluate(own.x[k]).force
        np.testing.assert_allclose(force[k], plain, rtol=0.0, atol=1e-9 * abs(plain).max())


def test_two_families_at_a_right_angle_make_the_elements_of_the_fabric():
    ours = Batch(like_md600().build())
    plain = [
        ReferenceElement(ours.X[k], ours.fibres[k], make.md600(), OPTIONS, ours.curvature[k])
        for k in range(COUNT)
    ]
    force = ours.forces(ours.x)
    for k in range(COUNT):
        fabric_force = plain[k].evaluate(ours.x[k]).force
        scale = abs(fabric_force).max()
        np.testing.assert_allclose(force[k], fabric_force, rtol=0.0, atol=1e-10 * scale)


def test_the_tangent_is_the_derivative_of_the_forces_and_symmetric(batch):
    displacement = (batch.x - batch.X).reshape(-1, 3).T
    K = node_stiffness(linearise(batch.model, displacement, history=batch.history).stiffness)
    expected = batch.difference_tangents()
    scale = abs(expected).max(axis=(1, 2))[:, None, None]
    np.testing.assert_allclose(K / scale, expected / scale, rtol=0.0, atol=1e-6)
    assert abs(K - K.transpose(0, 2, 1)).max() < 1e-12 * abs(K).max()


@pytest.mark.slow
@pytest.mark.parametrize("material", [THREE, SPACED], ids=["three", "spacing"])
def test_forces_derive_from_the_energy(material):
    """Work of the forces along a straight path against the change of the stored energies."""
    batch = Batch(material.build())
    body = batch.model.only_body()
    start = batch.X + 0.97 * (batch.x - batch.X)
    points, weights = np.polynomial.legendre.leggauss(3)
    work, pieces = 0.0, 40  # a modulus may jump within a piece
    for piece in range(pieces):
        for point, weight in zip(points, weights, strict=True):
            x = start + (piece + 0.5 * (1.0 + point)) / pieces * (batch.x - start)
            work += 0.5 * weight / pieces * np.sum(batch.forces(x) * (batch.x - start))
    energy = [
        sum(body.stored_energy(make.positions_of(x), batch.history)) for x in (start, batch.x)
    ]
    assert work == pytest.approx(energy[1] - energy[0], rel=1e-6)


@pytest.mark.slow
def test_the_frequency_bound_is_never_too_low(batch):
    jump = (THREE.build(), unidirectional(30.0).build(), SPACED.build())
    for material in (*jump, triaxial(10.0, shear=[pair(1, 2), pair(2, 3)]).build()):
        bound, true = make.bounds_and_frequencies(
            batch.references, batch.x, material, OPTIONS, np.random.default_rng(3)
        )
        ratio = bound / true
        assert ratio.min() > 1.0 - 1e-6
        # fibres that may become stiffer are bounded as if they were
        assert material in jump or ratio.mean() < 1.3


@pytest.mark.slow
def test_fibres_in_compression_count_with_the_modulus_of_tension(batch):
    """They come into tension within a step: squeezed elements have the bound of stretched ones."""
    material = unidirectional().build()
    squeezed, stretched = [], []
    for nodes, fibre in batch.references:
        for found, factor in ((squeezed, 0.999), (stretched, 1.001)):
            gradient = np.diag([factor, 1.0, 1.0])
            rng = np.random.default_rng(1)
            found.append(make.deformed(rng, nodes, fibre, gradient=gradient, warp=0.0))
    bounds = [
        make.bounds_and_frequencies(batch.references, x, material, OPTIONS)[0]
        for x in (squeezed, stretched)
    ]
    np.testing.assert_allclose(*bounds, rtol=0.02)


def test_published_hourglass_forces_are_refused():
    with pytest.raises(InputError, match="derived for a diagonal stiffness") as caught:
        Batch(THREE.build(), ElementOptions(hourglass="published"))
    assert caught.value.key == "element.hourglass"
