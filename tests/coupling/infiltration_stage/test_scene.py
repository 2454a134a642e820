"""The tables of an infiltration: what they take, and what they say of wrong entries."""

import re
from pathlib import Path

import pytest

from lcmchain.errors import InputError
from lcmchain.manual.contents import read_page
from lcmchain.scene import (
    infiltration_from_text,
    read_infiltration,
    read_scene,
    scene_from_text,
)

from .conftest import GATE, HEAD, VENT

EXAMPLE = Path(__file__).parents[3] / "examples" / "infiltration"

SCENE = """
[process]
time = "10 ms"
[blank]
size = ["20 mm", "20 mm"]
edge_length = "5 mm"
[material]
preset = "MD600"
[permeability]
law = "gebart"
fibre_radius = "3.5 um"
"""


def case(*texts):
    return infiltration_from_text("\n".join(texts))


def test_values_are_si_and_defaults_are_told():
    found = case(HEAD, GATE.replace('"1 bar"', '"1 2 bar"') + 'times = "0 20 s"', VENT)
    (gate,), (vent,) = found.gates, found.vents
    assert gate.pressure == (1e5, 2e5) and gate.times == (0.0, 20.0)
    assert gate.box == ((0.0, -1e-3, -1e-3), (0.0, 0.061, 1e-3))
    assert vent.pressure is None and found.vent_pressure == 0.0 and not vent.bleeds
    assert found.resin.viscosity == 0.1
    assert gate.in_words == "1 to 2 bar at box from (0, -1, -1) mm to (0, 61, 1) mm"


def test_a_flow_rate_with_its_times_of_opening():
    text = GATE.replace('pressure = "1 bar"', 'flow_rate = "2 ml/s"\npressure_limit = "4 bar"')
    found = case(HEAD, text + 'opens = "5 s"\ncloses_on_arrival = { rim = true }\n', VENT)
    (gate,) = found.gates
    assert gate.flow_rate == (2e-6,) and gate.pressure_limit == 4e5
    assert gate.in_words.endswith("mm, from 5 s, until the front is at rim")
    assert gate.in_words.startswith("2 ml/s at ")


WRONG = {
    "no vent": ((HEAD, GATE), "vents: is missing: the air has nowhere to go"),
    "no gate": ((HEAD, VENT), "gates: is missing: no resin enters"),
    "pressure below the vents": (
        (HEAD + 'vent_pressure = "1 bar"', GATE, VENT),
        'gates[0] "left".pressure: is 100000 Pa at most, not above that of the vents',
    ),
    "limit below the vents": (
        (
            HEAD + 'vent_pressure = "1 bar"',
            GATE.replace("pressure =", "pressure_limit =") + 'flow_rate = "1 ml/s"',
            VENT,
        ),
        'gates[0] "left".pressure_limit: is 100000 Pa at most, not above that of the vents',
    ),  # fmt: skip
    "two places": ((HEAD, GATE + "rim = true", VENT), "but has box and rim"),
    "no place": ((HEAD, GATE.replace("box", "#box"), VENT), "but has none"),
    "both kinds": ((HEAD, GATE + 'flow_rate = "1 ml/s"', VENT), "but has pressure and flow_rate"),
    "negative rate": (
        (HEAD, GATE.replace('pressure = "1 bar"', 'flow_rate = "-1 ml/s"'), VENT),
        "must not be negative, and above zero",
    ),
    "values without times": (
        (HEAD, GATE.replace('"1 bar"', '"1 2 bar"'), VENT),
        "needs one value, but has 2",
    ),
    "falling times": (
        (HEAD, GATE.replace('"1 bar"', '"1 2 bar"') + 'times = "5 2 s"', VENT),
        "must increase from one to the next",
    ),
    "closed before open": (
        (HEAD, GATE + 'opens = "5 s"\ncloses = "2 s"', VENT),
        "is 2 s, but it opens at 5 s only",
    ),
    "radius without point": ((HEAD, GATE + 'radius = "2 mm"', VENT), "belongs to point"),
    "one name twice": ((HEAD, GATE, VENT.replace("right", "left")), 'the name "left" of a gate'),
    "region that changes nothing": (
        (HEAD, GATE, VENT, '[[regions]]\nname = "core"\nset = "CORE"'),
        "changes nothing",
    ),
    "fibres without pores": (
        (HEAD, GATE, VENT, '[[regions]]\nname = "core"\nset = "C"\nfibre_volume_fraction = 1.0'),
        "must be above 0 and below 1",
    ),
    "zero permeability": (
        (HEAD, GATE, VENT, '[[regions]]\nname = "core"\nset = "C"\npermeability_factor = 0.0'),
        "must be positive",
    ),
    "race track at a point": (
        (HEAD, GATE, VENT, '[[race_tracks]]\nname = "gap"\npoint = "0 0 0 mm"\nwidth = "1 mm"'),
        "runs along edges",
    ),
    "trapped air in gauge pressures": ((HEAD + "trapped_air = true", GATE, VENT), "absolute"),
    "stages without forming": (
        (HEAD, GATE + 'stages = ["draw"]', VENT),
        'gates[0] "left".stages: names "draw", but no resin flows in stages of the process',
    ),
    "misspelt key": ((HEAD, GATE + 'radios = "2 mm"', VENT), 'did you mean "radius"'),
}


@pytest.mark.parametrize("name", WRONG)
def test_wrong_entries_are_named(name):
    texts, message = WRONG[name]
    with pytest.raises(InputError) as caught:
        case(*texts)
    assert message in str(caught.value)


def test_the_example_for_a_missing_resin_is_one_that_flows():
    """The structural analysis has a [resin] of its own, of which the flow knows nothing."""
    head = 'time = "500 s"\n'
    with pytest.raises(InputError) as caught:
        case(head, GATE, VENT)
    example = re.search(r"resin: is missing; for example (.*)", str(caught.value))[1]
    assert case(head, example, GATE, VENT).resin.viscosity == 0.1


def nested(place):
    """The case as it stands in a scene."""
    text = (HEAD + GATE + VENT).replace("[[", f"[[{place}.")
    return text.replace(HEAD, f"[{place}]{HEAD}")


def test_a_scene_names_its_infiltrations(tmp_path):
    (tmp_path / "part.vtu").write_text("x")
    mapping = '[[mapping]]\nname = "part"\nmesh = "part.vtu"\nkind = "infiltration"\n'
    text = SCENE + nested("infiltration") + mapping + nested("mapping.infiltration")
    scene = scene_from_text(text, tmp_path / "scene.toml")
    assert list(scene.infiltrations) == ["sheet", "part"]
    assert scene.infiltrations["sheet"][1] is None
    assert scene.infiltrations["part"][1] is scene.mapping[0]
    keys = dict(scene.source.given)
    assert keys["infiltration.gates.left.pressure"] == "1 bar"
    assert keys["mapping.part.infiltration.vents.right.box"].startswith("[")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            ('[permeability]\nlaw = "gebart"\nfibre_radius = "3.5 um"', ""),
            "permeability: is missing",
        ),
        (("[permeability]", 'element = "membrane-shell"\n[x]'), "unknown key"),
    ],
)
def test_a_scene_without_what_the_flow_needs(change, message):
    with pytest.raises(InputError, match=message):
        scene_from_text(SCENE.replace(*change) + nested("infiltration"))


def test_a_structural_mesh_takes_no_infiltration(tmp_path):
    (tmp_path / "part.vtu").write_text("x")
    mapping = '[[mapping]]\nname = "part"\nmesh = "part.vtu"\nkind = "structure"\n'
    with pytest.raises(InputError, match='needs kind = "infiltration", but kind is "structure"'):
        scene_from_text(SCENE + mapping + nested("mapping.infiltration"), tmp_path / "scene.toml")


def test_the_case_of_the_manual_and_those_of_the_example_are_read():
    block, *_ = re.findall(r"```toml\n(.*?)```", read_page("infiltration").text, flags=re.DOTALL)
    assert infiltration_from_text(block).gates[0].radius == 0.01
    if EXAMPLE.is_dir():
        assert read_infiltration(EXAMPLE / "pole.toml").gates[0].pressure == (3e5,)
        assert read_infiltration(EXAMPLE / "bag.toml").closure.type == "bag"
        assert read_infiltration(EXAMPLE / "wet_moulding.toml").closure.type == "gap"
        assert list(read_scene(EXAMPLE / "scene.toml").infiltrations) == ["sheet", "from_rim"]
