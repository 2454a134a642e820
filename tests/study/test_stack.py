"""Studies of a stack: compared ply by ply; what varies an edge length needs one that all share."""

import json
import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import xarray as xr
from typer.testing import CliRunner

from lcmchain.cli import app
from lcmchain.errors import InputError
from lcmchain.study import accuracy
from lcmchain.study.accuracy import ladder, scene_name, study_accuracy
from lcmchain.study.choice import read_requirement
from lcmchain.study.chooser import Chooser
from lcmchain.study.comparison import BY_NAME, carry, contour_difference, differences
from lcmchain.study.outcome import Outcome, outcome_of_sheet, read_outcome, write_outcome

from .conftest import SCENE

SIZE = 0.2
LAYUP = 'layup = "[0/90, 45/-45]"\n' + SCENE.replace("1.004", "2.008")
PLY = '[[plies]]\nsize = ["40 mm", "40 mm"]\nedge_length = "{} mm"\n'
PLIES = "".join(
    line for line in SCENE.replace("1.004", "2.008").splitlines(True) if "blank" not in line
) + PLY.format(5) + PLY.format(4)  # fmt: skip


def stack(counts, fields, shift=0.0, height=1e-3):
    """Square plies of ``counts`` faces along an edge, one on the other.

    fields : of each ply its shear angle as a function of x and y. shift : of the uppermost [m].
    """
    points, faces, values, plies, first = [], [], [], [], 0
    for number, (count, field) in enumerate(zip(counts, fields, strict=True)):
        line = np.linspace(0.0, SIZE, count + 1)
        x, y = (c.ravel() for c in np.meshgrid(line, line, indexing="ij"))
        corner = (np.arange(count)[:, None] * (count + 1) + np.arange(count)).ravel()
        own = np.column_stack([corner, corner + count + 1, corner + count + 2, corner + 1])
        points.append(np.column_stack([x, y, np.full(x.size, number * height)]))
        centre = points[-1][own].mean(axis=1)
        faces.append(own + first)
        values.append(field(centre[:, 0], centre[:, 1]))
        plies.append(np.full(len(own), number))
        first += x.size
    reference = np.concatenate(points)
    formed = reference.copy()
    formed[-len(points[-1]) :, 0] += shift
    return Outcome(
        1.0, 1, reference, formed, np.concatenate(faces), {"shear_angle": np.concatenate(values)},
        ply=np.concatenate(plies),
    )  # fmt: skip


def rising(x, y):
    return 0.1 + x - 0.5 * y


def falling(x, y):
    return -0.3 - 2.0 * x


def test_every_ply_is_compared_with_the_same_ply():
    """Fields of one must not be taken for those of another, here at the very same place."""
    fields = rising, falling
    coarse, fine = (stack(counts, fields, height=0.0) for counts in ((7, 9), (12, 10)))
    carried, areas = carry(coarse, fine, ["shear_angle"])
    np.testing.assert_allclose(carried["shear_angle"], fine.values["shear_angle"], atol=1e-12)
    assert areas.sum() == pytest.approx(2.0 * SIZE**2, rel=1e-12)
    assert differences(coarse, fine)["shear_angle"].largest < 1e-12
    swapped = stack((12, 10), (falling, rising), height=0.0)
    assert differences(coarse, swapped)["shear_angle"].typical > 0.3


def test_a_ply_that_has_slid_is_seen_in_the_contour():
    still, slid = stack((8, 8), (rising, rising)), stack((8, 8), (rising, rising), shift=3e-3)
    found = contour_difference(slid, still)
    assert found.largest == pytest.approx(3e-3, rel=1e-9)
    # one ply of two, and of that the two sides across the shift
    assert found.typical == pytest.approx(3e-3 * math.sqrt(0.25), rel=0.05)


def test_stacks_of_unlike_numbers_of_plies_are_not_compared():
    two, three = stack((4, 4), (rising,) * 2), stack((4, 4, 4), (rising,) * 3)
    found = differences(three, two)
    assert all(math.isnan(found[name].typical) for name in BY_NAME)


def test_an_outcome_keeps_its_plies(tmp_path):
    outcome = stack((3, 4), (rising, falling))
    write_outcome(tmp_path / "run.nc", outcome, "print")
    read = read_outcome(tmp_path / "run.nc", "print")
    assert read.equals(outcome) and [len(rows) for rows in read.plies] == [9, 16]
    assert not read.equals(replace(outcome, ply=outcome.ply[::-1].copy()))


def of_text(dent, text):
    return type(dent)(text, dent.path)


def test_the_ladder_of_a_layup_varies_the_edge_length_of_all_plies(dent):
    source = of_text(dent, LAYUP)
    variants = ladder(source)
    names = [variant.name for variant in variants]
    assert scene_name(source.scene()) == "5 mm" and {"5 mm", "10 mm"} <= set(names)
    # a net without forces knows nothing of plies that touch
    assert not any(name.startswith("kinematic") for name in names)
    coarse = variants[names.index("10 mm")]
    scene = source.scene(coarse.overrides)
    assert [ply.blank.edge_length for ply in scene.stack] == pytest.approx([0.01, 0.01])


def test_plies_with_an_edge_length_each_are_refused_by_what_varies_one(dent, tmp_path):
    source = of_text(dent, PLIES)
    assert scene_name(source.scene()) == "4 mm"
    with pytest.raises(InputError, match="plies: names 2 plies .* lcmchain study accuracy varies"):
        ladder(source)
    with pytest.raises(InputError, match="plies: names 2 plies .* --within or --budget varies one"):
        Chooser(source, tmp_path, read_requirement("1 deg shear", None), threads=1)


def test_settings_that_all_fail_are_told(dent, tmp_path, monkeypatch):
    good = stack((4, 4), (rising, falling))
    found = {"a = 1": Outcome(1.0, failure="it fell"), "a = 2": good}
    monkeypatch.setattr(accuracy, "chosen", lambda *_: [
        SimpleNamespace(name=name, axis="a", value=None) for name in found
    ])  # fmt: skip
    monkeypatch.setattr(accuracy.Study, "outcomes", lambda *_: found)
    with pytest.raises(InputError, match=r'nothing is left .* \("a = 1"\) since it fell'):
        study_accuracy(of_text(dent, LAYUP), tmp_path, vary={"a": ["1", "2"]})


@pytest.mark.slow
@pytest.mark.parametrize(
    "requirement",
    [["--within", "5 deg shear, 10 % thickness"], ["--budget", "8 s"]],
    ids=lambda w: w[0],
)
def test_a_run_of_a_layup_chooses_its_mesh(tmp_path, requirement):
    """From the command line to the files of a stack, with what was chosen for all plies."""
    path, out = tmp_path / "scene.toml", tmp_path / "out"
    path.write_text(LAYUP, encoding="utf-8")
    done = CliRunner().invoke(app, ["run", str(path), "--out", str(out), "--quiet", *requirement])
    assert done.exit_code == 0, done.output
    summary = json.loads((out / "summary.json").read_text(encoding="utf-8"))
    assert summary["state"] == "complete"
    assert list(summary["plies"]) == ["ply_1", "ply_2"] and summary["choice"]
    counts = []
    for ply in summary["plies"]:
        with xr.open_dataset(out / "forming.nc", group=ply) as own:
            counts.append(own["thickness"].shape[1])
    assert sum(counts) == summary["element_count"] and min(counts) > 0


def test_the_plies_of_a_result_are_kept():
    """As the root group of forming.nc tells them."""
    import xarray as xr

    from lcmchain.fields.ugrid import UgridMesh

    given = stack((2, 3), (rising, falling))
    mesh = UgridMesh("sheet")
    variables = {
        **mesh.topology(given.faces, long_name="plies"),
        **mesh.node_positions(given.formed),
        "body": mesh.on_cells(given.ply.astype(np.int32), {"long_name": "ply", "units": "1"}),
        "time": ("time", [0.0, 1.0]),
        "shear_angle": (("time", "sheet_face"), np.stack([given.values["shear_angle"]] * 2)),
    }
    for name, values in (("reference_position", given.reference),
                         ("displacement", given.formed - given.reference)):  # fmt: skip
        for axis, column in zip("xyz", values.T):
            of_frames = np.stack([column] * 2)
            dims = ("sheet_node",) if name.startswith("ref") else ("time", "sheet_node")
            variables[f"{name}_{axis}"] = (dims, column if len(dims) == 1 else of_frames)
    outcome = outcome_of_sheet({"/": xr.Dataset(variables)}, {}, 1.0, 1)
    np.testing.assert_array_equal(outcome.ply, given.ply)
    assert [len(rows) for rows in outcome.plies] == [4, 9]
