"""Units that refuse a step, fail or end; schemes that diverge; messages say what to do."""

import json
import shutil

import numpy as np
import pytest
import xarray as xr

from lcmchain.coupling.cosimulation.run import DivergenceWatch, run_system
from lcmchain.coupling.cosimulation.system_file import system_from
from lcmchain.errors import InputError, SimulationError


def ball(version=2, window="100 ms", **start):
    return {
        "stop_time": "1 s", "window": window,
        "units": [{"name": "ball", "fmu": f"Ball_{version}.fmu", "start": start}],
    }  # fmt: skip


def loop(gain, scheme="gauss-seidel", second="Follower_3", window="100 ms", **options):
    return {
        "stop_time": "10 s", "window": window,
        "units": [
            {"name": "a", "fmu": "Follower_2.fmu", "start": {"gain": gain, "shift": 1.0}},
            {"name": "b", "fmu": f"{second}.fmu"},
        ],
        "connections": ["a.y -> b.x_in", "b.y -> a.x_in"],
        "scheme": {"type": scheme, **options},
    }  # fmt: skip


def run(units, tmp_path, data):
    return run_system(system_from(data, None, directory=units), tmp_path / "out")


@pytest.mark.parametrize("version", [2, 3])
def test_a_refused_step_is_told_with_the_time_that_was_reached(units, tmp_path, version):
    data = ball(version, largest_step="30 ms")
    with pytest.raises(SimulationError) as caught:
        run(units, tmp_path, data)
    message = str(caught.value)
    assert (
        'part "ball" failed at 0 s, step 0.1 s: it refused the step and came to 0.03 s' in message
    )
    assert "the step is too long" in message and "window.smallest" in message
    # the record and the account of what was done are there
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert summary["state"].startswith("stopped: coupled part")
    assert summary["units"]["ball"]["discarded_step_count"] == 1
    assert "unit ball: discard [model]: the step is too long" in log_of(tmp_path)
    with xr.open_dataset(tmp_path / "out" / "cosimulation.nc") as record:
        assert record["time"].values.tolist() == [0.0]


def log_of(tmp_path):
    return (tmp_path / "out" / "lcmchain.log").read_text()


@pytest.mark.parametrize("version", [2, 3])
def test_a_refused_step_is_retried_shorter_where_windows_may_shrink(units, tmp_path, version):
    data = ball(version, {"size": "100 ms", "smallest": "10 ms"}, largest_step="30 ms")
    summary = run(units, tmp_path, data)
    assert summary["state"] == "complete"
    assert summary["restart_count"] == summary["units"]["ball"]["discarded_step_count"] > 1
    assert summary["window_count"] >= 34
    # the ball itself is exact, so that the steps do not matter
    whole = run(units, tmp_path / "whole", ball(version))
    assert summary["final_values"]["ball.height"] == pytest.approx(
        whole["final_values"]["ball.height"], rel=1e-12
    )
    assert summary["final_values"]["ball.bounces"] == whole["final_values"]["ball.bounces"] == 1


@pytest.mark.parametrize("version", [2, 3])
def test_a_failed_step_names_unit_time_step_inputs_and_its_words(units, tmp_path, version):
    data = ball(version, failing_time="450 ms")
    data["units"].append({"name": "foot", "fmu": "Follower_2.fmu", "start": {"shift": 2.5}})
    data["connections"] = ["foot.y -> ball.push"]
    with pytest.raises(SimulationError) as caught:
        run(units, tmp_path, data)
    message = str(caught.value)
    for part in ('"ball"', "at 0.4 s", "step 0.1 s", "the ball burst", "push 2.5 to 2.5"):
        assert part in message, message


@pytest.mark.parametrize("version", [2, 3])
def test_a_unit_may_ask_for_the_end(units, tmp_path, version):
    with pytest.raises(SimulationError, match='unit "ball": it asked for the end .* at 0.3 s'):
        run(units, tmp_path, ball(version, ending_time="300 ms"))
    at_the_end = ball(3, ending_time="1 s")
    assert run(units, tmp_path / "end", at_the_end)["state"] == "complete"


def test_an_explicit_scheme_that_diverges_is_stopped_with_advice(units, tmp_path):
    with pytest.raises(SimulationError) as caught:
        run(units, tmp_path, loop(-2.0))
    message = str(caught.value)
    assert "the explicit coupling (Gauss-Seidel) diverges at 1.2 s: a.y -> b.x_in swings" in message
    assert 'Take an implicit scheme: scheme.type = "iqn-ils"' in message
    assert "canGetAndSetFMUstate" not in message
    # and the advice is right
    summary = run(units, tmp_path / "advised", loop(-2.0, "iqn-ils"))
    assert summary["final_values"]["a.y"] == pytest.approx(1.0 / 3.0, rel=1e-6)


def test_jacobi_that_diverges_with_every_second_window_is_stopped(units, tmp_path):
    with pytest.raises(SimulationError, match=r"\(Jacobi\) diverges .* every second window"):
        run(units, tmp_path, loop(-2.0, "jacobi"))


def test_growth_without_swings_is_told_when_it_is_beyond_use(units, tmp_path):
    with pytest.raises(SimulationError, match=r"diverges .* has grown .* times since it was first"):
        run(units, tmp_path, loop(3.0))


@pytest.mark.parametrize("gain", [-0.9, 0.9, -1.0])
def test_couplings_that_fade_or_stay_are_not_stopped(units, tmp_path, gain):
    assert run(units, tmp_path, loop(gain))["state"] == "complete"


@pytest.mark.parametrize(
    "course", [lambda t: np.exp(0.3 * t) * np.sin(t), lambda t: np.exp(0.6 * t)]
)
def test_a_resolved_course_that_grows_is_no_divergence(course):
    """An oscillation and an instability of the units themselves, 2.6e10 times."""
    watch = DivergenceWatch(["x"])
    times = np.arange(0.0, 40.0, 0.1)
    grown = [watch.follow([np.array([course(t)])]) for t in times]
    assert grown == [""] * len(times)


def test_advice_names_units_that_cannot_go_back(units, tmp_path):
    data = loop(-2.0, second="OneWay_2")
    with pytest.raises(SimulationError, match='for it "b" would have to be able to go back'):
        run(units, tmp_path, data)
    with pytest.raises(InputError, match='unit "b" cannot go back .* the scheme "iqn-ils" needs'):
        run(units, tmp_path / "more", loop(-2.0, "iqn-ils", second="OneWay_2"))
    shrinking = loop(0.5, second="OneWay_2", window={"size": "1 s", "smallest": "100 ms"})
    with pytest.raises(InputError, match="a window that can be halved"):
        run(units, tmp_path / "shrinking", shrinking)
    growing = {"size": "100 ms", "largest": "1 s", "residual": 0.1}
    with pytest.raises(InputError, match="steps of one size only"):
        run(units, tmp_path / "growing", loop(0.5, second="OneWay_2", window=growing))


def test_an_iteration_that_does_not_converge_speaks_of_the_file_of_the_system(units, tmp_path):
    with pytest.raises(SimulationError) as caught:
        run(units, tmp_path, loop(-2.0, "fixed-point", most_iterations=5))
    message = str(caught.value)
    assert "b.y -> a.x_in still changes by" in message
    assert 'scheme.type = "iqn-ils"' in message and "WindowControl" not in message


def test_archives_without_a_library_for_this_machine_or_a_damaged_one(units, tmp_path):
    import zipfile

    with zipfile.ZipFile(units / "Ball_2.fmu") as archive:
        description = archive.read("modelDescription.xml")
        whole = archive.read("binaries/linux64/Ball.so")
    for name, library, reason in (
        ("none", ("binaries/win64/Ball.dll", b""), r"no library for this machine .* it has win64"),
        ("broken", ("binaries/linux64/Ball.so", b"\x7fELF nonsense"), "is damaged"),
        # loading these would end the process by a signal
        ("half", ("binaries/linux64/Ball.so", whole[: len(whole) // 2]), "is damaged"),
        ("head", ("binaries/linux64/Ball.so", whole[:4096]), "is damaged"),
        ("text", ("binaries/linux64/Ball.so", b"nonsense"), "cannot be loaded"),
    ):
        file = tmp_path / f"{name}.fmu"
        with zipfile.ZipFile(file, "w") as archive:
            archive.writestr("modelDescription.xml", description)
            archive.writestr(*library)
        data = ball()
        data["units"][0]["fmu"] = str(file)
        with pytest.raises(InputError, match=reason) as caught:
            run(units, tmp_path / name, data)
        assert '"ball"' in str(caught.value)
        assert not (tmp_path / name / "out").exists()


def test_a_unit_that_refuses_its_token_cannot_be_instantiated(units, tmp_path):
    import zipfile

    file = tmp_path / "other.fmu"
    with zipfile.ZipFile(units / "Ball_3.fmu") as source, zipfile.ZipFile(file, "w") as target:
        for name in source.namelist():
            content = source.read(name)
            target.writestr(name, content.replace(b'Token="Ball"', b'Token="Bell"'))
    data = ball()
    data["units"][0]["fmu"] = str(file)
    with pytest.raises(InputError, match='unit "ball" could not be instantiated'):
        run(units, tmp_path, data)


def test_units_that_a_process_can_hold_once_need_a_process_each(units, tmp_path):
    from dataclasses import replace

    import models
    from unit_builder import build

    model = replace(
        models.FOLLOWER, name="Once", options={"canBeInstantiatedOnlyOncePerProcess": "true"}
    )
    build(model, 2, tmp_path)
    data = loop(0.5)
    for unit in data["units"]:
        unit |= {"fmu": "Once_2.fmu", "start": {}, "process": "shared"}
    with pytest.raises(InputError, match='a process can hold one only.*process = "own"'):
        run(tmp_path, tmp_path / "x", data)
    data["units"][1]["process"] = "own"
    assert run(tmp_path, tmp_path / "y", data)["state"] == "complete"
    shutil.rmtree(tmp_path / "Once_2")
