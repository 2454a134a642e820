"""Forming and filling at once: squeeze flow, balances, windows, resuming, wrong scenes."""

from __future__ import annotations

import json

import numpy as np
import pytest
import xarray as xr
from scipy.spatial.transform import Rotation
from strips import PERMEABILITY, VISCOSITY, between_plates, bleeding_at_both_ends, wet

from lcmchain import run
from lcmchain.errors import InputError
from lcmchain.scene import scene_from_text

# A saturated strip between stiff plates; the resin leaves at both ends. In SI units.
HALF, WIDTH, SPEED = 50e-3, 10e-3, 0.01
STRIP = (
    """
process = { time = "10 ms", frames = 3, mass_damping = "200 1/s" }
blank = { size = ["100 mm", "10 mm"], edge_length = "5 mm" }
material = { preset = "MD600" }
contact = { friction = 0.0, penalty = "40 MPa/mm" }"""
    + between_plates()
    + """
[output]
pictures = false
report = false
vtu = false"""
    + bleeding_at_both_ends()
)


@pytest.fixture(scope="module")
def squeezed():
    part = wet(STRIP)
    part.advance_to(6e-3)
    return part


def test_squeeze_flow_between_plates(squeezed):
    """p = mu h' (L² - x²) / (2 K h); per width its integral, 2 mu h' L³ / (3 K h)."""
    thickness = squeezed.filling.state.thickness.mean()
    assert thickness == pytest.approx(1.004e-3 - 0.06e-3, rel=0.01)
    # the surfaces of the plates give way to the pressure, which still rises a little
    speed = -squeezed.forming.get_fields(["thickness_rate"])["thickness_rate"].mean()
    assert speed == pytest.approx(SPEED, rel=0.03)
    largest = VISCOSITY * speed * HALF**2 / (2.0 * PERMEABILITY * thickness)
    assert squeezed.filling.state.pressure.max() == pytest.approx(largest, rel=0.01)
    assert squeezed.force()[2] == pytest.approx(4.0 / 3.0 * largest * HALF * WIDTH, rel=0.01)


def test_parts_of_the_force_and_all_resin_are_accounted_for(squeezed):
    total, fibres, resin, friction, inertia = np.array(squeezed.record.force).T
    np.testing.assert_allclose(fibres + resin + friction + inertia, total, rtol=1e-9, atol=1e-9)
    late = np.array(squeezed.record.time) > 2e-3
    assert np.abs(inertia[late]).max() < 0.01 * total[late].min()
    assert total[-1] > 80.0 and fibres[-1] > 1.0
    state = squeezed.filling.state
    assert np.abs(squeezed.record.balance_error).max() < 1e-12 * state.started_volume
    lost = 1.004e-3 * 2.0 * HALF * WIDTH - squeezed.forming.volume().sum()
    assert state.vented.sum() == pytest.approx(lost, rel=1e-4)
    assert state.pressure.min() >= 0.0
    assert state.fill.max() <= 1.0 and state.full.all()


def test_sheet_and_resin_have_the_same_volume(squeezed):
    of_sheet = squeezed.forming.volume()
    of_resin = squeezed.filling.state.thickness * squeezed.filling.mesh.areas
    np.testing.assert_allclose(of_resin, of_sheet, rtol=1e-5)
    assert squeezed.history.mean_iterations < 5.0


def test_the_answer_does_not_depend_on_the_windows(squeezed):
    halved = wet(STRIP.replace('"0.1 ms"', '"0.05 ms"'))
    halved.advance_to(6e-3)
    assert len(halved.history.accepted) > 1.5 * len(squeezed.history.accepted)
    assert halved.force()[2] == pytest.approx(squeezed.force()[2], rel=5e-3)


def test_the_resin_takes_the_time_that_the_scene_gives_it(squeezed):
    slower = wet(STRIP.replace('time = "10 ms"\nresin', 'time = "100 ms"\nresin'))
    slower.advance_to(6e-3)
    assert slower.filling.time == pytest.approx(60e-3)
    assert slower.force()[2] == pytest.approx(0.1 * squeezed.force()[2], rel=0.02)


def test_stopped_and_resumed_run_is_bit_identical(tmp_path):
    scene = scene_from_text(STRIP.replace('"10 ms", frames = 3', '"2 ms", frames = 2'))
    whole = run(scene, tmp_path / "whole", threads=1)

    class Stop(Exception):
        pass

    def stop(done, total, text):
        if done > 1.2e-3:
            raise Stop

    part = tmp_path / "part"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("lcmchain.forming_run.CHECKPOINT_INTERVAL", 0.0)
        with pytest.raises(Stop):
            run(scene, part, threads=1, progress=stop)
    assert len(list(part.glob("wet_forming_checkpoint_*.npz"))) == 1
    resumed = run(scene, part, threads=1, resume=True)
    assert not list(part.glob("wet_forming_checkpoint_*.npz"))
    for name, values in whole.datasets["/"].variables.items():
        np.testing.assert_array_equal(values, resumed.datasets["/"].variables[name], err_msg=name)
    for group in (None, "history"):
        first, second = (
            xr.open_dataset(folder / "sheet_filling.nc", group=group)
            for folder in (tmp_path / "whole", part)
        )
        with first, second:
            xr.testing.assert_equal(first, second)
    summary = json.loads((part / "summary.json").read_text())
    filling = summary["infiltration"]["sheet"]
    assert filling["closing"]["force_max"] > 0.0 and filling["balance_error"] < 1e-12
    assert "pore pressure" in summary["effects"] and "pore_pressure" in whole.datasets["/"]


def test_fibres_carry_the_permeability_along():
    """Two to one along the first fibres; the sheet is turned by 30° about its normal."""
    text = STRIP.replace(f'k2 = "{PERMEABILITY} m^2"', f'k2 = "{0.5 * PERMEABILITY} m^2"')
    part = wet(text)
    before = part.filling.medium.preform.permeability.copy()
    turn = Rotation.from_euler("z", 30, degrees=True).as_matrix()
    state = part.simulation.state
    state.position[:] = turn @ state.position
    part._permeability.renew(part.filling)
    after = part.filling.medium.preform.permeability
    np.testing.assert_allclose(np.linalg.eigvalsh(before[0])[1:], [0.5e-10, 1e-10])
    np.testing.assert_allclose(after, turn @ before @ turn.T, atol=1e-22)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("with_forming = {", 'closure = { type = "bag", pressure = "1 bar" }\nwith_forming = {',
         "closure.*with_forming"),
        ("with_forming = {", "trapped_air = true\nwith_forming = {", "trapped_air"),
        ('window = "0.1 ms"', 'window = "1 mm"', "with_forming.window"),
        ('window = "0.1 ms"', "tolerance = 0", "with_forming.tolerance"),
        ('[["49 mm", "-6 mm"', '[["49 m", "-6 mm"', 'vents.*"right"'),
    ],
)  # fmt: skip
def test_wrong_scenes_are_refused(old, new, message):
    assert old in STRIP
    with pytest.raises(InputError, match=message):
        wet(STRIP.replace(old, new))


def test_a_mesh_of_its_own_cannot_fill_while_the_blank_is_formed():
    table = STRIP[STRIP.index("[infiltration]") :]
    own = '[[mapping]]\nname = "own"\nkind = "infiltration"\nmesh = "own.vtu"\n' + table.replace(
        "infiltration", "mapping.infiltration"
    )
    with pytest.raises(InputError, match="with_forming"):
        scene_from_text(STRIP.replace(table, own))
