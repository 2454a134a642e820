"""Resin that flows while a sheet is formed in stages: clocks, rest, resuming, gates of stages."""

from __future__ import annotations

import json
import re

import numpy as np
import pytest
import xarray as xr
from strips import PERMEABILITY, VISCOSITY, between_plates, bleeding_at_both_ends, wet

from lcmchain import run
from lcmchain.coupling.iteration import NotConverged
from lcmchain.errors import InputError, SimulationError
from lcmchain.scene import scene_from_text
from lcmchain.scene.resin_stages import resin_stages

MS = 1e-3
T = 1.004e-3
HALF, WIDTH, SPEED = 50e-3, 10e-3, 0.02
PRESSED, OPENED = 4e-5, 1e-4

#: It is saturated; the resin leaves at both ends.
STRIP = (
    """
process = { frames = 9, mass_damping = "200 1/s" }
blank = { size = ["100 mm", "10 mm"], edge_length = "5 mm" }
material = { preset = "MD600" }
contact = { friction = 0.0, penalty = "40 MPa/mm" }
output = { pictures = false, vtu = false }"""
    + between_plates('stages = ["close", "hold"]')
    + bleeding_at_both_ends(time="6 ms")
)

STAGES = f"""
[[stages]]
name = "close"
time = "2 ms"
motions.press = {{ type = "stroke", direction = [0, 0, -1], distance = "{1e3 * PRESSED} mm", \
profile = "linear" }}
[[stages]]
name = "hold"
time = "0.5 ms"
resin_time = "3 ms"
[[stages]]
name = "release"
time = "20 ms"
rest = true
[[stages]]
name = "lie"
time = "0.5 ms"
"""

#: Pressed by a stage that ends at rest.
SQUEEZED = STAGES.replace('time = "0.5 ms"\nresin_time = "3 ms"', (
    'time = "2 ms"\nrest = true\nmotions.press = { type = "stroke", direction = [0, 0, -1], '
    'distance = "0.1 mm" }')
)  # fmt: skip


#: At which the part is looked at [ms].
TIMES = (1.0, 2.0, 2.5, 8.0, 22.5, 23.0)


def told(part):
    """What a part is like now."""
    state = part.filling.state
    return {
        "resin_time": part.filling.time,
        "pressure": state.pressure.max(),
        "thickness": state.thickness.mean(),
        "vented": state.vented.sum(),
        "resin": state.resin_volume.copy(),
        "fill": state.fill.copy(),
        "full": int(state.full.sum()),
        "force": part.force(),
        "volume": part.forming.volume(),
        "of_resin": state.thickness * part.filling.mesh.areas,
        "balance": abs(state.balance_error) / state.started_volume,
    }


@pytest.fixture(scope="module")
def way():
    """The part at its end, and what it was like at some times, by these [ms]."""
    part, found = wet(STRIP + STAGES), {}
    for time in TIMES:
        part.advance_to(time * MS)
        found[time] = told(part)
    return part, found


def test_each_stage_has_its_pace_between_the_clocks(way):
    """Stages share by their times what others leave of the time; at rest the clock stands."""
    part, found = way
    clocks = [(stage.resin_start, stage.resin_end) for stage in part.stages]
    np.testing.assert_allclose(
        clocks, [(0, 2.4 * MS), (2.4 * MS, 5.4 * MS), (5.4 * MS, 5.4 * MS), (5.4 * MS, 6 * MS)],
        rtol=1e-12,
    )  # fmt: skip
    for time, clock in ((1.0, 1.2), (2.0, 2.4), (2.5, 5.4), (8.0, 5.4), (22.5, 5.4), (23.0, 6.0)):
        assert found[time]["resin_time"] == pytest.approx(clock * MS, rel=1e-12)


def test_a_stage_squeezes_resin_out_at_its_own_pace(way):
    """p = mu h' L²/(2 K h) by the clock of the resin, 1.2 times that of forming."""
    _, found = way
    thickness = found[2.0]["thickness"]
    assert thickness == pytest.approx(T - PRESSED, rel=0.01)
    largest = VISCOSITY * (SPEED / 1.2) * HALF**2 / (2.0 * PERMEABILITY * thickness)
    assert found[2.0]["pressure"] == pytest.approx(largest, rel=0.06)
    assert found[2.0]["force"][2] == pytest.approx(4 / 3 * largest * HALF * WIDTH, rel=0.06)
    # held for 3 ms of the resin, the pressure goes; what flows off is what plates give way by
    assert found[2.5]["pressure"] < 0.1 * found[2.0]["pressure"]
    assert found[2.5]["vented"] > found[2.0]["vented"]


def test_no_resin_flows_in_a_stage_that_ends_at_rest(way):
    """The sheet springs back without pressure; the resin stays where it is, and air comes in."""
    part, found = way
    for time in (8.0, 22.5):
        np.testing.assert_array_equal(found[time]["resin"], found[2.5]["resin"])
        assert found[time]["vented"] == found[2.5]["vented"]
        assert found[time]["pressure"] == 0.0 and found[time]["force"] == (0.0,) * 5
    assert found[2.5]["thickness"] < T - 0.9 * PRESSED
    assert found[22.5]["thickness"] == pytest.approx(T, rel=2e-3)
    assert found[22.5]["full"] == 0 < found[2.5]["full"]
    pores = part.filling.medium.pores(np.full(part.filling.mesh.cell_count, T))
    np.testing.assert_allclose(found[22.5]["fill"], found[2.5]["resin"] / pores, rtol=5e-3)


def test_sheet_and_resin_have_one_volume_and_all_resin_is_accounted_for(way):
    part, found = way
    for time, now in found.items():
        assert now["balance"] < 1e-12, time
        tolerance = 1e-12 if time in (8.0, 22.5) else 1e-5
        np.testing.assert_allclose(now["of_resin"], now["volume"], rtol=tolerance, err_msg=time)
    energy = part.simulation.energy()
    assert abs(energy["balance_error"]) < 0.02 * energy["external"]


#: The press is away, and the clock of the resin goes on.
OPENED = STAGES.replace("rest = true", 'mass_damping = "400 1/s"').replace('"20 ms"', '"10 ms"')


def test_suction_holds_a_sheet_together_whose_faces_are_closed_and_air_lets_it_go():
    """Without a face that lets air in, a sheet that springs back must draw resin from somewhere."""
    found = {}
    for faces in ("closed", "air"):
        text = STRIP.replace("with_forming = {", f'with_forming = {{ open_faces = "{faces}",')
        part = wet(text + OPENED)
        part.advance_to(2.5 * MS)
        held = told(part)
        part.advance_to(12.5 * MS)
        now, state = told(part), part.filling.state
        np.testing.assert_allclose(now["of_resin"], now["volume"], rtol=5e-5)
        assert now["balance"] < 1e-12 and now["vented"] >= held["vented"]
        found[faces] = held, now, state.pressure
    for one, other in zip(found["closed"][0], found["air"][0], strict=True):
        assert np.array_equal(found["closed"][0][one], found["air"][0][other])
    held, closed, suction = found["closed"]
    assert closed["thickness"] == pytest.approx(held["thickness"], rel=2e-3)
    assert suction.max() < -1e3
    _, opened, pressure = found["air"]
    assert opened["thickness"] == pytest.approx(T, rel=5e-3)
    assert np.abs(pressure).max() < 1.0 and opened["fill"].max() < 0.97


def test_a_sheet_that_is_pressed_in_a_stage_at_rest_is_an_error():
    part = wet(STRIP.replace('["close", "hold"]', '["close", "hold", "release"]') + SQUEEZED)
    with pytest.raises(SimulationError, match="in the stage hold.*more resin.*mass_damping"):
        part.advance_to(5 * MS)


def test_sheet_and_resin_that_do_not_agree_name_entries_of_the_scene(monkeypatch):
    part = wet(STRIP + GATE.replace('"hold", "lie"', '"close"') + STAGES)

    def disagree(*_):
        raise NotConverged("they differ.", "IQN-ILS", exchange="", value=0, residual=1.0, limit=0.1)

    monkeypatch.setattr(part._system, "advance_to", disagree)
    with pytest.raises(NotConverged) as caught:
        part.advance_to(5 * MS)
    said = str(caught.value)
    assert said.startswith("they differ. Likely cause") and "IQN-ILS" not in said
    assert "the gate hose that grows" in said and "infiltration.with_forming.tolerance" in said


def test_a_run_that_is_killed_in_each_stage_resumes_to_the_same_bits(tmp_path):
    """And its files and its report say what happened in each of them."""
    scene = scene_from_text(STRIP + STAGES)
    whole = run(scene, tmp_path / "whole", threads=1)

    class Killed(Exception):
        pass

    times = [0.7 * MS, 2.2 * MS, 9 * MS, 22.7 * MS]

    def kill(done, total, text):
        if times and done > times[0]:
            times.pop(0)
            raise Killed

    part = tmp_path / "part"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("lcmchain.forming_run.CHECKPOINT_INTERVAL", 0.0)
        for number in range(4):
            with pytest.raises(Killed):
                run(scene, part, threads=1, progress=kill, resume=number > 0)
    resumed = run(scene, part, threads=1, resume=True)
    for name, values in whole.datasets["/"].variables.items():
        np.testing.assert_array_equal(values, resumed.datasets["/"].variables[name], err_msg=name)
    for group in (None, "history"):
        first, second = (
            xr.open_dataset(folder / "sheet_filling.nc", group=group)
            for folder in (tmp_path / "whole", part)
        )
        with first, second:
            xr.testing.assert_equal(first, second)
    say_stages(tmp_path / "whole")


def say_stages(folder):
    with xr.open_dataset(folder / "sheet_filling.nc", decode_times=False) as found:
        assert found["stage"].attrs["flag_meanings"] == "close hold release lie"
        stages, times = found["stage"].values.tolist(), found["time"].values
        assert stages == sorted(stages) and set(stages) == {0, 1, 2, 3}
        assert np.all(np.diff(times) > 0.0)
        released = stages.index(2)
        assert times[released] == pytest.approx(5.4 * MS, rel=1e-8)
        fill = found["fill_factor"].values
        assert fill[released - 1].min() == 1.0 > fill[released].max()
    summary = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
    stages = summary["infiltration"]["sheet"]["stages"]
    assert list(stages) == ["close", "hold", "release", "lie"]
    assert stages["hold"]["filled_share"] == pytest.approx(1.0, abs=1e-6)
    assert stages["release"]["filled_share"] < 0.97
    assert stages["release"]["vented_volume"] == 0.0 < stages["hold"]["vented_volume"]
    assert stages["close"]["force_max"] > 50.0 > stages["release"]["force_max"] == 0.0
    report = (folder / "report.html").read_text(encoding="utf-8")
    assert "of the resin, 100.0% filled at its end" in report


@pytest.mark.slow
def test_a_stack_goes_through_its_stages_and_resumes_in_each_of_them(tmp_path):
    """Two plies: the columns are found anew behind the border of a stage, and at rest."""
    text = STRIP.replace("process =", 'layup = "[0/90]2"\nprocess =', 1)
    text = text.replace('"0 0 0.502 mm"', '"0 0 1.506 mm"')
    text = re.sub(r'"(-?)1 mm"', r'"\g<1>9 mm"', text) + STAGES.replace('"20 ms"', '"4 ms"')
    times = np.array([1.0, 2.2, 4.0, 6.7]) * MS
    whole = wet(text)
    for number, time in enumerate(times):
        whole.advance_to(time)
        whole.write_checkpoint(tmp_path, number)
    assert whole.filling.time > 5.4 * MS and whole.filling.state.fill.max() < 0.995
    of_resin = whole.filling.state.thickness * whole.filling.mesh.areas
    np.testing.assert_allclose(of_resin, whole.forming.volume(), rtol=1e-4)
    assert abs(whole.filling.state.balance_error) < 1e-12 * whole.filling.state.started_volume
    for number in range(3):
        other = wet(text)
        other.restore_checkpoint(tmp_path, number)
        for time in times[number + 1 :]:
            other.advance_to(time)
        for name, values in whole.simulation.state.as_dict().items():
            np.testing.assert_array_equal(other.simulation.state.as_dict()[name], values, name)
        first, second = whole.filling.save(), other.filling.save()
        for name in ("resin_volume", "pressure", "thickness", "vented"):
            np.testing.assert_array_equal(getattr(first, name), getattr(second, name), name)


# --- tables ---------------------------------------------------------------------------------------

GATE = """
[[infiltration.gates]]
name = "hose"
box = [["-1 mm", "-60 mm", "-9 mm"], ["1 mm", "60 mm", "9 mm"]]
pressure = ["1 bar", "2 bar"]
times = ["0 s", "1 ms"]
opens = "0.5 ms"
stages = ["hold", "lie"]
"""


def test_gates_and_vents_of_stages_count_their_times_from_there():
    """From when the first of their stages begins for the resin, to when the last one ends."""
    case = scene_from_text(STRIP + GATE + STAGES).wet_forming
    (gate,) = case.gates
    assert gate.opens == pytest.approx(2.9 * MS) and gate.closes is None
    np.testing.assert_allclose(gate.times, [2.4 * MS, 3.4 * MS])
    early = scene_from_text(STRIP + GATE.replace('"hold", "lie"', '"close"') + STAGES)
    (gate,) = early.wet_forming.gates
    assert (gate.opens, gate.closes) == (pytest.approx(0.5 * MS), pytest.approx(2.4 * MS))
    assert gate.times == (0.0, 1 * MS)
    vents = STRIP.replace("bleeds = true", 'bleeds = true\nstages = ["lie"]', 1)
    vent = scene_from_text(vents + STAGES).wet_forming.vents[0]
    assert vent.opens == pytest.approx(5.4 * MS) and vent.closes is None


def test_all_times_may_be_given():
    text = STAGES.replace('time = "2 ms"', 'time = "2 ms"\nresin_time = "2 s"')
    text = text.replace('"3 ms"', '"30 s"').replace(
        'name = "lie"\n', 'name = "lie"\nresin_time = "1 s"\n'
    )
    stages = resin_stages(scene_from_text(STRIP.replace('time = "6 ms"', 'time = "33 s"') + text))
    assert [stage.resin_end for stage in stages] == [2.0, 32.0, 32.0, 33.0]


WRONG = {
    "no time": (
        'time = "2 ms"\n', "", r'stages\[0\] "close".time: is missing, and resin flows',
    ),
    "too long": (
        'resin_time = "3 ms"', 'resin_time = "6 ms"',
        'infiltration.time: is 0.006 s.*nothing is left for the stage "close"',
    ),
    "at rest": ("rest = true", 'rest = true\nresin_time = "1 ms"', "resin_time: stands beside"),
    "unknown stage": ('["hold", "lie"]', '["hold", "lay"]', 'gates.*hose".stages: names "lay"'),
    "left out": ('["hold", "lie"]', '["close", "lie"]', 'stages: leaves out "hold"'),
    "no flow": ('["hold", "lie"]', '["release"]', 'stages: names "release", which ends at rest'),
    "too late": ('opens = "0.5 ms"', 'opens = "5 ms"', "but it opens at 0.005 s"),
    "dry": ('with_forming = { window = "0.1 ms" }\n', "", "without with_forming; give that"),
}  # fmt: skip


@pytest.mark.parametrize("case", WRONG)
def test_wrong_stages_of_a_resin_are_refused(case):
    old, new, message = WRONG[case]
    text = STRIP + GATE + STAGES
    assert old in text
    with pytest.raises(InputError, match=message):
        scene_from_text(text.replace(old, new))


def test_a_stage_without_resin_has_no_time_for_it():
    text = STRIP.replace('with_forming = { window = "0.1 ms" }\n', "") + STAGES
    with pytest.raises(InputError, match="resin_time: belongs to a resin"):
        scene_from_text(
            text + '[[infiltration.gates]]\nname = "g"\nrim = true\npressure = "1 bar"\n'
        )


def test_all_times_have_one_sum():
    text = STAGES.replace('time = "2 ms"', 'time = "2 ms"\nresin_time = "2 s"')
    text = text.replace('name = "lie"\n', 'name = "lie"\nresin_time = "1 s"\n')
    with pytest.raises(InputError, match="time: is 0.006 s, but the stages take 3.003"):
        scene_from_text(STRIP + text)


def test_gates_of_stages_need_stages_in_which_resin_flows():
    one = STRIP.replace("process = { ", 'process = { time = "2 ms", ')
    one = one.replace('stages = ["close", "hold"]\n', "")
    with pytest.raises(InputError, match='names "hold", but the process has no stages'):
        scene_from_text(one + GATE)


def test_a_process_of_rest_alone_has_no_time_for_resin():
    text = STRIP.replace('stages = ["close", "hold"]', 'stages = ["release"]')
    text += '[[stages]]\nname = "release"\ntime = "20 ms"\nrest = true\n'
    with pytest.raises(InputError, match="with_forming: lets resin flow.*all stages end at rest"):
        scene_from_text(text)
