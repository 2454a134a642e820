"""Thickness and force where tools close to a gap: depths left to the springs, and driven to zero.

    python examples/closed_mould/compare.py [--edges 10 5] [--out DIR]

Runs the plates of ``lcmchain new coupon --preset MD600`` and a double dome between two moulds
whose surfaces end 0.6 mm apart, on several edge lengths, with ``contact.depth`` "free" and
"automatic".
Prints a table: thickness of the last frame, the largest mean force, what the law gives at the gap
of the plates, steps, and what the run itself says it hides. Ends with an error where a thickness of
the automatic choice is more than 1 % off the gap, or a force of the plates 2 % off the law.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import meshio
import numpy as np

from lcmchain import read_scene, run
from lcmchain.scene import Scene, scene_from_text

GAP = 0.6e-3  # between the moulds at the end [m]
PLATE_GAP = 0.703e-3
HALF_SIZE, SPACING = (60.0, 50.0), 121  # of the moulds [mm], and their vertices along an edge
HEIGHT, PLACE, WIDTH = 8.0, 18.0, 14.0  # of the two domes [mm]

PLATES = """
process = { time = "35 ms", frames = 21 }
blank = { size = ["20 mm", "20 mm"], edge_length = "5 mm", height = "0.502 mm" }
material = { preset = "MD600" }
contact = { friction = 0.157 }

[[tools]]
name = "lower"
shape = { type = "plate", side = "below" }

[[tools]]
name = "upper"
shape = { type = "plate", side = "above" }
position = "0 0 1.004 mm"
motion = { type = "stroke", direction = [0, 0, -1], distance = "0.301 mm" }
"""
DOMES_PROCESS = 'process = { time = "120 ms", mass_damping = "100 1/s", frames = 13 }\n'
DOMES = """
blank = { size = ["90 mm", "70 mm"], edge_length = "5 mm", height = "9.0 mm" }
material = { preset = "MD600" }
contact = { friction = 0.1 }

[[tools]]
name = "lower"
shape = { type = "surface_mesh", file = "lower.stl", length_unit = "mm" }

[[tools]]
name = "upper"
shape = { type = "surface_mesh", file = "upper.stl", length_unit = "mm" }
position = "0 0 9.0 mm"
motion = { type = "stroke", direction = [0, 0, -1], distance = "9.0 mm" }
"""


def write_moulds(folder: Path) -> None:
    """Write two surfaces, the upper one at ``GAP`` from the lower one along its normals."""
    axes = [np.linspace(-half, half, SPACING) for half in HALF_SIZE]
    x, y = np.meshgrid(*axes, indexing="ij")
    bumps = [HEIGHT * np.exp(-((x - x0) ** 2 + y**2) / (2 * WIDTH**2)) for x0 in (PLACE, -PLACE)]
    slope_x = sum(-(x - x0) / WIDTH**2 * b for x0, b in zip((PLACE, -PLACE), bumps, strict=True))
    slope_y = sum(-y / WIDTH**2 * bump for bump in bumps)
    normal = np.stack([-slope_x, -slope_y, np.ones_like(x)], axis=-1)
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    lower = np.stack([x, y, sum(bumps)], axis=-1)
    node = np.arange(SPACING**2).reshape(SPACING, SPACING)
    a, b, c, d = node[:-1, :-1], node[1:, :-1], node[1:, 1:], node[:-1, 1:]
    upward = np.concatenate([np.stack(t, -1).reshape(-1, 3) for t in ((a, b, c), (a, c, d))])
    for name, points, cells in (
        ("lower", lower, upward),
        ("upper", lower + 1e3 * GAP * normal, upward[:, ::-1]),
    ):
        mesh = meshio.Mesh(points.reshape(-1, 3), [("triangle", cells)])
        meshio.write(folder / f"{name}.stl", mesh)


def scenes(edges: list[float], folder: Path) -> Iterator[tuple[str, float, Scene]]:
    """Yield name, gap [m] and scene of every run."""
    folder.mkdir(parents=True, exist_ok=True)
    write_moulds(folder)
    (folder / "domes.toml").write_text(DOMES_PROCESS + DOMES, encoding="utf-8")
    for edge in edges:
        for depth in ("free", "automatic"):
            overrides = [f'blank.edge_length="{edge:g} mm"', f"contact.depth={depth}"]
            overrides += ["output.pictures=false", "output.vtu=false"]
            name = f"{edge:g}-mm-{depth}"
            yield f"plates-{name}", PLATE_GAP, scene_from_text(PLATES, overrides=overrides)
            scene = read_scene(folder / "domes.toml", overrides=overrides)
            yield f"domes-{name}", GAP, scene


def summary_of(scene: Scene, folder: Path) -> dict[str, Any]:
    """Run a scene, or take its summary from its folder."""
    if not (folder / "summary.json").is_file():
        run(scene, folder)
    return json.loads((folder / "summary.json").read_text(encoding="utf-8"))


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--edges", type=float, nargs="+", default=[10.0, 5.0], help="[mm]")
    parser.add_argument("--out", type=Path, default=Path("results/closed_mould"))
    arguments = parser.parse_args()
    print("case | thickness [mm] | off the gap [%] | force [N] | law [N] | steps | hidden [%]")
    print("---|---|---|---|---|---|---")
    failed = []
    for name, gap, scene in scenes(arguments.edges, arguments.out):
        found = summary_of(scene, arguments.out / name)
        thickness = np.array([found["thickness_min_m"], found["thickness_max_m"]])
        off = float(np.abs(thickness / gap - 1.0).max())
        force, law = found["punch_force_max_N"], ""
        if name.startswith("plates"):
            pressure = scene.built_material().compaction_pressure(gap / scene.material.thickness)
            expected = float(pressure) * 20e-3**2
            law = f"{expected:.4g}"
            if name.endswith("automatic") and abs(force / expected - 1.0) > 0.02:
                failed.append(name)
        if name.endswith("automatic") and off > 0.01:
            failed.append(name)
        hidden = 100.0 * found["hidden_thickness_part"], 100.0 * found["hidden_force_part"]
        print(
            f"{name} | {1e3 * thickness[0]:.4f} to {1e3 * thickness[1]:.4f} | {100 * off:.2f} | "
            f"{force:.4g} | {law} | {found['step_count']:,} | {hidden[0]:.2g}, {hidden[1]:.2g}"
        )
    if failed:
        print(f"outside the limits: {', '.join(dict.fromkeys(failed))}", file=sys.stderr)
    return int(bool(failed))


if __name__ == "__main__":
    sys.exit(main())
