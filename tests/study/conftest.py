"""A scene that forms in a moment, and studies of it."""

import pytest

from lcmchain.study.sources import SceneText

SCENE = """
title = "dent"
process = { time = "4 ms", mass_damping = "200 1/s" }
blank = { size = ["40 mm", "40 mm"], edge_length = "5 mm", height = "0.502 mm" }
material = { preset = "MD600" }
contact = { friction = 0.157 }

[[tools]]
name = "punch"
shape = { type = "sphere_capped_punch", radius = "15 mm" }
position = "0 0 1.004 mm"
motion = { type = "stroke", direction = [0, 0, -1], distance = "2 mm" }

[[tools]]
name = "die"
shape = { type = "plate_with_hole", hole_radius = "16 mm", fillet_radius = "3 mm", side = "below" }
"""


@pytest.fixture
def dent(tmp_path):
    """The scene as text; files that a study writes are elsewhere."""
    path = tmp_path / "scene.toml"
    path.write_text(SCENE, encoding="utf-8")
    return SceneText.from_file(path)
