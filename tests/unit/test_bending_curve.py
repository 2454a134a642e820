"""Bending by a measured curve: the curve, strips under their weight, and what is refused."""

from __future__ import annotations

import tomllib

import numpy as np
import pytest

from lcmchain.coupons.analytic import (
    CANTILEVER_ANGLE,
    MomentCurve,
    curve_elastica,
    elastica,
    overhang_at_angle,
    overhang_by_curve,
)
from lcmchain.coupons.cantilever import bent_strip
from lcmchain.effects.supports import Support
from lcmchain.errors import InputError
from lcmchain.identification.from_file import identify_bending_file
from lcmchain.identification.result import FitRefusedError
from lcmchain.materials.features.bending_curve import (
    KINKS,
    BendingCurve,
    curve_energy,
    curve_response,
)
from lcmchain.materials.law import bending_excess, bending_stress
from lcmchain.model import build_model
from lcmchain.scene import Element, scene_from_text
from lcmchain.solver.simulation import Simulation

# Measured on a ply of 1 mm and 1385 kg/m³, moment per width over curvature.
CURVATURE = "2 2.5 3 4 5 7.5 10 15 20 21.3 1/m"
MOMENT = "0.2384 0.2863 0.2982 0.3117 0.3211 0.3372 0.3486 0.3665 0.3825 0.3868 N"
POINTS = MomentCurve(*([float(x) for x in text.split()[:-1]] for text in (CURVATURE, MOMENT)))
GRAVITY = 9.82
# Static elastica of the measured curve: tip x and drop [mm] by overhang [m].
TIPS = {0.150: (149.80, 7.21), 0.200: (198.54, 22.58), 0.250: (226.88, 102.1)}


def scene(curvature=CURVATURE, moment=MOMENT, *, size="20 mm", process='time = "1 s"', more=""):
    # stiff in transverse shear, as the elastica is
    return scene_from_text(f"""
{more}
process = {{ {process} }}
blank = {{ size = ["{size}", "20 mm"], edge_length = "5 mm" }}
[material]
preset = "MD600"
thickness = "1 mm"
areal_mass = "1.385 kg/m^2"
membrane.C13 = "20 MPa"
bending.C13 = "20 MPa"
bending.curve_1 = {{ curvature = "{curvature}", moment = "{moment}" }}
""")


def material():
    return scene().material.build()


def test_a_curve_goes_through_its_points_with_the_energy_below_it():
    numbers = BendingCurve(tuple(POINTS.curvature), tuple(POINTS.moment)).numbers(1e-3)
    size, slope = curve_response(numbers, POINTS.curvature)
    np.testing.assert_allclose(size * 1e-9 / 12.0, POINTS.moment, rtol=1e-12)
    assert (slope > 0.0).all()
    grid = np.linspace(-30.0, 30.0, 60_001)
    f = curve_response(numbers, grid)[0]
    np.testing.assert_allclose(f, -f[::-1], rtol=1e-11)
    energy = np.concatenate([[0.0], np.cumsum(0.5 * np.diff(grid) * (f[1:] + f[:-1]))])
    found = curve_energy(numbers, grid)
    np.testing.assert_allclose(found - found[0], energy, atol=1e-6 * found.max())


@pytest.mark.parametrize("curvature", [0.0, 1.0, -2.3, 4.5, -16.0, 30.0])
def test_the_compiled_law_agrees_with_numpy(curvature):
    own = material()
    height = 0.45e-3  # of an element that is thinner than the fabric
    E = np.array([curvature * height, -0.4 * curvature * height, 0.01, 0.02, -0.03, 0.04])
    S, _, excess = own.bending_response(E, height)
    C_B = tuple(np.diag(own.bending_matrix()))
    found = bending_stress(own.law, C_B, tuple(E), 1.0 / height)
    np.testing.assert_allclose(found, S, rtol=1e-12, atol=1e-9)
    scale = abs(S @ E)
    assert bending_excess(own.law, tuple(E), 1.0 / height) == pytest.approx(
        float(excess), rel=1e-10, abs=1e-12 * scale + 1e-300
    )


@pytest.mark.parametrize("overhang", TIPS)
def test_a_strip_hangs_as_its_measured_curve_says(overhang):
    """2 % of the drop from the reference, 0.2 % from the elastica of the same points."""
    reach, drop = TIPS[overhang]
    strip = bent_strip(
        scene().material, Element(), 0.0, overhang=overhang, width=0.02, edge_length=5e-3,
        gravity=GRAVITY,
    )  # fmt: skip
    assert 1e3 * strip.line[-1, 1] == pytest.approx(drop, rel=0.02)
    assert 1e3 * strip.line[-1, 0] == pytest.approx(reach, rel=0.002)
    shape = curve_elastica(POINTS, 1.385 * GRAVITY, overhang)
    assert strip.line[-1, 1] == pytest.approx(overhang * shape.y[-1], rel=2e-3)


def test_the_elastica_of_a_straight_curve_is_the_heavy_one():
    straight = MomentCurve((1.0, 4.0), (0.12, 0.48))
    weight = 13.6
    found = overhang_by_curve(straight, weight, CANTILEVER_ANGLE)
    assert found == pytest.approx(
        float(overhang_at_angle(0.12, weight, CANTILEVER_ANGLE)), rel=1e-7
    )


@pytest.mark.slow
@pytest.mark.parametrize(("overhang", "time"), [(0.150, 1.0), (0.200, 1.7), (0.250, 2.5)])
def test_a_strip_that_is_let_go_comes_to_hang_as_its_curve_says(overhang, time):
    """In the forming solver: damped to rest, 2 % of the drop, the work all accounted for."""

    def clamp(mesh):
        held = np.flatnonzero(mesh.node_positions[:, 0] < -0.5 * overhang + 1e-9)
        return [Support("clamp", held, "xyz")]

    process = f'time = "{time} s", gravity = true, mass_damping = "30 1/s"'
    let_go = scene(size=f"{1e3 * overhang:g} mm", process=process)
    sim = Simulation(build_model(let_go, clamp))
    sim.advance_to(time)
    mesh = sim.model.only_body().mesh
    tip = mesh.node_positions[:, 0] > 0.5 * overhang - 1e-9
    x, _, z = sim.state.position[:, tip].mean(axis=1)
    reach, drop = TIPS[overhang]
    assert -1e3 * z == pytest.approx(drop, rel=0.02)
    assert 1e3 * (x + 0.5 * overhang) == pytest.approx(reach, rel=0.005)
    energy = sim.energy()
    assert energy["kinetic"] < 1e-4 * energy["internal"]
    assert abs(energy["balance_error"]) < 1e-3 * energy["internal"]


@pytest.mark.parametrize(
    ("curvature", "moment", "words"),
    [
        ("2 4 1/m", "0.2 0.3 0.35 N", "3 moments for 2 curvatures"),
        ("2 4 3 1/m", "0.2 0.3 0.35 N", "does not rise at point 3"),
        ("2 4 5 1/m", "0.2 0.3 0.2 N", "does not rise at point 3"),
        ("2 4 5 1/m", "0.2 0.3 0.6 N", "is steepest at point 3"),
    ],
)
def test_a_wrong_curve_is_refused(curvature, moment, words):
    with pytest.raises(InputError, match=words) as error:
        scene(curvature, moment)
    assert "material.bending.curve_1.moment" in str(error.value)


def test_more_points_than_a_kernel_holds_are_refused():
    count = KINKS + 1
    x = np.arange(1, count + 1)
    with pytest.raises(InputError, match=f"has {count} points; give 1 to {KINKS}"):
        scene(" ".join(map(str, x)) + " 1/m", " ".join(f"{v:.3f}" for v in np.sqrt(x)) + " N")


def test_elements_without_thickness_refuse_a_curve():
    with pytest.raises(InputError, match="follows a curve"):
        build_model(scene(more='element = "membrane-shell"'))


def hanging_strips(path, *, noise=0.02e-3, break_at=None):
    """Deflection curves: the measured ply, 250 mm, and one of constant stiffness, 200 mm."""
    shape = curve_elastica(POINTS, 1.385 * 9.80665, 0.25)
    rng = np.random.default_rng(3)
    rows = ["specimen,orientation [deg],x [mm],y [mm]"]
    straight = elastica(13.58 * 0.2**3 / 0.1192)
    strips = ("a", 0, shape, 250.0), ("b", 90, straight, 200.0)
    for name, degrees, own, length in strips:
        for k in range(0, shape.x.size, 4):
            x, y = length * own.x[k], length * own.y[k]
            if break_at is not None and k > break_at:
                y += 0.15 * (x - length * own.x[break_at])
            x, y = np.array([x, y]) + (1e3 * noise * rng.standard_normal(2) if k else 0.0)
            rows.append(f"{name},{degrees},{x:.4f},{y:.4f}")
    path.write_text("\n".join(rows) + "\n", encoding="utf-8")
    return path


SIZES = {"areal_mass": "1385 g/m^2", "thickness": "1 mm"}


def test_the_curve_is_found_from_a_strip_that_hangs(tmp_path):
    """Moments within 10 % from a curvature of 1 1/m on, strips of other lengths within 3 %."""
    file = hanging_strips(tmp_path / "strips.csv")
    with pytest.raises(FitRefusedError, match="--curve"):
        identify_bending_file(file, SIZES)
    found = identify_bending_file(file, SIZES, curve=True)
    snippet = tomllib.loads("\n".join(f"{k} = {v}" for k, v in found.scene_entries.items()))
    curvature, moment = (
        np.array([float(value) for value in snippet["curve_1"][key].split()[:-1]])
        for key in ("curvature", "moment")
    )
    bent = np.linspace(1.0, 18.0, 100)
    own = np.interp(bent, np.append(0.0, curvature), np.append(0.0, moment))
    true = np.interp(bent, np.append(0.0, POINTS.curvature), np.append(0.0, POINTS.moment))
    np.testing.assert_allclose(own, true, rtol=0.1)
    for overhang in (0.15, 0.2):
        drop, expected = (
            curve_elastica(curve, 1.385 * GRAVITY, overhang).y[-1]
            for curve in (MomentCurve(curvature, moment), POINTS)
        )
        assert drop == pytest.approx(expected, rel=0.03)
    scene(snippet["curve_1"]["curvature"], snippet["curve_1"]["moment"])
    assert not any("M/kappa" in warning for warning in found.warnings)


def test_a_strip_that_no_curve_describes_is_refused(tmp_path):
    """A crease: half way along it hangs on at another slope."""
    file = hanging_strips(tmp_path / "creased.csv", break_at=100)
    with pytest.raises(FitRefusedError, match="beside the shape by its curve"):
        identify_bending_file(file, SIZES, curve=True)


def test_overhangs_alone_give_no_curve(tmp_path):
    file = tmp_path / "overhang.csv"
    file.write_text("orientation [deg],overhang [mm]\n0,100\n90,110\n0,101\n90,111\n")
    with pytest.raises(InputError, match="no deflection curves"):
        identify_bending_file(file, SIZES, curve=True)
