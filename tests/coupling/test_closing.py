"""A part that is pressed together while it fills: bag, closing tools, press; through the stage."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import xarray as xr
from scipy.integrate import solve_ivp

from lcmchain.coupling.infiltration.flow.time_step import TimeStep
from lcmchain.coupling.infiltration.formed_part import read_formed_part
from lcmchain.coupling.infiltration.report import filling_report
from lcmchain.coupling.infiltration.setup import set_up
from lcmchain.coupling.infiltration.stage import (
    FillOptions,
    checkpoint_file,
    fill,
    fill_part,
    fingerprint_of,
)
from lcmchain.coupling.mould import Mould
from lcmchain.coupling.solids.closures import Bag
from lcmchain.coupling.solids.stack_compaction import compaction_of, of_cells
from lcmchain.errors import InputError, SimulationError, SimulationInterrupted
from lcmchain.fields.netcdf_file import write_netcdf
from lcmchain.fields.ugrid import UgridMesh
from lcmchain.scene import infiltration_from_text
from lcmchain.scene.presets import PUBLISHED

LENGTH, WIDTH, COLUMNS, VISCOSITY = 0.2, 0.04, 20, 0.1
SCENE = """
process = { time = "1 ms" }
blank = { size = ["30 mm", "20 mm"], edge_length = "5 mm" }
material = { preset = "MD600" }
mapping = [{ name = "gone", mesh = "gone.vtu", kind = "structure" }]

# Overrides:
# --set material.thickness="1.1 mm"
"""
THICKNESS, AREAL_MASS, FIBRE_DENSITY = 1.1e-3, 0.6, 1810.0
FRACTION = AREAL_MASS / (FIBRE_DENSITY * THICKNESS)
HEAD = """
time = "2000 s"
frames = 6
resin = { law = "constant", viscosity = "0.1 Pa*s", density = "1100 kg/m^3" }
"""
LAW = """
[permeability]
law = "kozeny_carman"
fibre_radius = "30 um"
k_along = 1.0
k_across = 1.0
"""
LEFT = '[[gates]]\nname = "left"\nbox = ["-1 -1 -1 mm", "1 41 1 mm"]\npressure = "0.9 bar"\n'
RIGHT = '[[vents]]\nname = "right"\nbox = ["199 -1 -1 mm", "201 41 1 mm"]\n'
BOTH = '[[vents]]\nname = "{0}"\nbox = ["{1} -1 -1 mm", "{2} 41 1 mm"]\nbleeds = true\n'
ENDS = BOTH.format("left", -1, 1) + BOTH.format("right", 199, 201)
WET = '[[wetted]]\nname = "all"\nbox = ["-1 -1 -1 mm", "201 41 1 mm"]\n'
# Three times what the filling takes, with all iterations.
MOST_STEPS = 800
PLAIN = FillOptions(picture=False, vtu=False)


@pytest.fixture
def source(tmp_path):
    """A flat strip of the fabric, as a forming result."""
    x, y = np.linspace(0.0, LENGTH, COLUMNS + 1), np.linspace(0.0, WIDTH, 3)
    points = np.stack([c.ravel() for c in np.meshgrid(x, y, indexing="ij")], axis=1)
    points = np.hstack([points, np.zeros((len(points), 1))])
    node = np.arange(len(points)).reshape(COLUMNS + 1, 3)
    quads = np.stack(
        [c.ravel() for c in (node[:-1, :-1], node[1:, :-1], node[1:, 1:], node[:-1, 1:])], axis=1
    )
    mesh = UgridMesh("sheet")
    variables = {**mesh.topology(quads, long_name="sheet"), **mesh.node_positions(points)}
    values = {"thickness": THICKNESS, "fibre_volume_fraction": FRACTION,
              "areal_fibre_mass": AREAL_MASS, "shear_angle": 0.0}  # fmt: skip
    for number in (1, 2):
        for axis, name in enumerate("xyz"):
            values[f"fibre_direction_{number}_{name}"] = float(axis == number - 1)
    units = {"thickness": "m", "areal_fibre_mass": "kg m-2", "shear_angle": "rad"}
    for name, value in values.items():
        about = {"units": units.get(name, "1"), "long_name": name}
        variables[name] = mesh.on_cells(np.full(len(quads), value), about)
    attributes = {"Conventions": "CF-1.11 UGRID-1.0", "title": "strip", "state": "complete",
                  "scene": SCENE}  # fmt: skip
    path = tmp_path / "forming.nc"
    write_netcdf(path, {"/": mesh.dataset(variables, attributes)})
    return path


def case(*parts):
    return infiltration_from_text("\n".join(parts))


def permeability(thickness):
    v = AREAL_MASS / (FIBRE_DENSITY * thickness)
    return (30e-6) ** 2 / 4.0 * (1.0 - v) ** 3 / v**2


def test_the_textile_is_that_of_the_scene_with_its_overrides(source):
    law = compaction_of(read_formed_part(source))
    np.testing.assert_allclose(law.thickness, THICKNESS)
    np.testing.assert_allclose(law.area_stretch, 1.0, rtol=1e-3)


def test_closing_plates_squeeze_the_resin_out_of_both_ends(source):
    """F/width = 2 mu |dh/dt| L³ / (3 K h), L half the length, and the fibres' force."""
    closing = (
        '[closure]\ntype = "gap"\nthickness = "0.8 mm"\nclosing_time = "2000 s"\nwindow = "20 s"'
    )
    filled = fill(read_formed_part(source), case(HEAD, ENDS, WET, closing, LAW))
    speed = (THICKNESS - 0.8e-3) / 2000.0
    time, (total, fibres, resin) = filled.history.time, filled.history.force.T
    late = time > 1000.0
    h = THICKNESS - speed * time
    half = 0.5 * LENGTH
    squeeze = 2.0 * VISCOSITY * speed * half**3 / (3.0 * permeability(h) * h) * WIDTH
    expected = squeeze[late]
    np.testing.assert_allclose(resin[late], expected, rtol=5e-3)
    # Exact at the nodes; between them the parabola is a polygon of ten sides.
    np.testing.assert_allclose(resin[1:], squeeze[1:] * (1.0 - 0.25 / 10**2), rtol=2e-4)
    np.testing.assert_allclose(total, fibres + resin, rtol=1e-12)
    law = compaction_of(read_formed_part(source))
    alone = law.pressure(np.full(law.thickness.size, 0.8e-3)).mean() * LENGTH * WIDTH
    assert fibres[-1] == pytest.approx(alone, rel=1e-9)
    np.testing.assert_allclose(filled.thickness[-1], 0.8e-3, rtol=1e-12)
    # What the pores have lost has left through the ends.
    lost = LENGTH * WIDTH * (THICKNESS - 0.8e-3)
    assert filled.history.vented[-1].sum() == pytest.approx(lost, rel=1e-9)
    assert np.abs(filled.history.balance_error).max() < 1e-10 * filled.history.stored[0]


@pytest.fixture
def few_steps(monkeypatch):
    """Time steps that collapse are an error here, not a test that never ends."""
    take, taken = TimeStep.take, []

    def counted(self, state, until):
        taken.append(until)
        assert len(taken) <= MOST_STEPS, f"{MOST_STEPS} time steps do not suffice"
        return take(self, state, until)

    monkeypatch.setattr(TimeStep, "take", counted)
    return taken


@pytest.mark.parametrize("kind", ["bag", "press"])
def test_resin_lifts_a_part_until_the_pressures_balance(source, kind, few_steps):
    """At the end of an infusion the resin is at the gate's pressure everywhere."""
    area = LENGTH * WIDTH
    closing = {
        "bag": '[closure]\ntype = "bag"\npressure = "1 bar"',
        "press": f'[closure]\ntype = "press"\nforce = "{1e5 * area} N"',
    }[kind]
    long = HEAD.replace("2000 s", "20000 s")
    filled = fill(read_formed_part(source), case(long, LEFT, RIGHT, closing, LAW))
    assert filled.is_filled and filled.coupling is not None
    law = compaction_of(read_formed_part(source))
    dry = law.thickness_under(np.full(law.thickness.size, 1e5))
    wet = law.thickness_under(np.full(law.thickness.size, 1e4))
    assert wet.min() > 1.1 * dry.max()
    np.testing.assert_allclose(filled.thickness[0], dry, rtol=1e-9)
    np.testing.assert_allclose(filled.thickness[-1], wet, rtol=2e-3)
    np.testing.assert_allclose(filled.history.force[:, 0], 1e5 * area, rtol=2e-3)
    assert np.abs(filled.history.balance_error).max() < 1e-10 * filled.history.stored[-1]
    assert filled.coupling.mean_iterations < 12.0
    assert not filling_report("balanced", filled).warnings


def test_resin_that_pushes_harder_than_the_closure_is_warned_of(source):
    """The law of the fibres goes on into tension; a textile has none across its plane."""
    over, short = LEFT.replace('"0.9 bar"', '"1.5 bar"'), HEAD.replace("2000 s", "60 s")
    bag = '[closure]\ntype = "bag"\npressure = "1 bar"'
    filled = fill(read_formed_part(source), case(short, over, RIGHT, bag, LAW))
    (warning,) = filling_report("lifted", filled).warnings
    assert "fibres in tension" in warning
    assert warning.endswith("or more closure.pressure")


FINE = LAW.replace("30 um", "20 um")
SHORT = HEAD.replace("2000 s", "6 s").replace("frames = 6", 'frame_interval = "2 s"')


def form_to(source, thickness):
    """Give the strip another thickness, with the fibres that it has."""
    with xr.load_dataset(source) as strip:
        strip["thickness"][:] = thickness
        strip["fibre_volume_fraction"][:] = AREAL_MASS / (FIBRE_DENSITY * thickness)
    strip.to_netcdf(source)


def law_of(source):
    """Return pressure by thickness and thickness by pressure, of one cell."""
    law = compaction_of(read_formed_part(source))
    count = law.thickness.size
    return (
        lambda h: law.pressure(np.full(count, h))[0],
        lambda p: law.thickness_under(np.full(count, p))[0],
    )


@pytest.mark.parametrize("force", ['"800 N"', '"0 800 N"\ntimes = "0 1 s"'])
def test_a_wet_preform_under_a_press_consolidates_as_its_own_equation_says(source, force):
    """Formed to 1.0 mm, below its free thickness; resin leaves at both ends.

    Of a rate h' the parabola of Darcy's law has the mean p = -mu h' l² / (3 K h), l half the
    length, and F = A (sigma + p): an equation for h(t) alone. What bears less than its fibres
    lies still, as no resin comes in.
    """
    formed, area, half = 1.0e-3, LENGTH * WIDTH, 0.5 * LENGTH
    form_to(source, formed)
    closing = f'[closure]\ntype = "press"\nforce = {force}\nwindow = "0.2 s"'
    filled = fill(read_formed_part(source), case(SHORT, ENDS, WET, closing, FINE))
    law = compaction_of(read_formed_part(source))

    def rate(time, h):
        load = 800.0 / area * (min(time, 1.0) if "times" in force else 1.0)
        sigma = law.pressure(np.full(law.thickness.size, h[0]))[0]
        K = permeability(h[0]) * (20.0 / 30.0) ** 2
        return [-3.0 * K * h[0] * max(load - sigma, 0.0) / (VISCOSITY * half**2)]

    exact = solve_ivp(rate, (0.0, 6.0), [formed], rtol=1e-8, max_step=0.1, t_eval=filled.time)
    assert len(filled.time) == 4 and exact.y[0, -1] < 0.88e-3
    np.testing.assert_allclose(filled.thickness[0], formed, rtol=1e-12)
    np.testing.assert_allclose(filled.thickness.mean(axis=1), exact.y[0], rtol=0.01)
    way = formed - filled.thickness.mean(axis=1)[1:]
    np.testing.assert_allclose(way, formed - exact.y[0, 1:], rtol=0.05)
    late = filled.history.time > 0.5
    np.testing.assert_allclose(
        filled.history.force[late, 0], 800.0 * np.minimum(filled.history.time[late], 1.0)
        if "times" in force else 800.0, rtol=1e-3,
    )  # fmt: skip
    assert np.abs(filled.history.balance_error).max() < 1e-10 * filled.history.stored[0]


@pytest.mark.parametrize("pressure", ['"1 bar"', '"0 1 bar"\ntimes = "0 1 s"'])
def test_a_wet_preform_under_a_bag_consolidates_as_its_own_equation_says(source, pressure):
    """Formed to 1.0 mm; every cell has its own thickness, and resin leaves at both ends.

    dh/dt = d/dx (K h / mu dp/dx) with p = P - sigma(h), here by 60 volumes of half the length.
    """
    formed, count = 1.0e-3, 60
    form_to(source, formed)
    closing = f'[closure]\ntype = "bag"\npressure = {pressure}\nwindow = "0.05 s"'
    filled = fill(read_formed_part(source), case(SHORT, ENDS, WET, closing, FINE))
    sigma, _ = law_of(source)
    table = np.linspace(0.8e-3, 1.0e-3, 400)
    of_table = np.array([sigma(h) for h in table])
    spacing = 0.5 * LENGTH / count

    def rate(time, h):
        load = 1e5 * (min(time, 1.0) if "times" in pressure else 1.0)
        p = load - np.interp(h, table, of_table)
        flow = permeability(h) * (20.0 / 30.0) ** 2 * h / VISCOSITY
        out = np.zeros(count + 1)  # nothing at the middle
        out[1:-1] = -0.5 * (flow[1:] + flow[:-1]) * np.diff(p) / spacing
        out[-1] = flow[-1] * max(p[-1], 0.0) / (0.5 * spacing)  # vents let nothing in
        return -np.diff(out) / spacing

    exact = solve_ivp(
        rate, (0.0, 6.0), np.full(count, formed), method="BDF", rtol=1e-6, atol=1e-10,
        max_step=0.1, t_eval=filled.time,
    )  # fmt: skip
    assert len(filled.time) == 4 and exact.y.mean(axis=0)[-1] < 0.88e-3
    np.testing.assert_allclose(filled.thickness[0], formed, rtol=1e-12)
    np.testing.assert_allclose(filled.thickness.mean(axis=1), exact.y.mean(axis=0), rtol=3e-3)
    own = exact.y.reshape(COLUMNS // 2, -1, 4).mean(axis=1)
    columns = filled.thickness.reshape(4, COLUMNS, 2).mean(axis=2)
    np.testing.assert_allclose(columns[:, COLUMNS // 2 :].T, own, rtol=0.01)
    np.testing.assert_allclose(columns, columns[:, ::-1], rtol=1e-6)
    assert np.abs(filled.history.balance_error).max() < 1e-10 * filled.history.stored[0]


BLEEDING = BOTH.format("right", 199, 201)
HALF = WET.replace("201 41", "101 41")


def test_resin_of_a_half_wet_preform_is_pressed_into_its_dry_half(source):
    """A press on a strip that is closed at the left; one thickness h, resin from 0 to s.

    V = (h - h_f) s is conserved; the closing gap makes F/w = L sigma - mu h' s³ / (3 K h).
    """
    formed, solid = 1.0e-3, AREAL_MASS / FIBRE_DENSITY
    form_to(source, formed)
    closing = '[closure]\ntype = "press"\nforce = "800 N"\nwindow = "0.2 s"'
    filled = fill(read_formed_part(source), case(SHORT, BLEEDING, HALF, closing, FINE))
    sigma, _ = law_of(source)
    resin = 0.105 * (formed - solid)  # the last full node stands for half an element more

    def rate(time, y):
        h = y[0]
        left = max(800.0 / (LENGTH * WIDTH) - sigma(h), 0.0)
        K = permeability(h) * (20.0 / 30.0) ** 2
        return [-3.0 * K * h * left * LENGTH / (VISCOSITY * (resin / (h - solid)) ** 3)]

    exact = solve_ivp(rate, (0.0, 6.0), [formed], rtol=1e-8, max_step=0.1, t_eval=filled.time)
    assert exact.y[0, -1] < 0.86e-3
    np.testing.assert_allclose(filled.thickness.mean(axis=1), exact.y[0], rtol=0.01)
    assert np.ptp(filled.thickness, axis=1).max() < 1e-9
    np.testing.assert_allclose(filled.history.stored, resin * WIDTH, rtol=1e-9)
    front = (filled.state.fill[1::3] * np.r_[0.5, np.ones(COLUMNS - 1), 0.5]).sum() * 0.01
    assert front == pytest.approx(resin / (exact.y[0, -1] - solid), rel=0.01)


def test_a_bag_presses_a_half_wet_preform_until_its_fibres_bear_all(source):
    """What is dry begins at its pressed thickness, what is wet comes there; resin is conserved."""
    formed, solid = 1.0e-3, AREAL_MASS / FIBRE_DENSITY
    form_to(source, formed)
    closing = '[closure]\ntype = "bag"\npressure = "1 bar"\nwindow = "0.5 s"'
    long = SHORT.replace("6 s", "60 s").replace('"2 s"', '"20 s"')
    filled = fill(read_formed_part(source), case(long, BLEEDING, HALF, closing, FINE))
    dry = law_of(source)[1](1e5)
    start = filled.thickness[0].reshape(COLUMNS, 2)
    np.testing.assert_allclose(start[:11], formed, rtol=1e-12)
    np.testing.assert_allclose(start[11:], dry, rtol=1e-9)
    np.testing.assert_allclose(filled.thickness[-1], dry, rtol=1e-3)
    np.testing.assert_allclose(filled.history.stored, filled.history.stored[0], rtol=1e-9)
    front = (filled.state.fill[1::3] * np.r_[0.5, np.ones(COLUMNS - 1), 0.5]).sum() * 0.01
    resin = filled.history.stored[0] / WIDTH
    assert front == pytest.approx(resin / (dry - solid), rel=2e-3)


@pytest.mark.parametrize("kind", ['"press"\nforce = "800 N"', '"bag"\npressure = "1 bar"'])
def test_the_resin_of_a_wet_preform_bears_what_its_fibres_leave(source, kind):
    form_to(source, 1.0e-3)
    part = read_formed_part(source)
    setup = set_up(part, case(SHORT, ENDS, WET, f"[closure]\ntype = {kind}", FINE))
    mould = Mould(part, setup.filling(), setup.case.closure, 6.0)
    fibres = law_of(source)[0](1.0e-3) * LENGTH * WIDTH
    np.testing.assert_allclose(mould.force, (800.0, fibres, 800.0 - fibres), rtol=1e-9)
    assert 0.01 < fibres / 800.0 < 0.5


def test_wet_cells_remember_no_press_that_has_not_come_yet(source):
    """A law with a permanent set would else begin thinner than free."""
    form_to(source, 1.0e-3)
    closing = '[closure]\ntype = "press"\nforce = "800 N"'
    part = read_formed_part(source)
    law = 'material = { preset = "MD600", law = "fabric-with-set", compaction.permanent_set = 0.3 }'
    part.dataset.attrs["scene"] = SCENE.replace('material = { preset = "MD600" }', law)
    setup = set_up(part, case(SHORT, ENDS, WET, closing, FINE))
    mould = Mould(part, setup.filling(), setup.case.closure, 6.0)
    alone = compaction_of(part)
    alone.remember(mould.solid.thickness)
    np.testing.assert_array_equal(mould.law.history, alone.history)


def test_a_preform_that_was_pressed_dry_is_full_at_its_pressed_thickness(source):
    closing = '[closure]\ntype = "press"\nforce = "800 N"\npressed = "dry"'
    filled = fill(read_formed_part(source), case(SHORT, ENDS, WET, closing, FINE))
    law = compaction_of(read_formed_part(source))
    dry = law.thickness_under(np.full(law.thickness.size, 1e5))
    np.testing.assert_allclose(filled.thickness, np.tile(dry, (len(filled.time), 1)), rtol=1e-9)
    pores = LENGTH * WIDTH * (dry[0] - AREAL_MASS / FIBRE_DENSITY)
    np.testing.assert_allclose(filled.history.stored, pores, rtol=1e-9)
    assert filled.history.vented.max() < 1e-9 * pores


def test_pressed_wet_needs_resin_in_the_preform():
    closing = '[closure]\ntype = "bag"\npressure = "1 bar"\npressed = "wet"'
    with pytest.raises(InputError, match="closure.pressed.*no resin is in the preform"):
        case(HEAD, LEFT, RIGHT, closing, LAW)


def test_going_on_from_a_checkpoint_is_bit_identical(source, tmp_path):
    closing = '[closure]\ntype = "bag"\npressure = "1 bar"'
    the_case = case(HEAD, LEFT, RIGHT, closing, LAW)
    whole = fill(read_formed_part(source), the_case)

    def tell(share, text):
        if 0.4 < share < 1.0:
            import os
            import signal

            os.kill(os.getpid(), signal.SIGINT)

    with pytest.raises(SimulationInterrupted):
        fill_part(source, the_case, name="a", out_dir=tmp_path, options=PLAIN, tell=tell)
    assert checkpoint_file(tmp_path, "a").exists()
    resume = FillOptions(picture=False, vtu=False, resume=True)
    report = fill_part(source, the_case, name="a", out_dir=tmp_path, options=resume)
    assert report.closing["window_count"] == len(whole.coupling.accepted)
    with xr.open_dataset(tmp_path / "a_filling.nc") as found:
        np.testing.assert_array_equal(found["resin_pressure"].values, whole.pressure)
        np.testing.assert_array_equal(found["pressed_thickness"].values, whole.thickness)
    with xr.open_dataset(tmp_path / "a_filling.nc", group="/history") as history:
        np.testing.assert_array_equal(history["press_force"].values, whole.history.force[:, 0])
    with xr.open_dataset(tmp_path / "a_filling.nc", group="/coupling") as coupling:
        assert coupling.sizes["window"] >= report.closing["window_count"]


def test_a_checkpoint_belongs_to_laws_and_places_as_well(source, tmp_path):
    """All that a filling depends on beside mesh, pores and case is in its fingerprint."""
    closing = '[closure]\ntype = "bag"\npressure = "1 bar"'
    table = tmp_path / "law.csv"
    rows = "fibre volume fraction [%],k1 [m^2],k2 [m^2],k3 [m^2]\n30,3e-10,3e-10,3e-11\n"
    law = '[permeability]\nlaw = "table"\nfile = "law.csv"'
    wet = '[[wetted]]\nname = "some"\nset = "WET"\n'
    the_case, part = case(HEAD, LEFT, RIGHT, wet, closing, law), read_formed_part(source)
    part = replace(part, target=replace(part.target, node_sets={"WET": np.arange(5)}))

    def hashes(part, last_row="60,1e-11,1e-11,1e-12"):
        table.write_text(rows + last_row)
        return fingerprint_of(set_up(part, the_case, tmp_path))

    def differing(*arguments):
        other = hashes(*arguments)
        assert list(other) == list(before)
        return [name for name in before if other[name] != before[name]]

    before = hashes(part)
    assert differing(part) == []
    stiffer = SCENE + '# --set material.compaction.c0="0.2 MPa"\n'
    attributes = part.dataset.attrs | {"scene": stiffer}
    assert differing(replace(part, dataset=part.dataset.assign_attrs(attributes))) == [
        "compaction law"
    ]
    moved = replace(part, target=replace(part.target, node_sets={"WET": np.arange(6)}))
    assert differing(moved) == ["set of places"]
    assert "permeability law" in differing(part, "60,2e-11,2e-11,2e-12")


def test_what_cannot_be_pressed_is_said(source):
    part = read_formed_part(source)
    closing = '[closure]\ntype = "bag"\npressure = "1 bar"'
    part.dataset.attrs.pop("scene")
    with pytest.raises(InputError, match="does not hold the scene"):
        fill(part, case(HEAD, LEFT, RIGHT, closing, LAW))
    hard = '[closure]\ntype = "gap"\nthickness = "0.3 mm"\nclosing_time = "100 s"'
    with pytest.raises(SimulationError):
        fill(read_formed_part(source), case(HEAD, ENDS, WET, hard, LAW))
    with pytest.raises(InputError, match="closing_time"):
        case(HEAD, ENDS, WET, '[closure]\ntype = "gap"\nthickness = "0.3 mm"', LAW)
    setup = set_up(read_formed_part(source), case(HEAD, LEFT, RIGHT, closing, LAW))
    assert isinstance(Mould(setup.part, setup.filling(), setup.case.closure, 1.0), Mould)


def test_wet_moulding_is_filled_from_its_film_and_drawn(source, tmp_path):
    """A film and closing tools, no gate: what the film gave is in the part or has left it."""
    film = 'film = { thickness = "0.6 mm", pressure = "3 bar" }\n'
    closing = '[closure]\ntype = "gap"\nthickness = "0.8 mm"\nclosing_time = "100 s"'
    short = HEAD.replace("2000 s", "200 s")
    the_case = case(short + film, ENDS, closing, LAW)
    report = fill_part(source, the_case, name="a", out_dir=tmp_path)
    assert (tmp_path / "a_filling_curves.png").stat().st_size > 10_000
    assert report.balance_error < 1e-10
    assert report.closing["thickness_max"] == pytest.approx(0.8e-3, rel=1e-9)
    with xr.open_dataset(tmp_path / "a_filling.nc", group="/history") as history:
        assert history.sizes["gate"] == 0
        given = LENGTH * WIDTH * 0.6e-3
        left = history["vented_volume"].values[-1].sum()
        assert history["stored_volume"].values[-1] + left <= given * (1.0 + 1e-9)
        assert history["stored_volume"].values[-1] + left > 0.99 * given
        assert left > 0.1 * given and history["resin_force"].values.max() > 0.0


AIR = """
time = "400 s"
frames = 6
vent_pressure = "1 bar"
trapped_air = true
resin = { law = "constant", viscosity = "0.1 Pa*s" }
[[race_tracks]]
name = "around"
rim = true
width = "1 mm"
"""
PRESSING = {
    "gap": 'type = "gap"\nthickness = "0.8 mm"\nclosing_time = "100 s"',
    "gap that opens again": 'type = "gap"\nthickness = "1.1 0.8 0.9 mm"\ntimes = "0 100 200 s"',
    "bag": 'type = "bag"\npressure = "5 bar"',
    "press": 'type = "press"\nforce = "4 kN"',
}


@pytest.mark.parametrize("kind", PRESSING)
def test_trapped_air_under_a_closure_keeps_its_amount(source, kind):
    """Boyle: what the front closed around at 1 bar, whatever has pressed since."""
    gate = LEFT.replace("0.9 bar", "4 bar")
    vent = RIGHT.replace("199", "9").replace("201", "15")
    pressed = fill(
        read_formed_part(source), case(AIR, gate, vent, f"[closure]\n{PRESSING[kind]}\n", LAW)
    )
    ((_, spot),) = pressed.dry_spots
    ((_, left),) = pressed.left_dry
    assert 0.1 * spot.volume < left < 0.5 * spot.volume
    dry = ~pressed.state.full
    np.testing.assert_allclose(pressed.state.air_pressure[dry] * left, 1e5 * spot.volume, rtol=1e-6)
    assert np.abs(pressed.history.balance_error).max() < 1e-10 * pressed.history.stored[-1]


def test_the_gap_follows_its_table_over_time(source):
    closing = '[closure]\ntype = "gap"\nthickness = "2 0.9 0.9 0.8 mm"\ntimes = "0 55 100 150 s"'
    head = HEAD.replace("2000 s", "200 s").replace("frames = 6", 'frame_interval = "10 s"')
    filled = fill(read_formed_part(source), case(head, ENDS, WET, closing, LAW))
    gap = np.interp(filled.time, [0.0, 55.0, 100.0, 150.0], [2e-3, 0.9e-3, 0.9e-3, 0.8e-3])
    expected = np.minimum(THICKNESS, gap)
    np.testing.assert_allclose(filled.thickness, np.tile(expected, (40, 1)).T, rtol=1e-9)
    lost = LENGTH * WIDTH * (THICKNESS - 0.8e-3)
    assert filled.history.vented[-1].sum() == pytest.approx(lost, rel=1e-9)


@pytest.mark.parametrize(
    ("entries", "message"),
    [
        ('thickness = "0.8 mm"', "closing_time: needs closing_time, or times"),
        ('thickness = "1 0.8 mm"\ntimes = "0 9 s"\nclosing_time = "9 s"', "but has both"),
        ('thickness = "1 0.8 mm"\nclosing_time = "9 s"', "needs one value, but has 2"),
        ('thickness = "1 0.8 mm"\ntimes = "9 0 s"', "must increase"),
    ],
)
def test_a_gap_needs_one_law_of_closing(entries, message):
    with pytest.raises(InputError, match=message):
        case(HEAD, ENDS, WET, f'[closure]\ntype = "gap"\n{entries}\n', LAW)


@pytest.mark.parametrize("beta", [0.0, 0.5, 1.0])
def test_sheared_cells_are_pressed_by_the_coupled_law(beta):
    """At 0 and 40 degrees, against the fabric itself: λ|S33| at the shear over the present area."""
    table = PUBLISHED["MD600"].material
    coupled = table.compaction.model_copy(update={"shear_coupling": beta})
    fabric = table.model_copy(update={"compaction": coupled}).build()
    gamma = np.radians([0.0, 40.0])
    law = of_cells(fabric, fabric.areal_mass / np.cos(gamma))
    free = fabric.thickness / np.cos(gamma) ** beta
    np.testing.assert_allclose(law.pressure(free), 0.0, atol=1e-6)
    for share in (0.9, 0.7):
        expected = fabric.compaction_pressure(
            share * free / fabric.thickness, None, np.sin(gamma)
        ) / np.cos(gamma)
        np.testing.assert_allclose(law.pressure(share * free), expected, rtol=1e-9)
    # β = 1: one pressure for one fibre volume fraction
    if beta == 1.0:
        assert np.ptp(law.pressure(0.7 * free)) < 1e-9 * law.pressure(0.7 * free)[0]


TABLED = """# --set material.compaction.table=[\
{shear_angle = "0 deg", stretch = [1.0, 0.9, 0.8, 0.7], pressure = "0 0.02 0.12 0.7 MPa"}, \
{shear_angle = "40 deg", stretch = [1.15, 1.03, 0.92, 0.8], pressure = "0 0.03 0.15 0.9 MPa"}]
"""


def test_a_bag_presses_sheared_cells_by_the_table_of_the_scene_that_formed_them(source):
    """The points at 0 and 40 degrees, from the fibres per area that the shear leaves in a cell."""
    sheared = np.arange(2 * COLUMNS) % 2 == 1
    with xr.open_dataset(source) as opened:
        part = opened.load()
    more = np.where(sheared, 1.0 / np.cos(np.radians(40.0)), 1.0)
    for name in ("fibre_volume_fraction", "areal_fibre_mass"):
        part[name] = part[name].copy(data=part[name].values * more)
    part.attrs["scene"] = SCENE + TABLED
    write_netcdf(source, {"/": part})
    law = compaction_of(read_formed_part(source))
    nothing = np.zeros(2 * COLUMNS)
    for pressures, stretches in (((0.12e6, 0.15e6), (0.8, 0.92)), ((0.7e6, 0.9e6), (0.7, 0.8))):
        bag = Bag(np.where(sheared, pressures[1], pressures[0]))
        closed = bag.close(law, nothing + 1.0, nothing, 0.0)
        expected = THICKNESS * np.where(sheared, stretches[1], stretches[0])
        np.testing.assert_allclose(closed.thickness, expected, rtol=1e-6)
        # the answer to the pore pressure is the slope of the law
        lifted = bag.close(law, nothing + 1.0, nothing + 10.0, 0.0).thickness
        np.testing.assert_allclose((lifted - closed.thickness) / 10.0, closed.compliance, rtol=1e-3)
