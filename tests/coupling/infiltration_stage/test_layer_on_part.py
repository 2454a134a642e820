"""A flow medium in a case: places, files, pictures, report, what is refused, and going on."""

import json

import meshio
import numpy as np
import pytest
import xarray as xr

from lcmchain.coupling.filling_part import FillingPart
from lcmchain.coupling.infiltration.formed_part import read_formed_part, unformed_part
from lcmchain.coupling.infiltration.setup import set_up
from lcmchain.coupling.infiltration.stage import FillingRun, FillOptions, fill, map_and_fill
from lcmchain.errors import InputError
from lcmchain.fmu.infiltration.build import build_infiltration_fmu
from lcmchain.report.chapters import filling_in_words
from lcmchain.scene.reading.single_tables import infiltration_from_text

from .conftest import GATE, HEAD, VENT, strip

PREFORM = """
[preform]
thickness = "4 mm"
fibre_volume_fraction = 0.5
permeability = { k1 = "1e-11 m^2", k3 = "1e-12 m^2" }
"""
LAYER = """
[flow_medium]
thickness = "1 mm"
porosity = 0.8
permeability = { k1 = "3e-9 m^2" }
"""
#: The layer ends before the vent, as it does in practice.
OVER = 'over = { box = ["-1 -1 -1 mm", "250 61 1 mm"] }\n'


@pytest.fixture(scope="module")
def mesh_file(tmp_path_factory):
    path = tmp_path_factory.mktemp("mesh") / "strip.vtu"
    points, quads = strip()
    meshio.write(path, meshio.Mesh(points, [("quad", quads)]))
    return path


def case_of(*texts):
    return infiltration_from_text("\n".join(texts))


def unformed(mesh_file, *texts):
    case = case_of(HEAD, PREFORM, *texts)
    return unformed_part(mesh_file, case.preform), case


@pytest.fixture(scope="module")
def result(mesh_file, tmp_path_factory):
    out = tmp_path_factory.mktemp("filled")
    case = case_of(HEAD, PREFORM, LAYER + OVER, GATE, VENT)
    map_and_fill(mesh_file, None, case, name="part", out_dir=out, options=FillOptions(vtu=True))
    with xr.open_dataset(out / "part_filling.nc", decode_times=False) as opened:
        return out, opened.load(), json.loads((out / "part_filling.json").read_text())


def test_front_runs_ahead_in_the_layer_and_both_are_in_the_file(result):
    _, fields, _ = result
    x = fields["target_node_x"].values
    above, below = fields["flow_medium_fill_time"].values, fields["fill_time"].values
    covered = x < 0.2501
    assert np.isfinite(above[covered]).all() and np.isnan(above[~covered]).all()
    assert np.isfinite(below).all()
    inside = covered & (x > 0.0)
    assert (above[inside] < below[inside]).all()
    pressure = fields["flow_medium_pressure"].values[-2]
    assert np.isnan(pressure[~covered]).all() and (pressure[covered] >= 0.0).all()


def test_resin_of_part_and_layer_is_what_has_entered(result):
    _, fields, report = result
    mass = fields["resin_mass"].values[-1].sum(), np.nansum(fields["flow_medium_resin_mass"][-1])
    volume = 0.3 * 0.06 * 0.004 * 0.5, 0.25 * 0.06 * 0.001 * 0.8
    assert report["outcome"] == "filled" and report["filled_share"] == pytest.approx(1.0)
    np.testing.assert_allclose(mass, 1100.0 * np.array(volume), rtol=1e-7)
    assert report["pore_volume"] == pytest.approx(sum(volume), rel=1e-12)
    assert report["flow_medium"]["pore_volume"] == pytest.approx(volume[1], rel=1e-12)
    assert report["gates"]["left"]["injected_volume"] == pytest.approx(sum(volume), rel=1e-7)
    assert report["balance_error"] < 1e-12
    said = filling_in_words(report)
    assert "39.6 g of resin in the part and 13.2 g in the flow medium" in said


def test_picture_of_the_layer_is_drawn_beside_that_of_the_part(result):
    out, _, report = result
    assert report["files"]["medium_time"] == "part_filling_medium_time.png"
    for name in ("medium_time", "fill_time"):
        assert (out / report["files"][name]).stat().st_size > 20_000


def test_a_case_without_a_layer_has_nothing_of_it(mesh_file, tmp_path):
    case = case_of(HEAD, PREFORM, GATE, VENT)
    _, report = map_and_fill(mesh_file, None, case, name="part", out_dir=tmp_path,
                          options=FillOptions(picture=False, vtu=False))  # fmt: skip
    with xr.open_dataset(tmp_path / "part_filling.nc", decode_times=False) as fields:
        assert not any("flow_medium" in name for name in fields)
    assert report.flow_medium is None and "medium_time" not in report.files


def test_axes_of_the_layer_are_laid_into_its_cells(mesh_file):
    """Along x both layers have 1e-9 m², across it one has more."""
    times = []
    for own in ('k1 = "1e-9 m^2"', 'k1 = "4e-9 m^2", ratio = 0.25, axis = [0, 1, 0]'):
        layer = LAYER.replace('k1 = "3e-9 m^2"', own)
        times.append(fill(*unformed(mesh_file, layer, GATE, VENT)).fill_time)
    np.testing.assert_allclose(times[1], times[0], rtol=1e-3)


def test_a_formed_part_takes_a_layer(kit):
    part = read_formed_part(kit.forming())
    filled = fill(part, kit.case(HEAD, LAYER + OVER, GATE, VENT))
    assert filled.is_filled and filled.layer is not None
    assert filled.fill_time.shape == (len(part.target.points),)
    alone = fill(part, kit.case(HEAD, GATE, VENT))
    assert filled.state.time < 0.5 * alone.state.time


def test_gates_enter_the_layer_where_they_lie_on_it_and_vents_open_both(mesh_file):
    setup = set_up(*unformed(mesh_file, LAYER, GATE, VENT))
    filling, count = setup.filling(), setup.mesh.node_count
    np.testing.assert_array_equal(filling.supply.gates[0].nodes, setup.gates[0].nodes + count)
    own = setup.vents[0].nodes
    np.testing.assert_array_equal(filling.supply.vents[0].nodes, np.append(own, own + count))


def test_an_interrupted_filling_goes_on_to_the_same_bits(mesh_file, tmp_path):
    setup = set_up(*unformed(mesh_file, LAYER + OVER, GATE, VENT))
    path = tmp_path / "state.npz"
    whole = FillingRun(setup, None, {}, lambda share, text: None).complete()
    run = FillingRun(setup, path, {}, lambda share, text: share > 0.3 and run._stop.set())
    with pytest.raises(Exception, match="--resume"):
        run.complete()
    again = FillingRun(setup, path, {}, lambda share, text: None).complete(resume=True)
    np.testing.assert_array_equal(again.fill_time, whole.fill_time)
    np.testing.assert_array_equal(again.layer.fill, whole.layer.fill)


def test_air_that_both_fronts_enclose_is_named_below_the_layer(mesh_file):
    """The front comes from both ends, and the vents are there."""
    gates = GATE + GATE.replace('"left"', '"far"').replace("0 -1 -1", "299 -1 -1").replace(
        "0 61 1", "301 61 1"
    )
    vent = '[[vents]]\nname = "side"\nbox = ["20 -1 -1 mm", "80 1 1 mm"]\n'
    filled = fill(*unformed(mesh_file, LAYER, gates, vent))
    assert filled.dry_spots and filled.left_dry
    count = filled.setup.mesh.node_count
    assert all(spot.nodes.max() < count for _, spot in filled.dry_spots)
    assert all(spot.area <= 0.3 * 0.06 for _, spot in filled.dry_spots)


@pytest.mark.parametrize(
    ("texts", "said"),
    [
        ([LAYER.replace('m^2" }', 'm^2", k3 = "1e-9 m^2" }'), GATE, VENT], "k3 of the preform"),
        ([LAYER + "over = { rim = true }\n", GATE, VENT], "takes cells"),
        ([LAYER + 'over = { point = "1 1 0 mm" }\n', GATE, VENT], "needs the radius"),
        ([LAYER.replace("0.8", "1.0"), GATE, VENT], "porosity"),
        (
            ['film = { thickness = "1 mm", pressure = "2 bar" }', LAYER, GATE, VENT],
            "layer of resin",
        ),
        (["trapped_air = true\nvent_pressure = '0.1 bar'", LAYER, GATE, VENT], "closes in"),
    ],
)
def test_what_a_layer_cannot_have_is_refused(texts, said):
    first = [HEAD + texts[0]] if not texts[0].startswith("\n[") else [HEAD, texts[0]]
    with pytest.raises(InputError, match=said):
        case_of(*first, PREFORM, *texts[1:])


def test_parts_that_lack_what_a_layer_needs_are_refused(mesh_file, kit, tmp_path):
    bare = PREFORM.replace(', k3 = "1e-12 m^2"', "")
    case = case_of(HEAD, bare, LAYER, GATE, VENT)
    with pytest.raises(InputError, match="k3"):
        set_up(unformed_part(mesh_file, case.preform), case)
    round_gate = GATE.replace(
        'box = ["0 -1 -1 mm", "0 61 1 mm"]', 'point = "260 30 0 mm"\nradius = "26 mm"'
    )
    with pytest.raises(InputError, match="round hole has one field"):
        set_up(*unformed(mesh_file, LAYER + OVER, round_gate, VENT))
    part, case = unformed(mesh_file, LAYER, GATE, VENT)
    with pytest.raises(InputError, match="no other program can move"):
        FillingPart(set_up(part, case).filling())
    path = tmp_path / "case.toml"
    path.write_text("\n".join([HEAD, LAYER, GATE, VENT]))
    with pytest.raises(InputError, match="cannot be part of a unit"):
        build_infiltration_fmu(kit.forming(), path, tmp_path / "unit.fmu")


def test_doubts_of_a_layer_are_told(mesh_file):
    poor = LAYER.replace("3e-9", "3e-12")
    assert "conducts more than the layer" in " ".join(
        set_up(*unformed(mesh_file, poor, GATE, VENT)).warnings
    )
    short = LAYER.replace("3e-9", "1e-10")
    case = case_of(HEAD, PREFORM.replace("1e-12", "1e-10"), short, GATE, VENT)
    setup = set_up(unformed_part(mesh_file, case.preform), case)
    assert "less than one edge of the mesh" in " ".join(setup.warnings)
    good = set_up(*unformed(mesh_file, LAYER, GATE, VENT))
    assert not any("flow medium" in text for text in good.warnings)
