"""The initialisation: outputs reach inputs in the right order, and loops are solved."""

import numpy as np
import pytest

from lcmchain.errors import InputError, SimulationError


def gains(*gains_and_shifts, links, version=2):
    return {
        "stop_time": "1 s", "window": "0.5 s", "connections": links,
        "units": [
            {"name": name, "fmu": f"Gain_{version}.fmu", "start": {"gain": gain, "shift": shift}}
            for name, gain, shift in gains_and_shifts
        ],
    }  # fmt: skip


def outputs(assembly):
    return [float(part.get_fields(["y"])["y"][0]) for part in assembly.parts.values()]


@pytest.mark.parametrize("version", [2, 3])
def test_a_chain_is_followed_whatever_the_order_of_its_connections(assembled, version):
    chain = [("a", 2.0, 1.0), ("b", 3.0, 0.0), ("c", 1.0, -4.0), ("d", 5.0, 0.0)]
    links = ["c.y -> d.x_in", "a.y -> b.x_in", "b.y -> c.x_in"]
    assembly = assembled(gains(*chain, links=links, version=version))
    assert outputs(assembly) == [1.0, 3.0, -1.0, -5.0]
    assert assembly.loops == {}


@pytest.mark.parametrize("version", [2, 3])
@pytest.mark.parametrize("gain", [0.4, -3.0, 8.0])
def test_a_loop_is_solved_also_where_its_fixed_point_would_diverge(assembled, gain, version):
    links = ["a.y -> b.x_in", "b.y -> a.x_in"]
    assembly = assembled(gains(("a", gain, 1.0), ("b", 2.0, 3.0), links=links, version=version))
    y = (gain * 3.0 + 1.0) / (1.0 - 2.0 * gain)
    assert outputs(assembly) == pytest.approx([y, 2.0 * y + 3.0], rel=1e-11)
    (iterations,) = assembly.loops.values()
    assert iterations < 10


def test_a_loop_without_a_solution_names_its_connections(assembled):
    links = ["a.y -> b.x_in", "b.y -> a.x_in"]
    with pytest.raises(SimulationError, match="algebraic loop .* does not converge") as caught:
        assembled(gains(("a", 1.0, 1.0), ("b", 1.0, 0.0), links=links))
    assert all(link in str(caught.value) for link in links)


def test_a_pair_without_feedthrough_is_no_loop(assembled):
    """The force depends on the position, the position on no force."""
    assembly = assembled(
        {
            "stop_time": "1 s", "window": "0.5 s",
            "connections": ["b.force -> a.force", "a.position -> b.position1"],
            "units": [{"name": "a", "fmu": "Mass_2.fmu", "start": {"position0": "20 cm"}},
                      {"name": "b", "fmu": "Tail_3.fmu"}],
        }
    )  # fmt: skip
    assert assembly.loops == {}
    assert assembly.parts["b"].get_fields(["position1"])["position1"] == 200.0  # mm
    assert assembly.parts["a"].get_fields(["force"])["force"] == pytest.approx(-0.2, rel=1e-15)


def test_temperatures_are_converted_with_their_offset(assembled):
    data = {
        "stop_time": "1 s", "window": "1 s", "scheme": {"type": "gauss-seidel"},
        "units": [{"name": "kettle", "fmu": "Kettle_2.fmu"},
                  {"name": "sensor", "fmu": "Sensor_3.fmu"}],
        "connections": ["kettle.temperature -> sensor.temperature"],
    }  # fmt: skip
    assembly = assembled(data)
    assembly.coupled.advance_to(1.0)
    assert assembly.parts["sensor"].get_fields(["seen"])["seen"] == 293.15
    data["connections"] = [
        {"link": "kettle.temperature -> sensor.temperature", "factor": 2.0, "offset": 1.0}
    ]
    assert assembled(data).parts["sensor"].get_fields(["temperature"])["temperature"] == 587.3
    data["connections"][0] |= {"convert_units": False}
    assert assembled(data).parts["sensor"].get_fields(["temperature"])["temperature"] == 41.0


def test_units_of_other_dimensions_are_refused_and_lacking_ones_told(assembled):
    data = {
        "stop_time": "1 s", "window": "1 s",
        "units": [{"name": "kettle", "fmu": "Kettle_2.fmu"}, {"name": "a", "fmu": "Mass_2.fmu"},
                  {"name": "foot", "fmu": "Follower_2.fmu"}],
        "connections": ["kettle.temperature -> a.force"],
    }  # fmt: skip
    with pytest.raises(InputError, match=r"degC \(K\) cannot be converted into N") as caught:
        assembled(data)
    assert "kettle.temperature -> a.force" in str(caught.value)
    data["connections"] = ["foot.y -> a.force"]
    assembly = assembled(data)
    assert assembly.remarks == [
        'connection "foot.y -> a.force": "y" has no unit of measurement and is taken to be in N'
    ]
    data["units"][2]["quantities"] = {"y": "kN"}
    data["units"][2]["start"] = {"shift": 1.5}
    data["scheme"] = {"type": "gauss-seidel"}
    data["units"] = [data["units"][i] for i in (2, 0, 1)]
    assembly = assembled(data)
    assert assembly.remarks == []
    assembly.coupled.advance_to(1.0)
    assert assembly.parts["a"].get_fields(["force"])["force"] == 1500.0
    assert np.isclose(assembly.parts["a"].get_fields(["position"])["position"][0], 690.0, rtol=1e-2)
