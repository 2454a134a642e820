"""Loops of whole numbers, switches and texts, iterated until nothing of them changes."""

from dataclasses import replace

import numpy as np
import pytest
import xarray as xr
from models import FOLLOWER
from unit_builder import Model, Var, build

from lcmchain.coupling.cosimulation.run import run_system
from lcmchain.coupling.cosimulation.system_file import system_from
from lcmchain.errors import InputError, SimulationError

#: A whole number that answers to another one, more from step to step; a text that tells it; a
#: switch that follows or, where ``invert`` is 1, contradicts.
RING = Model(
    "Ring",
    [
        Var("x_in", "input", "whole", 0),
        Var("word_in", "input", "text", "none"),
        Var("on_in", "input", "truth", False),
        Var("part", "parameter", "whole", 2),
        Var("invert", "parameter", "truth", False),
        Var("y", kind="whole", variability="discrete"),
        Var("word", kind="text", variability="discrete"),
        Var("seen", kind="text", variability="discrete"),
        Var("on", kind="truth", variability="discrete"),
        Var("steps", "local", "whole", 0),
    ],
    advance="""steps++; y = x_in / part + 3 * steps; snprintf(word, 64, "%d", (int)y);
        strcpy(seen, word_in); on = invert ? !on_in : on_in; return 0;""",
)
#: Discrete reals: y = gain x + shift after a step.
JUMPER = replace(
    FOLLOWER,
    name="Hopper",
    variables=[
        v if v.causality == "parameter" else replace(v, variability="discrete")
        for v in FOLLOWER.variables
    ],
)
#: Continuous: y = gain x + push / 10 after a step.
RIDER = Model(
    "Rider",
    [
        Var("x_in", "input", start=0.0),
        Var("push", "input", start=0.0),
        Var("gain", "parameter", start=1.0),
        Var("y"),
    ],
    advance="y = gain * x_in + 0.1 * push; return 0;",
)
LINKS = [f"{a}.{out} -> {b}.{taken}" for a, b in (("one", "two"), ("two", "one"))
         for out, taken in (("y", "x_in"), ("word", "word_in"))]  # fmt: skip
SWITCHES = ["one.on -> two.on_in", "two.on -> one.on_in"]


@pytest.fixture(scope="module")
def rings(units):
    for model in (RING, JUMPER, RIDER):
        for version in (2, 3):
            build(model, version, units)
    return units


def ring(scheme="jacobi", versions=(2, 3), links=LINKS, **options):
    return {
        "stop_time": "4 s", "window": "1 s", "connections": links,
        "units": [
            {"name": "one", "fmu": f"Ring_{versions[0]}.fmu", "start": {"part": 2}},
            {"name": "two", "fmu": f"Ring_{versions[1]}.fmu", "start": {"part": 3}},
        ],
        "scheme": {"type": scheme, "jumps": "iterated", **options},
    }  # fmt: skip


def own_loop(windows, serial):
    """Return both numbers at the ends of the windows, and the iterations of all windows."""
    y, rows, count = [0, 0], [(0, 0)], 0
    for n in range(1, windows + 1):
        given = list(y)
        while True:
            count += 1
            one = given[1] // 2 + 3 * n
            two = (one if serial else given[0]) // 3 + 3 * n
            settled = given[1] == two and (serial or given[0] == one)
            given = [one, two]
            if settled:
                break
        y = given
        rows.append((one, two))
    return np.array(rows), count


@pytest.mark.parametrize("versions", [(2, 3), (3, 2)])
@pytest.mark.parametrize("scheme, serial", [("jacobi", False), ("gauss-seidel", True)])
def test_a_loop_of_whole_numbers_and_texts_rests_at_every_window(
    rings, tmp_path, scheme, serial, versions
):
    """Both units have what the other one has at the end; repeated windows count no step twice."""
    out = tmp_path / "out"
    summary = run_system(system_from(ring(scheme, versions), None, directory=rings), out)
    record = {name: xr.load_dataset(out / "cosimulation.nc", group=name) for name in ("one", "two")}
    expected, count = own_loop(4, serial)
    for name, column in (("one", 0), ("two", 1)):
        assert record[name]["y"].values.tolist() == expected[:, column].tolist()
    assert expected[-1, 0] == expected[-1, 1] // 2 + 12 and expected[-1, 1] > 12
    assert record["one"]["seen"].values[-1] == str(expected[-1, 1])
    assert record["two"]["seen"].values[-1] == str(expected[-1, 0])
    # one more in each window where a text follows a number that has settled
    assert summary["iteration_count"] == count and count > 8


def test_without_the_request_each_answers_to_the_window_before(rings, tmp_path):
    data = ring("jacobi", jumps="once")
    found = run_system(system_from(data, None, directory=rings), tmp_path / "out")
    y = [0, 0]
    for n in range(1, 5):
        y = [y[1] // 2 + 3 * n, y[0] // 3 + 3 * n]
    assert [found["final_values"][f"{name}.y"] for name in ("one", "two")] == y
    assert found["iteration_count"] == 4
    assert y != own_loop(4, False)[0][-1].tolist()


@pytest.mark.parametrize("scheme", ["jacobi", "gauss-seidel"])
def test_a_loop_without_a_state_of_rest_ends_with_its_variables(rings, tmp_path, scheme):
    data = ring(scheme, links=SWITCHES, most_iterations=7)
    data["units"][1]["start"]["invert"] = True
    with pytest.raises(SimulationError) as caught:
        run_system(system_from(data, None, directory=rings), tmp_path / "out")
    message = str(caught.value)
    for part in ("does not come to rest in 7 iterations", "from 0 s", "two.on -> one.on_in from ",
                 "scheme.most_iterations", 'scheme.jumps = "once"'):  # fmt: skip
        assert part in message, message
    assert "from true to false" in message or "from false to true" in message
    data["units"][1]["start"]["invert"] = False
    assert run_system(system_from(data, None, directory=rings), tmp_path / "b")["iteration_count"]


def test_fields_and_jumps_are_iterated_together(rings, assembled):
    """A fixed point of reals that hangs on a number of the loop: y = -2 y + number / 10."""
    data = ring("iqn-ils", relative=1e-10)
    data["units"] += [
        {"name": "a", "fmu": "Rider_2.fmu", "start": {"gain": -2.0}},
        {"name": "b", "fmu": "Follower_3.fmu"},
        {"name": "c", "fmu": "Hopper_2.fmu", "start": {"gain": 0.5, "shift": 1.0}},
    ]
    data["connections"] = [
        *LINKS,
        "a.y -> b.x_in",
        "b.y -> a.x_in",
        "two.y -> a.push",
        "two.y -> c.x_in",
    ]
    assembly = assembled(data)
    assembly.coupled.advance_to(4.0, lambda _: assembly.lines.refresh())
    expected = own_loop(4, True)[0][-1]
    found = assembly.coupled.get_fields(["one.y", "two.y", "a.y", "c.y"])
    assert [found["one.y"][0], found["two.y"][0]] == expected.tolist()
    assert found["c.y"][0] == 1.0 + 0.5 * expected[1]
    assert found["a.y"][0] == pytest.approx(expected[1] / 30.0, rel=1e-8)


def test_discrete_reals_rest_up_to_the_tolerance(rings, assembled):
    """y = 1 - z / 2, z = y: the fixed point is 2/3; where it is 1 - 2 z there is none."""

    def data(gain):
        return {
            "stop_time": "1 s", "window": "500 ms",
            "units": [{"name": "a", "fmu": "Hopper_2.fmu", "start": {"gain": gain, "shift": 1.0}},
                      {"name": "b", "fmu": "Hopper_3.fmu"}],
            "connections": ["a.y -> b.x_in", "b.y -> a.x_in"],
            "scheme": {"type": "gauss-seidel", "jumps": "iterated", "relative": 1e-8},
        }  # fmt: skip

    assembly = assembled(data(-0.5))
    assembly.coupled.advance_to(1.0)
    found = assembly.coupled.get_fields(["a.y", "b.y"])
    assert found["a.y"][0] == pytest.approx(2.0 / 3.0, rel=1e-7)
    assert found["b.y"][0] == found["a.y"][0]
    assembly = assembled(data(-2.0))
    with pytest.raises(SimulationError, match=r"b\.y -> a\.x_in from"):
        assembly.coupled.advance_to(1.0)


def test_a_saved_system_goes_on_with_the_same_bits(rings, assembled):
    ends = []
    for saves in (False, True):
        assembly = assembled(ring("jacobi"))
        refresh = lambda _, lines=assembly.lines: lines.refresh()  # noqa: E731
        assembly.coupled.advance_to(2.0, refresh)
        if saves:
            kept = assembly.coupled.save()
            assembly.coupled.advance_to(3.0, refresh)
            assembly.coupled.restore(kept)
            assembly.lines.refresh()
        assembly.coupled.advance_to(4.0, refresh)
        parts = assembly.parts.values()
        ends.append(
            [part.read(part.description.find(n))[0] for part in parts for n in ("y", "seen")]
        )
        ends[-1].append(assembly.coupled.history.windows[-1].iterations)
    assert ends[0] == ends[1]


@pytest.mark.parametrize(
    "change, key, words",
    [
        ({"connections": LINKS[:2], "scheme": {"type": "gauss-seidel", "jumps": "iterated"}},
         "scheme.jumps", "leads back"),
        ({"connections": ["one.x -> two.x_in"], "scheme": {"jumps": "always"}},
         "scheme.jumps", "once"),
    ],
)  # fmt: skip
def test_what_cannot_be_iterated_is_told(rings, assembled, change, key, words):
    with pytest.raises(InputError, match=words) as caught:
        assembled({**ring(), **change})
    assert key in str(caught.value)


def test_a_unit_that_cannot_go_back_is_refused(rings, assembled):
    data = ring()
    data["units"].append({"name": "third", "fmu": "OneWay_2.fmu"})
    with pytest.raises(InputError, match=r'"third" cannot go back.*scheme\.jumps') as caught:
        assembled(data)
    assert caught.value.key == "scheme.jumps"
