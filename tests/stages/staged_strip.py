"""A strip between plates with grippers of both kinds: one loop is compiled for all stages."""

from __future__ import annotations

from lcmchain.model import build_model
from lcmchain.scene import scene_from_text
from lcmchain.solver.simulation import Simulation

HEAD = """
process = { frames = 13 }
blank = { size = ["60 mm", "20 mm"], edge_length = "10 mm", height = "0.502 mm" }
material = { preset = "MD600" }
contact = { friction = 0.1, depth = "free", penalty = "10 N/mm^3" }
"""

TOOLS = """
[[tools]]
name = "die"
shape = { type = "plate", side = "below" }

[[tools]]
name = "punch"
shape = { type = "plate", side = "above" }
position = "0 0 1.004 mm"
stages = ["press", "hold"]

[[tools]]
name = "weight"
shape = { type = "plate", side = "above" }
position = "0 0 1.004 mm"
stages = ["weigh"]
motion = { type = "guided", direction = [0, 0, -1], mass = "10 g", force = "2 N", ramp = "1 ms", \
damping = "100 N*s/m" }

[[grippers]]
name = "clamp"
box = ["-30 -10 -1 mm", "-30 10 2 mm"]
hold = "xyz"
stages = ["pull"]

[[grippers]]
name = "spring"
box = ["30 -10 -1 mm", "30 10 2 mm"]
direction = [1, 0, 0]
force = "3 N"
stiffness = "5 N/mm"
stages = ["pull"]
"""

#: A stage that no test comes to: for entries that are at work in none of the others.
AFTER = """
[[stages]]
name = "after"
time = "1 ms"
"""

#: Stages by their names, for scenes that have some of them.
STAGES = {
    "press": """
[[stages]]
name = "press"
time = "4 ms"
motions.punch = { type = "stroke", direction = [0, 0, -1], distance = "0.2 mm" }
""",
    "hold": """
[[stages]]
name = "hold"
time = "1 ms"
""",
    "weigh": """
[[stages]]
name = "weigh"
time = "4 ms"
mass_damping = "2000 1/s"
""",
    "pull": """
[[stages]]
name = "pull"
time = "6 ms"
mass_damping = "1000 1/s"
""",
    "release": """
[[stages]]
name = "release"
time = "100 ms"
rest = true
""",
}


def text_of(*names: str, tools: str = TOOLS, head: str = HEAD) -> str:
    """Return the text of the scene with some of the stages, and one more behind them.

    Entries are at work in those of their stages that are there, else in the last one.
    """
    text, quoted = head + tools, '"after"'
    for line in [line for line in tools.splitlines() if line.startswith("stages")]:
        own = [f'"{name}"' for name in STAGES if f'"{name}"' in line and name in names]
        text = text.replace(line, f"stages = [{', '.join(own) or quoted}]")
    return text + "".join(STAGES[name] for name in names) + AFTER


def staged(*names: str, overrides=(), tools: str = TOOLS, head: str = HEAD):
    """Return the scene of :func:`text_of`."""
    return scene_from_text(text_of(*names, tools=tools, head=head), overrides=overrides)


def simulation_of(*names: str, overrides=(), **parts) -> Simulation:
    """Build the simulation of the strip with some stages."""
    return Simulation(build_model(staged(*names, overrides=overrides, **parts)))
