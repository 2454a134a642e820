"""Inputs of a sensitivity: what counts as a number, and what lies at a bound."""

import math

import pytest

from lcmchain.errors import InputError
from lcmchain.study import sensitivity as sensitivity_module
from lcmchain.study.results import RESULTS
from lcmchain.study.sensitivity import (
    _dependence,
    _scaled,
    _value_of,
    allowed_changes,
    default_inputs,
    run_sensitivity,
)

#: A sheet whose name begins with a number and whose Poisson's ratio nearly is at its bound.
RUBBER = """
[material]
law = "isotropic"
name = "600 shore"
thickness = "1 mm"
density = "1200 kg/m^3"
young_modulus = "5 MPa"
poisson_ratio = 0.47
"""


@pytest.fixture
def rubber(dent):
    text = dent.text.replace('material = { preset = "MD600" }\n', "") + RUBBER
    return type(dent)(text, dent.path)


def test_tools_that_take_the_friction_of_the_scene_are_no_inputs_of_their_own(dent):
    inputs = default_inputs(dent.scene())
    assert inputs["contact.friction"] == "0.157"
    assert not [key for key in inputs if key.startswith("tools.")]
    own = type(dent)(dent.text, dent.path, ("tools.die.friction=0.3",))
    inputs = default_inputs(own.scene())
    assert inputs["tools.die.friction"] == "0.3"
    assert "tools.punch.friction" not in inputs
    # asked for by name it is a number all the same
    assert _value_of(own.scene(), "tools.punch.friction") == "0.157"


def test_every_default_input_can_be_changed(dent):
    changed, refused = allowed_changes(dent, default_inputs(dent.scene()), 0.1)
    assert refused == []
    assert all(set(sides) == {"lower", "higher"} for sides in changed.values())


def test_names_that_begin_with_a_number_are_no_inputs(rubber):
    inputs = default_inputs(rubber.scene())
    assert inputs["material.poisson_ratio"] == "0.47"
    assert "material.name" not in inputs
    with pytest.raises(InputError, match="no number"):
        _value_of(rubber.scene(), "material.name")


@pytest.mark.parametrize(
    ("value", "twice"),
    [
        ("200 1/s", '"400 1/s"'),
        ("5 1/ms", '"10 1/ms"'),
        ("0.1 -0.2 MPa", '"0.2 -0.4 MPa"'),
        ("600 g/m^2", '"1200 g/m^2"'),
        ("0.157", "0.314"),
        ("solid-shell", None),
    ],
)
def test_numbers_rows_and_units_that_begin_with_one_are_scaled(value, twice):
    assert _scaled(value, 2.0) == twice


def test_a_rate_keeps_its_unit(dent):
    changed, refused = allowed_changes(dent, {"process.mass_damping": "200 1/s"}, 0.1)
    assert refused == []
    higher = changed["process.mass_damping"]["higher"]
    assert dent.scene(higher.overrides).process.mass_damping == pytest.approx(220.0)


def test_an_input_at_a_bound_is_changed_to_the_other_side_alone(rubber):
    values = {"material.poisson_ratio": "0.47", "process.frames": "21"}
    changed, refused = allowed_changes(rubber, values, 0.1)
    assert list(changed["material.poisson_ratio"]) == ["lower"]
    assert changed["process.frames"] == {}  # the study sets it
    assert "one side alone, not higher" in refused[0]
    assert "left out" in refused[1]


def test_one_side_alone_gives_the_elasticity_as_far_as_it_goes(rubber, tmp_path, monkeypatch):
    one, two = (
        _dependence("x", "r", 0.1, 2.0, 1.8, math.nan),
        _dependence("x", "r", 0.1, 2, 1.8, 2.2),
    )
    assert one.elasticity == pytest.approx(two.elasticity) == pytest.approx(1.0)
    assert math.isnan(one.bend)
    assert math.isnan(_dependence("x", "r", 0.1, 2.0, math.nan, math.nan).elasticity)

    class Known(sensitivity_module.Study):
        def outcomes(self, variants, progress=None):
            return {v.name: Made(0.9 if v.name.endswith("lower") else 1.0) for v in variants}

    class Made(float):
        failure = ""

    monkeypatch.setattr(sensitivity_module, "Study", Known)
    monkeypatch.setattr(
        sensitivity_module, "results_of", lambda made: {r.name: float(made) for r in RESULTS}
    )
    found = run_sensitivity(rubber, tmp_path, ["material.poisson_ratio"])
    assert [d.elasticity for d in found.dependences] == pytest.approx([1.0] * len(RESULTS))
    assert "poisson_ratio" in found.failures[0]
    with pytest.raises(InputError, match=r"no input can be changed.*the study sets it"):
        run_sensitivity(rubber, tmp_path, ["process.frames"])
