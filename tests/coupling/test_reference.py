"""The reference of the filling itself: closed solutions, convergence, a peer, invariance."""

import numpy as np
import pytest

PHI, MU, K, DP = 0.5, 0.1, 1e-10, 1e5
ISOTROPIC = K * np.eye(3)


def plate(columns, rows, length=0.3, width=0.1, skew=0.0):
    """Points (N, 3), quadrilaterals (C, 4) of a rectangle; inner nodes are moved by ``skew``."""
    x, y = np.meshgrid(np.linspace(0, length, columns + 1), np.linspace(0, width, rows + 1))
    inner = (x > 0) & (x < length) & (y > 0) & (y < width)
    random = np.random.default_rng(3).uniform(-1.0, 1.0, (2, *x.shape)) * skew * inner
    x, y = x + random[0] * length / columns, y + random[1] * width / rows
    node = np.arange(x.size).reshape(x.shape)
    cells = np.stack([node[:-1, :-1], node[:-1, 1:], node[1:, 1:], node[1:, :-1]], axis=-1)
    return np.stack([x.ravel(), y.ravel(), 0 * x.ravel()], axis=1), cells.reshape(-1, 4)


def ring(radial, around, inner=0.01, outer=0.2):
    radius = inner * (outer / inner) ** np.linspace(0, 1, radial + 1)
    angle = 2 * np.pi * np.arange(around) / around
    points = np.stack(
        [np.outer(radius, np.cos(angle)), np.outer(radius, np.sin(angle)),
         np.zeros((radial + 1, around))], axis=-1,
    ).reshape(-1, 3)  # fmt: skip
    node = np.arange(points.shape[0]).reshape(radial + 1, around)
    beside = np.roll(node, -1, axis=1)
    cells = np.stack([node[:-1], node[1:], beside[1:], beside[:-1]], axis=-1).reshape(-1, 4)
    return points, cells, np.arange(around)


def model(reference, points, cells, gate, permeability=ISOTROPIC, **changes):
    points, triangles, _ = reference.triangles_of(points, cells)
    given = {"thickness": 3e-3, "porosity": PHI, "viscosity": MU, "pressure": DP} | changes
    return reference.HeleShaw(
        points, triangles, permeability=permeability, gate_nodes=gate, **given
    )


def left(points):
    return np.flatnonzero(points[:, 0] < 1e-9)


def test_straight_filling_takes_the_closed_time(reference):
    errors = []
    for columns in (12, 24, 48):
        points, cells = plate(columns, columns // 3, skew=0.3)
        errors.append(abs(model(reference, points, cells, left(points)).fill_time / 225.0 - 1.0))
    assert errors[-1] < 0.001
    assert np.log2(errors[0] / errors[2]) / 2 > 1.5


@pytest.mark.parametrize("time", [10.0, 50.0, 100.0, 200.0])
def test_the_front_of_a_straight_filling(reference, time):
    points, cells = plate(60, 6, skew=0.2)
    found = model(reference, points, cells, left(points)).wet_volume(time)
    front = found / (PHI * 0.1 * 3e-3)
    assert front == pytest.approx(np.sqrt(2 * K * DP * time / (PHI * MU)), rel=0.005)


def closed_radial_time(radius, start=0.01):
    return (
        PHI * MU / (2 * K * DP) * (radius**2 * np.log(radius / start) - (radius**2 - start**2) / 2)
    )


def test_radial_filling_takes_the_closed_time_and_keeps_the_front(reference):
    errors = []
    for count in (10, 20, 40):
        points, cells, gate = ring(count, 3 * count)
        radial = model(reference, points, cells, gate)
        errors.append(abs(radial.fill_time / closed_radial_time(0.2) - 1.0))
    assert errors[-1] < 0.005
    assert np.log2(errors[0] / errors[2]) / 2 > 1.5
    points, cells, gate = ring(20, 60)
    radial = model(reference, points, cells, gate)
    for radius in (0.08, 0.15):
        volume = radial.wet_volume(closed_radial_time(radius))
        whole = np.pi * (radius**2 - 0.01**2) * PHI * 3e-3
        assert volume == pytest.approx(whole, rel=0.01)


def test_a_stretched_isotropic_sheet_is_an_orthotropic_one(reference):
    """Exact for any mesh: stretching the sheet is the same as changing its permeability."""
    points, cells = plate(14, 6, skew=0.3)
    stretched = points * [2.0, 0.5, 1.0]
    turn = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))[0]
    tensor = turn @ np.diag([4.0 * K, 0.25 * K, K]) @ turn.T
    plain = model(reference, points, cells, left(points))
    turned = model(reference, stretched @ turn.T, cells, left(points), tensor)
    assert turned.fill_time == pytest.approx(plain.fill_time, rel=1e-10)
    np.testing.assert_allclose(turned.fill(60.0), plain.fill(60.0), atol=1e-8)


def test_a_rolled_plate_fills_as_a_flat_one(reference):
    points, cells = plate(30, 8, skew=0.0)
    radius = 0.12  # chords: roll the strip between the columns, so that no cell is bent
    angle = 0.3 / 30 / radius
    column = np.round(points[:, 0] / 0.01).astype(int)
    at = np.array([[0.0, 0.0]] + [
        [0.01 * np.cos(k * angle), 0.01 * np.sin(k * angle)] for k in range(30)
    ]).cumsum(axis=0)  # fmt: skip
    rolled = np.stack([at[column, 0], points[:, 1], at[column, 1]], axis=1)
    flat = model(reference, points, cells, left(points))
    bent = model(reference, rolled, cells, left(points))
    assert bent.fill_time == pytest.approx(flat.fill_time, rel=1e-10)


def test_the_last_pore_fills_at_the_fill_time(reference):
    points, cells = plate(20, 9, skew=0.3)
    corner = np.flatnonzero((points[:, 0] < 0.05) & (points[:, 1] < 1e-9))
    corner_gate = model(reference, points, cells, corner)
    end = corner_gate.fill_time
    assert corner_gate.fill(1.0001 * end).min() == 1.0
    assert corner_gate.fill(0.98 * end).min() < 1.0
    volumes = [corner_gate.wet_volume(share * end) for share in (0.1, 0.3, 0.6, 0.9)]
    assert np.all(np.diff(volumes) > 0.0)


def test_a_peer_finds_the_same_fill_time(reference):
    """scikit-fem, quadratic elements, permeability that turns over the sheet."""
    skfem = pytest.importorskip("skfem")
    from skfem.helpers import dot, grad, mul

    def tensor(x, y):
        turn = 8.0 * x + 5.0 * y
        c, s = np.cos(turn), np.sin(turn)
        k1, k2 = 2.0 * K, 0.4 * K
        return np.array([
            [k1 * c**2 + k2 * s**2, (k1 - k2) * c * s], [(k1 - k2) * c * s, k1 * s**2 + k2 * c**2]
        ])  # fmt: skip

    points, cells = plate(48, 16)
    cut, triangles, _ = reference.triangles_of(points, cells)
    centre = cut[triangles].mean(axis=1)
    in_space = np.zeros((len(triangles), 3, 3))
    in_space[:, :2, :2] = np.moveaxis(tensor(centre[:, 0], centre[:, 1]), -1, 0)
    own = model(reference, points, cells, left(points), in_space)

    basis = skfem.Basis(skfem.MeshTri(cut[:, :2].T, triangles.T), skfem.ElementTriP2())
    stiffness = skfem.BilinearForm(
        lambda u, v, w: dot(mul(tensor(*w.x) / MU, grad(u)), grad(v))
    ).assemble(basis)
    load = skfem.LinearForm(lambda v, w: PHI * v).assemble(basis)
    held = basis.get_dofs(lambda x: x[0] < 1e-9)
    solution = skfem.solve(*skfem.condense(stiffness, load, D=held))
    assert own.fill_time == pytest.approx(solution.max() / DP, rel=0.003)
