"""Switches, whole numbers and texts: when they arrive, and that they are not iterated."""

import os
from dataclasses import replace

import numpy as np
import pytest
import xarray as xr
from models import FOLLOWER
from unit_builder import build

from lcmchain.coupling.cosimulation.run import run_system
from lcmchain.coupling.cosimulation.system_file import system_from
from lcmchain.errors import InputError

LINKS = [f"{a}.{x} -> {b}.{x}_in" for a, b in (("one", "two"), ("two", "one"))
         for x in ("on", "count", "word")]  # fmt: skip


def system(scheme, versions=(2, 3), **options):
    return {
        "stop_time": "4 s", "window": "1 s", "connections": LINKS,
        "units": [
            {"name": "one", "fmu": f"Counter_{versions[0]}.fmu", "start": {"first": 10}},
            {"name": "two", "fmu": f"Counter_{versions[1]}.fmu",
             "start": {"first": 20, "greeting": "after"}},
        ],
        "scheme": {"type": scheme},
        **options,
    }  # fmt: skip


@pytest.mark.parametrize("versions", [(2, 3), (3, 2)])
@pytest.mark.parametrize("scheme, lead", [("jacobi", 0), ("gauss-seidel", 1)])
def test_jumps_arrive_as_the_order_says(units, tmp_path, scheme, lead, versions):
    """Two gets what one had at the begin of the window, or has just found; one never the latter."""
    run_system(system_from(system(scheme, versions), None, directory=units), tmp_path / "out")
    record = {
        name: xr.load_dataset(tmp_path / "out" / "cosimulation.nc", group=name)
        for name in ("one", "two")
    }
    steps = np.arange(1, 5)
    assert record["one"]["count"].values.tolist() == [10, 11, 12, 13, 14]
    assert record["two"]["seen_count"].values[1:].tolist() == (9 + lead + steps).tolist()
    assert record["one"]["seen_count"].values[1:].tolist() == (19 + steps).tolist()
    assert record["two"]["seen_word"].values[-1] == f"step {3 + lead}"
    assert record["one"]["seen_word"].values[-1] == "after 3"
    assert record["one"]["seen_on"].values[1:].tolist() == [0, 1, 0, 1]
    assert record["one"]["seen_on"].attrs["flag_meanings"] == "false true"


def test_units_of_a_system_that_comes_through_a_pipe_lie_in_the_current_folder(
    tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    pipe = tmp_path / "elsewhere" / "pipe"
    pipe.parent.mkdir()
    os.mkfifo(pipe)
    assert system_from(system("jacobi"), pipe).directory == tmp_path
    file = pipe.with_name("system.toml")
    assert system_from(system("jacobi"), file).directory == file.parent


def test_windows_that_are_repeated_do_not_count_twice(assembled, units):
    """Jumps beside an iterated connection: every unit is set back with its counter."""
    data = system("iqn-ils")
    data["connections"] = [*LINKS, "a.y -> b.x_in", "b.y -> a.x_in"]
    data["units"] += [
        {"name": "a", "fmu": "Follower_2.fmu", "start": {"gain": -2.0, "shift": 1.0}},
        {"name": "b", "fmu": "Follower_3.fmu"},
    ]
    assembly = assembled(data)
    assembly.coupled.advance_to(4.0, lambda _: assembly.lines.refresh())
    one, two = (assembly.parts[name].get_fields(["count", "seen_count"]) for name in ("one", "two"))
    assert assembly.parts["one"].spent.step_count > 6
    assert one["count"] == 14 and two["count"] == 24
    assert two["seen_count"] == 14 and one["seen_count"] == 23
    assert assembly.coupled.get_fields(["a.y"])["a.y"][0] == pytest.approx(1.0 / 3.0, rel=1e-6)


@pytest.mark.parametrize(
    "link, reason",
    [
        ("one.word -> two.count_in", "only a text goes to a text"),
        ("one.count -> two.on_in", "a number is no switch"),
        ("ball.height -> two.count_in", "could be changed on the way"),
        ("one.word -> ball.push", "only a text goes to a text"),
    ],
)
def test_types_that_would_change_values_are_refused(assembled, link, reason):
    data = system("jacobi", connections=[link])
    data["units"].append({"name": "ball", "fmu": "Ball_3.fmu"})
    with pytest.raises(InputError, match=reason) as caught:
        assembled(data)
    assert link in str(caught.value)


def test_whole_numbers_and_switches_go_to_reals(assembled):
    data = system("gauss-seidel", connections=["one.count -> ball.push", "one.on -> foot.x_in"])
    data["units"] += [
        {"name": "ball", "fmu": "Ball_3.fmu"},
        {"name": "foot", "fmu": "Follower_2.fmu"},
    ]
    assembly = assembled(data)
    assembly.coupled.advance_to(1.0)
    assert assembly.parts["ball"].get_fields(["push"])["push"] == 11.0
    assert assembly.parts["foot"].get_fields(["y"])["y"] == 1.0


def test_a_switch_or_whole_number_that_becomes_a_quantity_is_told(assembled):
    links = ["one.count -> cart.force", "two.on -> tail.position1"]
    data = system("gauss-seidel", connections=links)
    data["units"] += [{"name": "cart", "fmu": "Mass_2.fmu"}, {"name": "tail", "fmu": "Tail_3.fmu"}]
    assert assembled(data).remarks == [
        'connection "one.count -> cart.force": "count" is a whole number, and is taken to be in N',
        'connection "two.on -> tail.position1": "on" is a switch, so 0 or 1, and is taken to be in '
        "mm",
    ]


@pytest.mark.parametrize(
    "start, reason",
    [
        ({"first": 1.5}, "must be a whole number"),
        ({"first": 2**40}, "beyond the range of Integer"),
        ({"on_in": 1}, "must be true or false"),
        ({"greeting": 3}, "must be a text"),
        ({"frist": 3}, 'did you mean "first"'),
        ({"count": 3}, "it has no start value"),
    ],
)
def test_start_values_of_a_wrong_type_are_refused(assembled, start, reason):
    data = system("jacobi", (2, 2))
    data["units"][0]["start"] = start
    with pytest.raises(InputError, match=reason) as caught:
        assembled(data)
    assert f"units.one.start.{next(iter(start))}" in str(caught.value)


@pytest.fixture(scope="module")
def jumpers(units):
    """The folder of the units with Jumper_2.fmu: a follower whose reals are declared discrete."""
    variables = [
        replace(v, variability="discrete") if v.causality != "parameter" else v
        for v in FOLLOWER.variables
    ]
    build(replace(FOLLOWER, name="Jumper", variables=variables), 2, units)
    return units


def jumping(scheme, **connection):
    return {
        "stop_time": "1 s", "window": "100 ms", "scheme": {"type": scheme},
        "units": [
            {"name": "a", "fmu": "Jumper_2.fmu", "start": {"gain": -2.0, "shift": 1.0}},
            {"name": "b", "fmu": "Jumper_2.fmu"},
        ],
        "connections": [{"link": "a.y -> b.x_in", **connection},
                        {"link": "b.y -> a.x_in", **connection}],
    }  # fmt: skip


def test_a_loop_of_discrete_reals_is_named_with_what_to_do(jumpers, assembled):
    with pytest.raises(InputError) as caught:
        assembled(jumping("iqn-ils"))
    message = str(caught.value)
    entry = '{ link = "a.y -> b.x_in", continuous = true }'
    for part in ("declare discrete", entry, "a.y -> b.x_in, b.y -> a.x_in"):
        assert part in message, message
    assert assembled(jumping("gauss-seidel")).remarks == []
    with pytest.raises(InputError, match="whole numbers, switches or texts"):
        assembled(system("iqn-ils"))
    # beside a loop that is iterated it is a warning
    beside = jumping("iqn-ils")
    beside["units"] += [{"name": n, "fmu": "Follower_2.fmu", "start": {"gain": 0.5}} for n in "cd"]
    beside["connections"] += ["c.y -> d.x_in", "d.y -> c.x_in"]
    (remark,) = assembled(beside).remarks
    assert "continuous = true" in remark and "c.y" not in remark


def test_discrete_reals_are_iterated_where_the_file_says_so(jumpers, assembled):
    """The fixed point of y = 1 - 2 y, which handing over diverges from."""
    assembly = assembled(jumping("iqn-ils", continuous=True))
    assembly.coupled.advance_to(1.0)
    assert assembly.coupled.get_fields(["a.y"])["a.y"][0] == pytest.approx(1.0 / 3.0, rel=1e-6)
    data = system("jacobi", connections=[{"link": "one.count -> two.count_in", "continuous": True}])
    with pytest.raises(InputError, match="continuous is for reals; count is Integer"):
        assembled(data)
