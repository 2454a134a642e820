"""Compaction of sheared fabric by a table: its points, its potential, and the compiled law."""

from __future__ import annotations

import math

import numpy as np
import pytest
import xarray as xr
from pydantic import ValidationError

from lcmchain.coupling.solids.stack_compaction import of_cells
from lcmchain.coupons.compaction import compaction
from lcmchain.elements.solid_shell.reference import ElementOptions, ReferenceElement
from lcmchain.errors import InputError, SimulationError
from lcmchain.fmu.build import stage_scene
from lcmchain.identification.data import CouponData
from lcmchain.identification.from_file import identify_compaction_file
from lcmchain.identification.result import FitRefusedError
from lcmchain.identification.sheared_compaction import (
    identify_pressure_table,
    identify_sheared_compaction,
)
from lcmchain.judgements import fields as field_judgements
from lcmchain.materials.fabric import FabricCompaction
from lcmchain.materials.features.pressure_curves import PressureCurve
from lcmchain.materials.features.pressure_table import PressureTable
from lcmchain.materials.features.shear_compaction import PowerCoupling
from lcmchain.materials.law import (
    hourglass_tangent,
    membrane_response,
    tangent_coupling,
    tangent_curvature,
    tangent_slope,
)
from lcmchain.pipeline import input_files
from lcmchain.scene import read_scene, scene_from_text
from lcmchain.scene.reading.single_tables import formed_material, formed_plies
from lcmchain.verification import random_elements as make

MD600 = (0.1563e6, 60.4653, 2.4528)
ANGLES = (0.0, 15.0, 30.0, 45.0)
# over the free thickness
STRETCHES = (1.0, 0.96, 0.9, 0.82, 0.72, 0.62)


def stiffening(degrees):
    """β that changes with the angle, and pressures that grow with it: no exponent describes it."""
    square = math.sin(math.radians(degrees)) ** 2
    return 0.7 + 0.6 * square, 1.0 + square


def measured(degrees, stretches=STRETCHES, law=stiffening):
    """A curve at a shear angle: Eq. (23) of the fabric at the strain that β of the angle gives."""
    angle, (beta, factor) = math.radians(degrees), law(degrees)
    free = math.cos(angle) ** -beta
    stretch = free * np.array(stretches)
    fabric = make.md600(coupling=PowerCoupling(beta))
    pressure = fabric.compaction_pressure(stretch, None, math.sin(angle)) / math.cos(angle)
    grows = 1.0 + 0.3 * (1.0 - np.array(stretches))
    return PressureCurve(angle, tuple(stretch), (0.0, *(factor * grows * pressure)[1:]))


@pytest.fixture(scope="module")
def table():
    return PressureTable([measured(degrees) for degrees in ANGLES], *MD600)


@pytest.fixture(scope="module")
def fabric(table):
    return make.md600(coupling=table)


def voigt(E33, g):
    E = np.zeros((np.size(g), 6))
    E[:, 2], E[:, 3] = E33, g
    return E


def scene_text(curves, entries=""):
    rows = "".join(
        f"""
[[material.compaction.table]]
shear_angle = "{math.degrees(curve.shear_angle)!r} deg"
stretch = {list(map(float, curve.stretch))}
pressure = "{" ".join(f"{1e-6 * p!r}" for p in map(float, curve.pressure))} MPa"
"""
        for curve in curves
    )
    return f"""
title = "table"
process = {{ time = "1 ms" }}
blank = {{ size = ["20 mm", "20 mm"], edge_length = "5 mm" }}
[material]
preset = "MD600"
{entries}
{rows}
"""


def test_the_law_meets_the_points_of_its_table(table, fabric):
    for curve in table.curves:
        g, cos = math.sin(curve.shear_angle), math.cos(curve.shear_angle)
        found = fabric.compaction_pressure(curve.stretch, None, g) / cos
        np.testing.assert_allclose(found[1:], curve.pressure[1:], rtol=1e-9)
        assert abs(found[0]) < 1.0 and table.free_stretch(g) == pytest.approx(curve.stretch[0])
        E33 = 0.5 * (np.array(curve.stretch) ** 2 - 1.0)
        stress = fabric.stress_and_tangent(voigt(E33, np.full(E33.shape, g)))[0][:, 2]
        np.testing.assert_allclose(-stress[1:] * curve.stretch[1:] / cos, curve.pressure[1:], 1e-9)


@pytest.mark.parametrize("beta", [0.5, 1.7])
def test_a_table_of_an_exponent_is_that_exponent(beta):
    """At any thickness and shear, also beyond the table: f = x and L = β s are exact."""
    plain = [measured(degrees, law=lambda _: (beta, 1.0)) for degrees in (0.0, 20.0, 40.0)]
    grows = 1.0 + 0.3 * (1.0 - np.array(STRETCHES))
    curves = [own._replace(pressure=tuple(np.array(own.pressure) / grows)) for own in plain]
    tabled = make.md600(coupling=PressureTable(curves, *MD600))
    exact = make.md600(coupling=PowerCoupling(beta))
    for g in (0.1, 0.45, 0.8, 0.97):
        E = voigt(np.array([-0.3, -0.1, 0.2]), np.full(3, g))
        for ours, theirs in zip(
            tabled.stress_and_tangent(E), exact.stress_and_tangent(E), strict=True
        ):
            np.testing.assert_allclose(ours, theirs, rtol=1e-8, atol=1e-4)


def test_between_its_points_a_finer_table_errs_less():
    """A third angle divides the error of p by 4, a fourth by 10; five points leave 0.2 %."""

    def error(angles, count):
        strain = -0.3 * np.linspace(0.0, 1.0, count + 1)
        stretches = np.sqrt(1.0 + 2.0 * strain)
        fine = PressureTable([measured(d, stretches) for d in angles], *MD600)
        own = make.md600(coupling=fine)
        worst = 0.0
        for degrees in (9.0, 22.0, 37.0):
            exact = measured(degrees, (1.0, 0.93, 0.86, 0.77, 0.67))
            g, cos = math.sin(exact.shear_angle), math.cos(exact.shear_angle)
            found = own.compaction_pressure(exact.stretch, None, g) / cos
            worst = max(worst, *np.abs(found / np.maximum(exact.pressure, 1.0) - 1.0)[1:])
        return worst

    assert error((0.0, 45.0), 5) > 4.0 * error((0.0, 25.0, 45.0), 5)
    assert error((0.0, 25.0, 45.0), 5) > 10.0 * error(ANGLES, 5)
    assert error(ANGLES, 2) > 8.0 * error(ANGLES, 3) > 16.0 * error(ANGLES, 5)
    assert error(ANGLES, 5) < 2e-3


def test_stress_and_tangent_follow_from_the_energy(fabric):
    """By central differences of order four, within the table, free, and beyond it: to 1e-9.

    No knot of the map is within their steps, so that they err by 1e-11.
    """
    h = 1e-4

    def slope_of(function, E33, g, along):
        def at(step):
            return function(E33 + step * (along == 2), g + step * (along == 3))

        return (8.0 * (at(h) - at(-h)) - (at(2 * h) - at(-2 * h))) / (12.0 * h)

    def energy(E33, g):
        return float(fabric.membrane_energy(voigt(E33, g))[0])

    def stress(component):
        return lambda E33, g: float(fabric.stress_and_tangent(voigt(E33, g))[0][0, component])

    def stabilising(k):
        return lambda E33, g: float(
            fabric.stabilising_tangent(voigt(E33, g))[k][0, 2, ...].flat[2 if k == 0 else 0]
        )

    def coupling(k):
        return lambda E33, g: float(fabric.tangent_coupling(voigt(E33, g))[k][0])

    for E33, g in [(-0.25, 0.3), (-0.2, -0.6), (-0.05, 0.65), (0.4, 0.2), (-0.1, 0.85)]:
        S, C = (values[0] for values in fabric.stress_and_tangent(voigt(E33, g)))
        _, slope, curvature = (values[0] for values in fabric.stabilising_tangent(voigt(E33, g)))
        for component in (2, 3):
            assert slope_of(energy, E33, g, component) == pytest.approx(S[component], rel=1e-9)
            for other in (2, 3):
                found = slope_of(stress(component), E33, g, other)
                assert found == pytest.approx(C[component, other], rel=1e-9)
        assert slope_of(stabilising(0), E33, g, 2) == pytest.approx(slope[2], rel=1e-8, abs=1e-3)
        assert slope_of(stabilising(0), E33, g, 3) == pytest.approx(coupling(0)(E33, g), rel=1e-8)
        found = slope_of(stabilising(1), E33, g, 2)
        assert found == pytest.approx(curvature[2], rel=1e-7, abs=1e-3)
        assert slope_of(coupling(0), E33, g, 2) == pytest.approx(coupling(1)(E33, g), rel=1e-7)
        assert slope_of(coupling(0), E33, g, 3) == pytest.approx(coupling(2)(E33, g), rel=1e-7)


def test_a_closed_loop_of_thickness_and_shear_does_no_work(fabric):
    """A circle that leaves the table to all sides, by Gauss's rule between the kinks of the law."""
    nodes, weights = np.polynomial.legendre.leggauss(12)
    edges = np.linspace(0.0, 2.0 * np.pi, 2001)
    half = 0.5 * np.diff(edges)[:, None]
    phase = (0.5 * (edges[1:] + edges[:-1])[:, None] + half * nodes).ravel()
    weight = (half * weights).ravel()
    stretch, g = 0.85 + 0.27 * np.cos(phase), 0.4 + 0.4 * np.sin(phase)
    S = fabric.stress_and_tangent(voigt(0.5 * (stretch**2 - 1.0), g))[0]
    power = -S[:, 2] * stretch * 0.27 * np.sin(phase) + S[:, 3] * 0.4 * np.cos(phase)
    assert abs(power @ weight) < 1e-10 * (np.abs(power) @ weight)


def test_the_compiled_law_agrees_with_numpy(fabric):
    """Inside the table and beyond, where nothing follows the shear any more, too."""
    for E33 in (-0.3, -0.1, 0.0, 0.3):
        for g in (0.0, 0.3, -0.6, 0.72, 0.9, 0.997):
            E = voigt(E33, g)
            own = tuple(map(float, E[0]))
            S, C = membrane_response(fabric.law, own, ())
            stress, tangent = fabric.stress_and_tangent(E)
            np.testing.assert_allclose(S, stress[0], rtol=1e-9, atol=1e-6)
            np.testing.assert_allclose(C, np.diag(tangent[0]), rtol=1e-9, atol=1e-4)
            stabilising, slope, curvature = fabric.stabilising_tangent(E)
            C_hg = hourglass_tangent(fabric.law, own, C, ())
            np.testing.assert_allclose(C_hg, np.diag(stabilising[0]), rtol=1e-9, atol=1e-4)
            coupling = tangent_coupling(fabric.law, own, ())
            for ours, theirs in zip(coupling, fabric.tangent_couplings(E), strict=True):
                assert ours == pytest.approx(float(theirs[0]), rel=1e-8, abs=1e-2)
            found = tangent_slope(fabric.law, own, ())[2], tangent_curvature(fabric.law, own, ())[2]
            expected = slope[0, 2], curvature[0, 2]
            np.testing.assert_allclose(found, expected, rtol=1e-8, atol=1e-2)


@pytest.mark.parametrize(
    ("curves", "message"),
    [
        ([(0, (1, 0.9), (0, 1e4))], "has 1 shear angles; give 2 to 4"),
        ([(10, (1, 0.9), (0, 1e4)), (20, (1, 0.9), (0, 1e4))], "begin at 0 deg"),
        ([(0, (1.1, 0.9), (0, 1e4)), (20, (1, 0.9), (0, 1e4))], "is free at the stretch 1.1"),
        ([(0, (1, 0.9), (1e3, 1e4)), (20, (1, 0.9), (0, 1e4))], "the first pressure is 0"),
        ([(0, (1, 0.9), (0, 1e4)), (20, (1, 1.1), (0, 1e4))], "at 20 deg does not rise at point 2"),
        (
            [(0, (1, 0.9, 0.8, 0.7), (0, 2e4, 2.01e4, 9e5)), (20, (1, 0.9), (0, 1e4))],
            "makes the pressure fall at 0 deg",
        ),
    ],
)
def test_what_is_no_table_is_refused_by_name(curves, message):
    rows = [
        PressureCurve(math.radians(degrees), tuple(map(float, stretch)), tuple(map(float, p)))
        for degrees, stretch, p in curves
    ]
    with pytest.raises(InputError, match=rf"material\.compaction\.table: .*{message}"):
        scene_from_text(scene_text(rows))


def test_table_and_exponent_together_are_refused(table):
    with pytest.raises(InputError, match="cannot stand beside table"):
        scene_from_text(scene_text(table.curves, "compaction.shear_coupling = 1.0"))


def test_a_scene_takes_a_table(table):
    material = scene_from_text(scene_text(table.curves)).material
    assert material.couples_shear and not material.without_shear_coupling().couples_shear
    np.testing.assert_allclose(material.build().law.pressure_table, table.numbers, rtol=1e-9)


@pytest.mark.parametrize("law", ["fabric", "fabric-with-set"])
def test_every_fabric_takes_a_table(law, table):
    entries = f'law = "{law}"\nmembrane.locking_angle = "40 deg"\n'
    entries += 'membrane.locking_stiffness = "80 MPa"\n'
    entries += "compaction.permanent_set = 0.3\n" if law == "fabric-with-set" else ""
    built = scene_from_text(scene_text(table.curves, entries)).material.build()
    assert type(built.law).__name__.startswith("LockingTabledFabric")
    past = (0.0,) * (law == "fabric-with-set")
    S = membrane_response(built.law, (0.0, 0.0, -0.2, 0.5, 0.0, 0.0), past)[0]
    assert S[2] == pytest.approx(float(built.stress_and_tangent(voigt(-0.2, 0.5))[0][0, 2]))


def cells_at(material, angles):
    """The law of a closure for cells that were sheared by angles [rad] with their fibres."""
    return of_cells(material, material.areal_mass / np.cos(angles))


def test_a_closure_presses_every_cell_by_its_own_curve(table, fabric):
    """The points of the table at the shear of the cell, and their thickness from the pressure."""
    angles = np.array([curve.shear_angle for curve in table.curves])
    law = cells_at(fabric, angles)
    free = fabric.thickness * np.array([curve.stretch[0] for curve in table.curves])
    np.testing.assert_allclose(law.thickness, free, rtol=1e-9)
    np.testing.assert_allclose(law.pressure(free), 0.0, atol=1.0)
    for point in range(1, len(STRETCHES)):
        thickness = fabric.thickness * np.array([own.stretch[point] for own in table.curves])
        expected = np.array([own.pressure[point] for own in table.curves])
        np.testing.assert_allclose(law.pressure(thickness), expected, rtol=1e-9)
        np.testing.assert_allclose(law.thickness_under(expected), thickness, rtol=1e-9)


def test_the_stiffness_of_a_closure_is_the_slope_of_its_table(fabric):
    """From the tangent of the law, dp/dt = (S33 + λ² C33)/(t0 cos γ); free, on both sides."""
    angles = np.radians([0.0, 12.0, 33.0, 45.0, 52.0])
    law, g, cos = cells_at(fabric, angles), np.sin(angles), np.cos(angles)
    for share in (0.99, 0.9, 0.75, 0.65):  # one-sided differences over 1e-6 of the thickness
        stretch = share * law.thickness / fabric.thickness
        S, C = fabric.stress_and_tangent(voigt(0.5 * (stretch**2 - 1.0), g))
        expected = (S[:, 2] + stretch**2 * C[:, 2, 2]) / (fabric.thickness * cos)
        np.testing.assert_allclose(law.stiffness(share * law.thickness), expected, rtol=3e-5)
    free = law.thickness / fabric.thickness
    C = fabric.stress_and_tangent(voigt(0.5 * (free**2 - 1.0), g))[1]
    slope = free**2 * C[:, 2, 2] / (fabric.thickness * cos)
    step = 1e-6 * law.thickness
    np.testing.assert_allclose(law.pressure(law.thickness - step) / step, slope, rtol=1e-4)
    np.testing.assert_allclose(law.pressure(law.thickness + step) / step, -slope, rtol=1e-4)


def test_a_closure_takes_a_table_of_an_exponent_as_that_exponent():
    """With what a permanent set remembers of a press, too."""
    beta, grows = 0.7, 1.0 + 0.3 * (1.0 - np.array(STRETCHES))
    plain = [measured(degrees, law=lambda _: (beta, 1.0)) for degrees in (0.0, 20.0, 40.0)]
    curves = [own._replace(pressure=tuple(np.array(own.pressure) / grows)) for own in plain]
    entries = 'law = "fabric-with-set"\ncompaction.permanent_set = 0.4\n'
    angles = np.radians([0.0, 15.0, 35.0, 40.0])
    tabled, exact = (
        cells_at(scene_from_text(text).material.build(), angles)
        for text in (
            scene_text(curves, entries),
            scene_text((), f"{entries}compaction.shear_coupling = {beta}"),
        )
    )
    np.testing.assert_allclose(tabled.thickness, exact.thickness, rtol=1e-9)
    pressed = np.full(len(angles), 3e5)
    for own in (tabled, exact):
        own.remember(own.thickness_under(pressed))
    np.testing.assert_allclose(tabled.history, exact.history, rtol=1e-7)
    assert np.all(tabled.free_stretch < 0.95)
    for pressure in (-2e4, 1e3, 1e5, 1e6):
        found, expected = (own.thickness_under(0.0 * pressed + pressure) for own in (tabled, exact))
        np.testing.assert_allclose(found, expected, rtol=1e-7)


def test_what_no_cell_can_bear_is_told_of_a_table_too(fabric):
    with pytest.raises(SimulationError, match="fibres of cell 1 would have to bear"):
        cells_at(fabric, np.radians([0.0, 40.0])).thickness_under(np.array([1e5, 1e13]))


def test_a_run_says_where_the_sheet_left_its_table(fabric, monkeypatch):
    """By the shear, and by the compaction below the thinnest point at its angle."""
    monkeypatch.setattr(field_judgements, "sheet_areas", lambda sheet, frame: np.ones(3))
    degrees, thickness = np.array([[10.0, 44.0, 47.0]]), fabric.thickness * np.array([0.7, 0.9, 1])
    sheet = xr.Dataset(
        {"shear_angle": (("t", "f"), np.radians(degrees)), "thickness": (("t", "f"), [thickness])}
    )
    (told,) = field_judgements.compaction_range_warnings(sheet, fabric)
    assert told.startswith("1 element (33.33% of the area) left the table")
    assert "ends at 45 deg of shear and 0.62 of the free thickness" in told
    sheet["thickness"][0, 0] *= 0.8  # 0.56 of t0, which is near the free thickness at 10 deg
    (told,) = field_judgements.compaction_range_warnings(sheet, fabric)
    assert told.startswith("2 elements (66.67% of the area) left the table")
    assert "1 element (33.33% of the area) by the shear, up to 47.0 deg" in told
    sheet = sheet.isel(f=[1])
    assert field_judgements.compaction_range_warnings(sheet, fabric) == []


# --- from a file ----------------------------------------------------------------------------------

HEADER = "shear angle [deg],stretch [1],pressure [MPa]"


def csv_text(curves):
    rows = [
        f"{math.degrees(curve.shear_angle)!r},{float(stretch)!r},{1e-6 * float(pressure)!r}"
        for curve in curves
        for stretch, pressure in zip(curve.stretch, curve.pressure, strict=True)
    ]
    return "\n".join(["# plates", HEADER, *rows]) + "\n"


@pytest.fixture
def named(table, tmp_path):
    """A scene in a folder whose table stands in a file beside it."""
    (tmp_path / "compaction.csv").write_text(csv_text(table.curves), encoding="utf-8")
    text = scene_text((), 'compaction.table = "compaction.csv"')
    (tmp_path / "scene.toml").write_text(text, encoding="utf-8")
    return tmp_path / "scene.toml"


def test_a_table_from_a_file_is_that_table(named, table):
    scene = read_scene(named)
    numbers = scene.material.build().law.pressure_table
    np.testing.assert_allclose(numbers, table.numbers, rtol=1e-9)
    assert named.parent / "compaction.csv" in input_files(scene)
    assert ("material.compaction.table", "compaction.csv") in scene.source.files
    assert any(key.endswith("table.3.pressure") for key, _ in scene.source.given)


def test_results_hold_the_numbers_of_the_file(named):
    """The text of the scene in a result gives the same law to the bit, without the file."""
    scene = read_scene(named, ["material.membrane.locking_angle=50 deg",
                               "material.membrane.locking_stiffness=80 MPa"])  # fmt: skip
    (named.parent / "compaction.csv").unlink()
    again = formed_material(scene.source.text)
    assert again == scene.material
    assert again.build().law.pressure_table.tobytes() == (
        scene.material.build().law.pressure_table.tobytes()
    )
    with pytest.raises(InputError, match=r'material.compaction.table: there is no file "compact'):
        read_scene(named)


def test_a_unit_takes_the_file_with_it(named, tmp_path, table):
    """The scene in an FMU finds its table, be it beside the scene or somewhere else."""
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    (elsewhere / "other.csv").write_text(csv_text(table.curves), encoding="utf-8")
    moved = [f'material.compaction.table="{elsewhere / "other.csv"}"']
    for number, overrides in enumerate([[], moved]):
        scene = read_scene(named, overrides)
        unit = tmp_path / f"unit_{number}"
        added = stage_scene(scene, unit)
        assert read_scene(unit / "scene.toml", [*overrides, *added]).material == scene.material


def test_a_ply_of_a_stack_reads_a_file_too(named):
    rows = "".join(
        f'''
[[plies]]
name = "{name}"
size = ["20 mm", "20 mm"]
edge_length = "5 mm"
material = "woven"
'''
        for name in ("lower", "upper")
    )
    material = '[materials.woven]\npreset = "MD600"\ncompaction.table = "compaction.csv"\n'
    named.write_text(f'process = {{ time = "1 ms" }}\n{rows}{material}', encoding="utf-8")
    scene = read_scene(named)
    assert all(ply.material.couples_shear for ply in scene.stack)
    assert formed_plies(scene.source.text)["upper"] == scene.stack[1].material


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda rows: [*rows, "0,0.5,3"], 'line 27, column "shear angle": is less than that of'),
        (lambda rows: [rows[0], *rows[2:]], 'line 3, column "pressure": is not 0'),
        (lambda rows: [*rows[:2], rows[3], rows[2], *rows[4:]], "line 5, column .* does not"),
        (lambda rows: [*rows, "45,0.5,9"], 'line 27, column "pressure": is number 7'),
        (lambda rows: [*rows[:3], "0,1.1.1,1", *rows[4:]], 'line 5, column "stretch": "1.1.1" is'),
        (lambda rows: ["angle,stretch [1],pressure [MPa]", *rows[1:]], 'no column "shear angle"'),
        (lambda rows: rows[:4], "holds 3 rows of data; at least 4"),
    ],
)
def test_a_wrong_file_is_refused_by_key_file_and_line(named, change, message):
    file = named.parent / "compaction.csv"
    rows = file.read_text(encoding="utf-8").splitlines()[1:]
    file.write_text("\n".join(["# plates", *change(rows)]) + "\n", encoding="utf-8")
    told = rf"material\.compaction\.table: .*compaction\.csv: .*{message}"
    with pytest.raises(InputError, match=told):
        read_scene(named)


def test_what_no_law_can_be_made_of_is_told_as_of_a_table_in_the_scene(named):
    file = named.parent / "compaction.csv"
    file.write_text(f"{HEADER}\n10,1,0\n10,0.9,0.01\n20,1,0\n20,0.9,0.01\n", encoding="utf-8")
    with pytest.raises(InputError, match=r"material.compaction.table: .*begin at 0 deg"):
        read_scene(named)
    with pytest.raises(ValidationError, match="names a file"):
        FabricCompaction(c0=1e5, c1=60.0, c2=2.5, table="compaction.csv")


# --- identification -------------------------------------------------------------------------------


def growing(degrees):
    """β that grows so much with the angle that no one exponent describes it."""
    return 0.2 + 0.02 * degrees, 1.0


def sheared_tests(noise=0.02, seed=5):
    """Compaction of specimens at 0 to 45 degrees of the fabric whose β changes with the angle."""
    rng = np.random.default_rng(seed)
    columns = {"thickness": [], "pressure": [], "shear angle": []}
    for degrees in ANGLES:
        curve = measured(degrees, np.linspace(1.0, 0.62, 41), growing)
        columns["thickness"].append(1.004e-3 * np.array(curve.stretch[1:]))
        error = 1.0 + noise * rng.standard_normal(40)
        columns["pressure"].append(np.array(curve.pressure[1:]) * error)
        columns["shear angle"].append(np.full(40, curve.shear_angle))
    values = {name: np.concatenate(parts) for name, parts in columns.items()}
    return CouponData("data.csv", values, np.arange(160) + 2, np.repeat(np.arange(4), 40))


SHEET = {"thickness": 1.004e-3, "solid_height": 0.6 / 1810.0}


def test_where_no_exponent_holds_a_table_is_identified():
    """Its scene gives the pressures of the fabric within 6 % of 2 % noise, at all angles."""
    data = sheared_tests()
    with pytest.raises(FitRefusedError, match="--table takes every angle by itself"):
        identify_sheared_compaction(data, **SHEET)
    found = identify_pressure_table(data, **SHEET)
    free = found["free_stretch_at_45_deg"]
    assert free.low < measured(45.0, law=growing).stretch[0] < free.high
    entries = "\n".join(f"compaction.{key} = {text}" for key, text in found.scene_entries.items())
    built = scene_from_text(scene_text((), entries)).material.build()
    for degrees in ANGLES:
        curve = measured(degrees, (1.0, 0.9, 0.8, 0.7), growing)
        g, cos = math.sin(curve.shear_angle), math.cos(curve.shear_angle)
        pressure = built.compaction_pressure(curve.stretch, None, g) / cos
        np.testing.assert_allclose(pressure[1:], curve.pressure[1:], rtol=0.06)


def test_a_curve_that_misses_its_angle_is_refused():
    data = sheared_tests()
    own = data["shear angle"] > 0.7
    bent = 1.0 + 0.6 * np.sin(np.linspace(0.0, 9.0, np.count_nonzero(own)))
    data["pressure"][own] *= bent
    with pytest.raises(FitRefusedError, match="the curve at 45 deg does not follow the data"):
        identify_pressure_table(data, **SHEET)


def test_too_many_angles_or_too_few_rows_are_no_table(tmp_path):
    data = sheared_tests()
    with pytest.raises(InputError, match="has 5 rows at 45 deg; at least 6"):
        identify_pressure_table(data.keep(np.arange(160) < 125), **SHEET)
    data["shear angle"][-10:] = math.radians(55.0)
    with pytest.raises(InputError, match="has 4 shear angles up to 55 deg; keep 3"):
        identify_pressure_table(data, **SHEET)
    file = tmp_path / "plain.csv"
    rows = [f"{1 - 0.04 * k},{0.001 * 3**k}" for k in range(8)]
    file.write_text("\n".join(["thickness [mm],pressure [MPa]", *rows]), encoding="utf-8")
    with pytest.raises(InputError, match="--table: needs tests of sheared fabric"):
        identify_compaction_file(file, {}, table=True)


# --- elements -------------------------------------------------------------------------------------


@pytest.mark.slow
def test_forces_and_their_bound_know_the_table(fabric):
    """The kernel against the element in NumPy, and the bound of its frequency."""
    rng = np.random.default_rng(3)
    X, fibres = map(np.array, zip(*(make.flat_reference(rng) for _ in range(20)), strict=True))
    gradient = make.sheared(math.radians(25.0), 0.9, 1.0)
    x = np.array(
        [make.deformed(rng, *own, gradient=gradient) for own in zip(X, fibres, strict=True)]
    )
    options = ElementOptions(compaction_strain="normal", hourglass="conservative")
    model = make.separate_elements(X, fibres, fabric, options)
    forces = make.corner_forces(model, make.positions_of(x))
    references = [ReferenceElement(*own, fabric, options) for own in zip(X, fibres, strict=True)]
    for reference, own, force in zip(references, x, forces, strict=True):
        expected = reference.evaluate(own).force
        np.testing.assert_allclose(force, expected, rtol=0.0, atol=1e-11 * abs(expected).max())
    elements = list(zip(X, fibres, strict=True))
    bounds, frequencies = make.bounds_and_frequencies(elements, x, fabric, options)
    assert np.all(bounds > frequencies * (1.0 - 1e-6)) and (bounds / frequencies).mean() < 1.3


@pytest.mark.slow
@pytest.mark.parametrize("degrees", [30.0, 45.0])
def test_a_sheared_piece_is_pressed_as_the_table_says(table, degrees):
    """0.1 % at the points of the table, by the simulated test."""
    material = scene_from_text(scene_text(table.curves)).material
    curve = next(own for own in table.curves if abs(own.shear_angle - math.radians(degrees)) < 1e-9)
    result = compaction(
        material, size=10e-3, shear_angle=curve.shear_angle, pressure=1.05 * curve.pressure[-1]
    )
    thickness, pressure = result.curves["thickness [mm]"], result.curves["pressure [MPa]"]
    for stretch, expected in zip(curve.stretch[2:], curve.pressure[2:], strict=True):
        # interpolated from its ratio to the law, which is smooth
        ratio = pressure / result.curves["law pressure [MPa]"]
        found = np.interp(-1.004 * stretch, -thickness, ratio)
        law = material.build().compaction_pressure(stretch, None, math.sin(curve.shear_angle))
        assert found * law / math.cos(curve.shear_angle) == pytest.approx(expected, rel=1e-3)
    assert max(abs(c.relative) for c in result.comparisons) < 1e-3
