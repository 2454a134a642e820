"""Options of a mapping: one set of entries for the command, scenes and Python."""

from dataclasses import fields

import pytest

from lcmchain.mapping import MappingOptions, map_file
from lcmchain.scene import MappingTarget


def test_every_entry_of_a_scene_is_an_option_with_the_same_default():
    target = MappingTarget(name="part", mesh="part.vtu", kind="infiltration")
    options = MappingOptions(**target.options())
    assert options == MappingOptions(kind="infiltration")
    changed = target.model_copy(update={"maximum_distance": 0.002, "length_unit": "mm"})
    assert MappingOptions(**changed.options()).maximum_distance == 0.002
    assert set(target.options()) <= {entry.name for entry in fields(MappingOptions)}


def test_entries_by_keyword_go_before_those_of_the_options(make, write_mesh, tmp_path):
    points, quads = make.grid(3, 3)
    points = make.lifted(points)
    result = make.forming_result(points, quads)
    target = write_mesh(points, [("quad", quads)])
    options = MappingOptions(kind="infiltration", method="closest", picture=False)
    report = map_file(result, target, tmp_path / "m.nc", options, method="overlap")
    assert (report.kind, report.method) == ("infiltration", "overlap")
    assert map_file(result, target, tmp_path / "m.nc", options).method == "closest"
    with pytest.raises(TypeError, match="kinds"):
        map_file(result, target, tmp_path / "m.nc", kinds="structure")
