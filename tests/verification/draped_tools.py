"""Tools that tests drape a blank onto, and the scene around them."""

from lcmchain.draping import drape
from lcmchain.scene import scene_from_text

RADIUS = 75.502e-3  # of the mid-surface of the dome: 75 mm and half the thickness
SCENE = """
[process]
time = "1 s"
[blank]
size = ["SIZE mm", "SIZE mm"]
edge_length = "EDGE mm"
fibre_angle = "ANGLE deg"
height = "2 mm"
[material]
preset = "MD600"
[draping]
surface = "tool"
[[tools]]
name = "tool"
"""
DOME = 'shape = { type = "sphere_capped_punch", radius = "75 mm" }\naxis = [0, 0, -1]\n'
CYLINDER = (
    'shape = { type = "cylinder", radius = "40 mm" }\naxis = [1, 0, 0]\nposition = "0 0 -42 mm"\n'
)
CONE = 'shape = { type = "cone", half_angle = "35 deg", tip_radius = "0 mm" }\naxis = [0, 0, -1]\n'
ON_CONE = ('draping.place=["100 mm", "0 mm", "-140 mm"]', 'draping.seed=["0 mm", "0 mm"]')
PLATE = 'shape = { type = "plate", side = "below" }\n'
PRE_SHEAR = "draping.pre_shear=20 deg"


def text_of(tool, size=200, edge=5.0, angle=0.0):
    """Return the text of a scene that drapes a square blank [mm, deg] onto a tool."""
    text = SCENE.replace("SIZE", f"{size:g}").replace("EDGE", f"{edge:g}")
    return text.replace("ANGLE", f"{angle:g}") + tool


def draped(tool, *overrides, **blank):
    return drape(scene_from_text(text_of(tool, **blank), overrides=overrides))
