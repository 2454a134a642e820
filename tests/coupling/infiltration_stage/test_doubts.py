"""What is refused, and what is computed with a doubt: each message names the place."""

import numpy as np
import pytest

from lcmchain.coupling.infiltration.formed_part import read_formed_part
from lcmchain.coupling.infiltration.setup import set_up
from lcmchain.coupling.infiltration.stage import FillOptions, fill, fill_part
from lcmchain.errors import InputError
from lcmchain.scene import scene_from_text

from .conftest import GATE, HEAD, VENT, strip, write_forming

ALL = 'box = ["-1 -1 -1 mm", "301 61 1 mm"]'
REGION = '[[regions]]\nname = "{0}"\nbox = ["{1} -1 -1 mm", "{2} 61 1 mm"]\n{3}\n'
PLAIN = FillOptions(picture=False, vtu=False)

DOUBTS = {
    "a vent that opens too late": (
        (VENT + 'opens = "600 s"\n', GATE),
        'the vent "right" opens at 600 s, but the filling ends at 500 s',
    ),
    "a gate that opens too late": (
        (GATE + 'opens = "500 s"\n', VENT), 'the gate "left" opens at 500 s',
    ),
    "a gate whose pressure rises too late": (
        (GATE.replace('"1 bar"', '"0 1 bar"\ntimes = "500 600 s"'), VENT),
        'the pressure of the gate "left" rises after 500 s only',
    ),
    "regions that overlap": (
        (GATE, VENT, REGION.format("a", -1, 151, 'thickness = "1 mm"'),
         REGION.format("b", 99, 301, "permeability_factor = 2.0")),
        'the regions "a" and "b" share 6 cells (the first is cell 13 at (112.5, 10.0, 0.0) mm)',
    ),
    "a region whose permeability stays": (
        (GATE, VENT, REGION.format("a", -1, 151, "fibre_volume_fraction = 0.6")),
        'the region "a" changes the fibre volume fraction, but not the permeability',
    ),
    "a race track in another unit": (
        (GATE, VENT, f'[[race_tracks]]\nname = "gap"\n{ALL}\nwidth = "1 m"\n'),
        'the race track "gap" is 1e+03 mm wide',
    ),
    "a gate nearly everywhere": (
        (GATE.replace('"0 61 1 mm"', '"276 61 1 mm"'), VENT), 'the gate "left" is 92% of all nodes',
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", DOUBTS)
def test_what_is_perhaps_not_meant_is_said(kit, name):
    texts, message = DOUBTS[name]
    (warning,) = set_up(read_formed_part(kit.forming()), kit.case(HEAD, *texts)).warnings
    assert message in warning


def test_the_advice_for_a_denser_region_is_an_entry_that_is_taken(kit):
    """The law stands beside the regions, as the advice says; in a region it is refused."""
    region = REGION.format("a", -1, 151, "fibre_volume_fraction = 0.6")
    law = 'permeability = { law = "gebart", fibre_radius = "3.5 um" }\n'
    part = read_formed_part(kit.forming())
    (warning,) = set_up(part, kit.case(HEAD, GATE, VENT, region)).warnings
    assert '"permeability" stands beside "regions", not in a region' in warning
    assert set_up(part, kit.case(HEAD + law, GATE, VENT, region)).warnings == ()
    with pytest.raises(InputError, match=r"regions.*permeability: unknown key"):
        kit.case(HEAD, GATE, VENT, region + law)


def test_sound_cases_are_not_doubted(kit):
    region = REGION.format("a", -1, 99, "permeability_factor = 2.0\nfibre_volume_fraction = 0.6")
    beside = REGION.format("b", 101, 301, 'thickness = "1 mm"')
    track = f'[[race_tracks]]\nname = "gap"\n{ALL}\nwidth = "2 mm"\n'
    case = kit.case(HEAD, GATE + 'opens = "499 s"\n', VENT, region, beside, track)
    assert set_up(read_formed_part(kit.forming()), case).warnings == ()


def test_a_part_in_millimetres_is_doubted(kit, tmp_path):
    points, quads = strip()
    source = write_forming(tmp_path / "mm.nc", 1e3 * points, quads)
    gate = GATE.replace('box = ["0 -1 -1 mm", "0 61 1 mm"]', 'box = ["0 -1 -1 m", "0 61 1 m"]')
    vent = VENT.replace("mm", "m")
    (warning,) = set_up(read_formed_part(source), kit.case(HEAD, gate, vent)).warnings
    assert "the part is 300 m long" in warning and "--length-unit" in warning
    with pytest.raises(InputError) as caught:
        set_up(read_formed_part(source), kit.case())
    assert "(the part spans (0.0, 0.0, 0.0) mm to (300000.0, 60000.0, 0.0) mm)" in str(caught.value)


def test_cells_without_fibres_are_named(kit):
    fraction = np.full(36, 0.5)
    fraction[5] = 0.0
    with pytest.raises(InputError, match="zero or less, so no textile") as caught:
        set_up(read_formed_part(kit.forming(fibre_volume_fraction=fraction)), kit.case())
    assert "forming.nc" in str(caught.value)
    assert "cell 6 at (37.5, 50.0, 0.0) mm" in str(caught.value)


def test_a_cell_that_names_a_node_twice_is_refused_with_the_file(kit, tmp_path):
    points, quads = strip()
    quads[4, 2] = quads[4, 1]
    source = write_forming(tmp_path / "twice.nc", points, quads)
    with pytest.raises(InputError, match=r"twice\.nc: 1 cells name a node twice \(row 4\); write"):
        set_up(read_formed_part(source), kit.case())


def test_a_film_under_less_than_the_air_is_refused(kit):
    film = 'film = { thickness = "1 mm", pressure = "-0.1 bar" }\n'
    with pytest.raises(InputError, match=r"film\.pressure: is -10000 Pa at most"):
        kit.case(HEAD + film, VENT)
    drawn = film.replace("}", ', capillary_pressure = "0.2 bar" }')
    assert kit.case(HEAD + drawn, VENT).film.capillary_pressure == pytest.approx(2e4)


def test_a_film_that_is_used_up_is_no_closed_gate(kit, tmp_path):
    film = 'film = { thickness = "0.1 mm", pressure = "1 bar" }\n'
    report = fill_part(
        kit.forming(), kit.case(HEAD + film, VENT), name="a", out_dir=tmp_path, options=PLAIN
    )
    assert report.outcome == "no_source" and report.filled_share == pytest.approx(0.1)
    assert "there is no gate, the film gives no more after" in report.message


def test_a_saved_state_that_is_not_there_is_refused(kit):
    source = kit.forming()
    assert read_formed_part(source, frame=0).target.cell_count == 36
    with pytest.raises(InputError, match="frame 7 does not exist; there is one state"):
        read_formed_part(source, frame=7)


def test_a_mapped_file_has_no_frames_to_choose_from(kit, tmp_path):
    from lcmchain.coupling.infiltration.stage import map_and_fill

    points, quads = strip(10, 2)
    mesh = tmp_path / "part.vtk"
    import meshio

    meshio.write(mesh, meshio.Mesh(points, [("quad", quads)]))
    chosen = FillOptions(picture=False, vtu=False, frame=0)
    mapped, report = map_and_fill(
        kit.forming(), mesh, kit.case(), name="part", out_dir=tmp_path, options=chosen
    )
    assert mapped is not None and report.outcome == "filled"
    with pytest.raises(InputError, match=r"--frame: is 0, but part\.nc holds one state"):
        read_formed_part(tmp_path / "part.nc", frame=0)


SCENE = """
process = { time = "1 ms" }
blank = { size = ["30 mm", "20 mm"], edge_length = "5 mm" }
material = { preset = "MD600" }
[infiltration]
time = "1 h"
resin = { law = "constant", viscosity = "0.1 Pa*s" }
permeability = { law = "table", file = "k.csv" }
gates = [{ name = "g", PLACE, pressure = "1 bar" }]
vents = [{ name = "v", rim = true }]
[[mapping]]
name = "part"
kind = "infiltration"
mesh = "part.vtk"
[mapping.infiltration]
time = "1 h"
resin = { law = "constant", viscosity = "0.1 Pa*s" }
permeability = { law = "table", file = "sub/other.csv" }
gates = [{ name = "g", set = "GATE", pressure = "1 bar" }]
vents = [{ name = "v", rim = true }]
"""


def test_every_file_that_a_scene_names_is_listed_and_missed(tmp_path):
    text = SCENE.replace("PLACE", 'point = "0 0 0 mm"')
    with pytest.raises(InputError) as caught:
        scene_from_text(text, tmp_path / "scene.toml")
    for key, name in (
        ("infiltration.permeability.file", "k.csv"),
        ('mapping[0] "part".mesh', "part.vtk"),
        ('mapping[0] "part".infiltration.permeability.file', "sub/other.csv"),
    ):
        assert f'{key}: there is no file "{name}"' in str(caught.value)
    (tmp_path / "sub").mkdir()
    for name in ("k.csv", "part.vtk", "sub/other.csv"):
        (tmp_path / name).write_text("something\n")
    scene = scene_from_text(text, tmp_path / "scene.toml")
    assert sorted(scene.source.files) == [
        ("infiltration.permeability.file", "k.csv"),
        ("mapping[0].infiltration.permeability.file", "sub/other.csv"),
        ("mapping[0].mesh", "part.vtk"),
    ]


def test_a_set_on_the_formed_sheet_is_refused_before_it_is_formed(tmp_path):
    for place in ('set = "IN"', 'rim = true, opens_on_arrival = { set = "IN" }'):
        with pytest.raises(InputError, match='names the set "IN", but the formed sheet has no'):
            scene_from_text(SCENE.replace("PLACE", place), tmp_path / "scene.toml")


def test_a_place_may_be_a_gate_first_and_a_vent_later(kit):
    """One after the other by the clock; the other way round, or at once, it is refused."""
    there = 'box = ["0 -1 -1 mm", "0 61 1 mm"]\n'
    later = f'[[vents]]\nname = "later"\n{there}opens = "60 s"\nbleeds = true\n'
    first = GATE + 'closes = "60 s"\n'
    second = GATE.replace("left", "right").replace('"0 -1', '"300 -1').replace('"0 61', '"300 61')
    second += 'opens = "60 s"\n'
    middle = '[[vents]]\nname = "middle"\nbox = ["150 -1 -1 mm", "150 61 1 mm"]\n'
    filled = fill(read_formed_part(kit.forming()), kit.case(HEAD, first, second, later, middle))
    assert filled.outcome == "filled" and filled.history.vented[-1, 0] > 0.0
    assert filled.message == "all pores are full, and 500 s are reached"
    injected = filled.history.injected[-1]
    assert injected.min() > 0.0 and np.abs(filled.history.balance_error).max() < 1e-15
    with pytest.raises(InputError, match="let one close before the other opens"):
        early = later.replace("60 s", "59 s")
        set_up(read_formed_part(kit.forming()), kit.case(HEAD, first, second, early, middle))
