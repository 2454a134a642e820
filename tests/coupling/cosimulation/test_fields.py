"""Whole fields between units: in one call, judged and accelerated as a whole."""

import numpy as np
import pytest
from models import N

from lcmchain.errors import InputError


def pair(scheme, versions=(2, 3), **options):
    units = [
        {"name": name, "fmu": f"Field_{version}.fmu", "start": {"a": a, "b": 0.3, "c": c}}
        for name, version, a, c in (("one", versions[0], 0.9, 1.0), ("two", versions[1], -2.0, 0.5))
    ]
    return {
        "stop_time": "1 s", "window": "0.25 s", "units": units,
        "connections": ["one.y -> two.x_in", "two.y -> one.x_in"],
        "scheme": {"type": scheme, "relative": 1e-12, **options},
    }  # fmt: skip


def solution():
    """The fixed point of y = A x + c of both units."""
    shift = np.eye(N, k=-1)
    one, two = 0.9 * np.eye(N) + 0.3 * shift, -2.0 * np.eye(N) + 0.3 * shift
    count = np.arange(1.0, N + 1)
    return np.linalg.solve(np.eye(N) - one @ two, one @ (0.5 * count) + 1.0 * count)


@pytest.mark.parametrize("versions", [(2, 2), (3, 3), (2, 3)])
@pytest.mark.parametrize("scheme, iterations", [("iqn-ils", 40), ("aitken", 200)])
def test_fields_are_iterated_to_their_common_solution(assembled, scheme, iterations, versions):
    """The plain fixed point would diverge: the gain is 1.8."""
    assembly = assembled(pair(scheme, versions, most_iterations=iterations))
    assembly.coupled.advance_to(1.0)
    y = assembly.coupled.get_fields(["one.y"])["one.y"]
    expected = solution()
    assert np.abs(y - expected).max() < 1e-9 * np.abs(expected).max()


def test_a_field_goes_in_one_call(assembled):
    calls = []
    assembly = assembled(pair("jacobi"))
    for part in assembly.parts.values():
        unit = part.instance._unit
        for name in ("fmi2GetReal", "fmi2SetReal", "fmi3GetFloat64", "fmi3SetFloat64"):
            function = getattr(unit, name, None)
            if function is not None:
                setattr(unit, name, _counted(calls, name, function))
    assembly.coupled.advance_to(0.25)
    assert sorted(set(calls)) == ["fmi2GetReal", "fmi2SetReal", "fmi3GetFloat64", "fmi3SetFloat64"]
    assert len(calls) <= 6, calls  # two present, two inputs, two answers


def _counted(calls, name, function):
    def call(*arguments):
        calls.append(name)
        return function(*arguments)

    return call


def test_saved_states_are_given_back_and_hold_everything(assembled):
    assembly = assembled(pair("iqn-ils"))
    part = assembly.parts["one"]
    part.set_fields({"x_in": np.arange(N, dtype=float)})
    saved = part.save()
    part.advance(0.25)
    first = part.get_fields(["y", "sum"])
    for _ in range(3):
        part.restore(saved)
        assert part.time == 0.0
        part.advance(0.25)
        again = part.get_fields(["y", "sum"])
        assert all(np.array_equal(first[name], again[name]) for name in first)
    released = []
    release = part.instance.release
    part.instance.release = lambda handle: (released.append(handle), release(handle))
    del saved
    assert len(released) == 1


@pytest.mark.parametrize(
    "link, reason",
    [
        ("one.sum -> two.x_in", r"one\.sum has 1 values, two\.x_in takes 40"),
        ("one.y -> two.y", r'"y" is no input but output'),
        ("one.y -> two.a", r'"a" is no input but parameter; give it a start value'),
        ("one.x_in -> two.x_in", r'"x_in" is no output but input'),
        ("one.z -> two.x_in", r'Field has no variable "z"'),
    ],
)
def test_ends_that_do_not_fit_are_named(assembled, link, reason):
    data = pair("jacobi") | {"connections": [link]}
    with pytest.raises(InputError, match=reason) as caught:
        assembled(data)
    assert link in str(caught.value)


def test_one_value_of_a_field_of_fmi_2_can_be_connected(assembled):
    data = pair("gauss-seidel", (2, 2)) | {"connections": ["one.y[3] -> two.x_in[5]"]}
    assembly = assembled(data)
    assembly.coupled.advance_to(0.25)
    y = assembly.coupled.get_fields(["one.y", "two.y"])
    assert y["two.y"][4] == -2.0 * y["one.y"][2] + 0.5 * 5
    twice = data | {"connections": ["one.y[3] -> two.x_in[5]", "one.y -> two.x_in"]}
    with pytest.raises(InputError, match="set the same input"):
        assembled(twice)


def test_start_values_of_fields(assembled):
    data = pair("jacobi") | {"connections": []}
    data["units"][0]["start"]["x_in"] = [f"{i} kPa" for i in range(N)]
    data["units"][1]["start"]["x_in"] = "2 bar"
    assembly = assembled(data)
    parts = assembly.parts
    assert np.array_equal(parts["one"].get_fields(["x_in"])["x_in"], 1e3 * np.arange(N))
    assert np.array_equal(parts["two"].get_fields(["x_in"])["x_in"], np.full(N, 2e5))
    data["units"][0]["start"]["x_in"] = ["1 Pa", "2 Pa"]
    with pytest.raises(InputError, match=r"units\.one\.start\.x_in: has 2 values, .* has 40"):
        assembled(data)
