"""Saturated strips between stiff plates, whose resin leaves at both ends: parts of scenes."""

from __future__ import annotations

from lcmchain.coupling.wet_forming.wet_forming import WetForming
from lcmchain.scene import scene_from_text
from lcmchain.solver.simulation import Simulation

#: Along and across the strip [m²], and of the resin [Pa s].
PERMEABILITY, VISCOSITY = 1e-10, 1e-3
CLOSING = (
    'motion = { type = "stroke", direction = [0, 0, -1], distance = "0.1 mm", profile = "linear" }'
)


def between_plates(press: str = CLOSING, top: float | str = 0.502) -> str:
    """Return permeability and plates; the upper one at a height [mm] with further lines."""
    return f"""
[permeability]
law = "constant"
k1 = "{PERMEABILITY} m^2"
k2 = "{PERMEABILITY} m^2"
k3 = "1e-11 m^2"
[[tools]]
name = "die"
shape = {{ type = "plate", side = "below" }}
position = "0 0 -0.502 mm"
[[tools]]
name = "press"
shape = {{ type = "plate", side = "above" }}
position = "0 0 {top} mm"
{press}
"""


def bleeding_at_both_ends(
    end: int = 50, *, reach: int = 60, across: int = 6, high: int = 1, time: str = "10 ms"
) -> str:
    """Return the resin of a strip: wetted up to x = ``reach``, with vents at ``end`` [mm].

    across, high : reach of the boxes along y and z [mm].
    """
    return f"""
[infiltration]
time = "{time}"
resin = {{ law = "constant", viscosity = "{VISCOSITY} Pa*s", density = "1100 kg/m^3" }}
with_forming = {{ window = "0.1 ms" }}
[[infiltration.wetted]]
name = "all"
box = [["-{reach} mm", "-{across} mm", "-{high} mm"], ["{reach} mm", "{across} mm", "{high} mm"]]
[[infiltration.vents]]
name = "left"
box = [["-{end + 1} mm", "-{across} mm", "-{high} mm"], \
["-{end - 1} mm", "{across} mm", "{high} mm"]]
bleeds = true
[[infiltration.vents]]
name = "right"
box = [["{end - 1} mm", "-{across} mm", "-{high} mm"], ["{end + 1} mm", "{across} mm", "{high} mm"]]
bleeds = true
"""


def wet(text: str) -> WetForming:
    """Return the forming and filling of a scene, at its start."""
    scene = scene_from_text(text)
    return WetForming(scene, Simulation.from_scene(scene))
