"""Permeability laws against tabulated values, their limits, and the axes of a sheared textile."""

from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lcmchain.coupling.permeability import (
    TOUCHING,
    PermeabilityLaw,
    aligned_permeabilities,
    gebart,
    kozeny_carman,
    principal_permeabilities,
)
from lcmchain.errors import InputError

# Fibre radius 3.5 um; fraction: along quadratic, along hexagonal, across quadratic, hexagonal.
GEBART = {
    0.30: (6.552e-12, 7.047e-12, 1.472e-12, 1.327e-12),
    0.40: (2.321e-12, 2.496e-12, 4.999e-13, 5.148e-13),
    0.45: (1.413e-12, 1.519e-12, 2.864e-13, 3.228e-13),
    0.50: (8.596e-13, 9.245e-13, 1.583e-13, 2.004e-13),
    0.55: (5.179e-13, 5.570e-13, 8.229e-14, 1.217e-13),
    0.60: (3.057e-13, 3.287e-13, 3.865e-14, 7.135e-14),
    0.65: (1.745e-13, 1.876e-13, 1.520e-14, 3.955e-14),
    0.70: (9.474e-14, 1.019e-13, 4.188e-15, 2.011e-14),
}
X, Y, Z = np.eye(3)


def sheared(angle):
    """Two families, shape (1, 3), closed by the shear angle [rad] from the right angle."""
    return X[None], np.array([[np.sin(angle), np.cos(angle), 0.0]])


@pytest.mark.parametrize("fraction", GEBART)
def test_gebart_gives_the_tabulated_values(fraction):
    along_q, along_h, across_q, across_h = GEBART[fraction]
    np.testing.assert_allclose(gebart(fraction, 3.5e-6, "quadratic"), (along_q, across_q), 5e-4)
    np.testing.assert_allclose(gebart(fraction, 3.5e-6, "hexagonal"), (along_h, across_h), 5e-4)


@pytest.mark.parametrize("packing", TOUCHING)
def test_flow_across_the_fibres_stops_where_they_touch(packing):
    touching = TOUCHING[packing]
    along, across = gebart(np.array([touching - 1e-9, touching, touching + 1e-9]), 1e-6, packing)
    assert 0.0 < across[0] < 1e-30
    assert across[1] == 0.0
    assert along[1] > 0.0
    assert np.isnan(across[2]) and np.isnan(along[2])


def test_kozeny_carman_by_hand():
    # r = 4 um, v = 1/2, k = 1/2: r^2 / (4 k) * (1/8) / (1/4) = 16e-12 / 2 / 2
    assert kozeny_carman(0.5, 4e-6, 0.5) == pytest.approx(4e-12, rel=1e-14)
    law = PermeabilityLaw("kozeny_carman", 4e-6, k_along=0.5, k_across=10.0)
    along, across = aligned_permeabilities(law, 0.5)
    assert along / across == pytest.approx(20.0)


@given(st.floats(0.05, 0.78), st.sampled_from(["gebart", "kozeny_carman"]))
def test_denser_beds_conduct_less_and_better_along_the_fibres(fraction, name):
    law = PermeabilityLaw(name)
    along, across = aligned_permeabilities(law, np.array([fraction, fraction + 0.005]))
    assert along[1] < along[0] and across[1] < across[0]
    assert np.all(along > across) or fraction < 0.2  # gap lubrication fails for loose beds


@pytest.mark.parametrize("name", ["gebart", "kozeny_carman"])
def test_permeability_scales_with_the_square_of_the_fibre_radius(name):
    thin = aligned_permeabilities(PermeabilityLaw(name, 1e-6), 0.5)
    thick = aligned_permeabilities(PermeabilityLaw(name, 3e-6), 0.5)
    np.testing.assert_allclose(thick, 9.0 * np.array(thin), rtol=1e-12)


def test_out_of_range_names_the_cells_and_the_limit():
    fraction = np.array([0.5, 0.8, 0.6, 0.9])
    with pytest.raises(InputError, match=r"0\.785.*2 cells.*cell 1, 3; the worst is 3 with 0\.900"):
        aligned_permeabilities(PermeabilityLaw(), fraction)
    with pytest.raises(InputError, match="1 cells"):
        aligned_permeabilities(PermeabilityLaw(), np.array([0.5, 0.0]))
    along, across = aligned_permeabilities(PermeabilityLaw(), fraction, out_of_range="nan")
    np.testing.assert_array_equal(np.isnan(along), [False, True, False, True])
    np.testing.assert_array_equal(np.isnan(across), [False, True, False, True])
    hexagonal = PermeabilityLaw(packing="hexagonal")
    assert np.isfinite(aligned_permeabilities(hexagonal, fraction)).all()


def test_unmapped_cells_stay_without_a_value():
    along, _ = aligned_permeabilities(PermeabilityLaw(), np.array([0.5, np.nan]))
    np.testing.assert_array_equal(np.isnan(along), [False, True])


@pytest.mark.parametrize(
    "wrong",
    [{"law": "gebhart"}, {"packing": "cubic"}, {"fibre_radius": 0.0}, {"k_across": -1.0}],
)
def test_wrong_laws_are_refused(wrong):
    with pytest.raises(InputError, match=f"permeability.{next(iter(wrong))}"):
        PermeabilityLaw(**wrong)


def test_the_entry_of_a_scene_serves_as_law():
    entry = SimpleNamespace(law="gebart", fibre_radius=3.5e-6, packing="hexagonal", k_along=None)
    along, _ = aligned_permeabilities(entry, 0.5)
    assert along == pytest.approx(9.245e-13, rel=5e-4)


def test_unsheared_textile_is_isotropic_in_its_plane():
    law = PermeabilityLaw()
    found = principal_permeabilities(law, np.array([0.5]), *sheared(0.0))
    along, across = aligned_permeabilities(law, 0.5)
    assert found.k1 == pytest.approx(0.5 * (along + across), rel=1e-14)
    assert found.k2 == pytest.approx(found.k1, rel=1e-14)
    assert found.k3 == pytest.approx(across, rel=1e-14)


@given(
    st.floats(-1.3, 1.3),
    st.lists(st.floats(-1.0, 1.0), min_size=3, max_size=3),
    st.booleans(),
    st.booleans(),
)
def test_principal_values_and_axes_are_those_of_the_mean_tensor(shear, turn, flip_1, flip_2):
    law, fraction = PermeabilityLaw(), np.array([0.5])
    rotation, _ = np.linalg.qr(np.diag(np.ones(3)) + np.cross(np.eye(3), turn))
    a1, a2 = (a @ rotation.T for a in sheared(shear))
    found = principal_permeabilities(
        law, fraction, -a1 if flip_1 else a1, -a2 if flip_2 else a2
    )  # fmt: skip
    along, across = aligned_permeabilities(law, fraction)
    plies = [across[0] * np.eye(3) + (along - across)[0] * np.outer(a[0], a[0]) for a in (a1, a2)]
    tensor = 0.5 * (plies[0] + plies[1])
    values = [found.k1[0], found.k2[0], found.k3[0]]
    axes = [found.direction_1[0], found.direction_2[0], found.direction_3[0]]
    rebuilt = sum(k * np.outer(e, e) for k, e in zip(values, axes, strict=True))
    np.testing.assert_allclose(rebuilt, tensor, rtol=0.0, atol=1e-10 * along[0])
    assert values[0] >= values[1] >= values[2] * (1.0 - 1e-12)
    np.testing.assert_allclose(np.array(axes) @ np.array(axes).T, np.eye(3), atol=1e-10)
