"""A check tells what a very large mesh costs without building it."""

from __future__ import annotations

import pytest

from lcmchain.check import check_scene, large_mesh
from lcmchain.check.large_mesh import BUILDING_BYTES, checked_mesh, require_mesh_fits
from lcmchain.errors import InputError
from lcmchain.mesh import blank as meshing
from lcmchain.scene import scene_from_text

SCENE = """
title = "a large mesh"
[process]
time = "40 ms"
frames = 2
[blank]
size = ["60 mm", "60 mm"]
edge_length = "{edge} mm"
height = "0.502 mm"
[material]
preset = "MD600"
[[tools]]
name = "punch"
shape = {{ type = "sphere_capped_punch", radius = "15 mm" }}
position = "0 0 2 mm"
motion = {{ type = "stroke", direction = [0, 0, -1], distance = "3 mm" }}
"""


def scene_of(edge):
    return scene_from_text(SCENE.format(edge=edge))


def test_nothing_large_is_built_for_the_largest_mesh_that_is_allowed(monkeypatch):
    built = []
    cut = meshing.best_lattice

    def counted(outline, edge_length):
        built.append(edge_length)
        return cut(outline, edge_length)

    monkeypatch.setattr(large_mesh, "ENOUGH", 400)
    monkeypatch.setattr(large_mesh, "physical_memory", lambda: 2**40)
    monkeypatch.setattr(meshing, "best_lattice", counted)
    report = check_scene(scene_of(0.0425))  # 1.99 million elements
    assert report.element_count == pytest.approx((60 / 0.0425) ** 2, rel=0.02)
    assert min(built) > 2.9e-3  # 60 mm over 20 elements
    assert any("was not built for this check" in warning for warning in report.warnings)


def test_cost_told_without_the_mesh_is_that_of_the_mesh(monkeypatch):
    whole = check_scene(scene_of(2))
    monkeypatch.setattr(large_mesh, "LARGE", 500)
    monkeypatch.setattr(large_mesh, "ENOUGH", 225)
    told = check_scene(scene_of(2))
    assert told.element_count == whole.element_count == 900
    assert told.node_count == pytest.approx(whole.node_count, rel=0.1)
    assert told.estimate.step_count == pytest.approx(whole.estimate.step_count, rel=0.02)
    assert told.gaps[0].gap == pytest.approx(whole.gaps[0].gap, abs=1e-9)
    assert len(told.warnings) == len(whole.warnings) + 1


def test_a_mesh_beyond_the_memory_is_refused_before_it_is_built():
    with pytest.raises(InputError, match="more than the 1 GB of this machine; choose") as caught:
        require_mesh_fits(10**6, 10**9, edge_length=1e-3)
    assert caught.value.key == "blank.edge_length"
    fitting = float(str(caught.value).split("choose ")[1].split(" m")[0])
    assert 10**6 * (1e-3 / fitting) ** 2 * BUILDING_BYTES == pytest.approx(0.5e9, rel=0.1)
    require_mesh_fits(10**5, 10**9, edge_length=1e-3)
    assert checked_mesh(scene_of(2)).refinement == 1.0
