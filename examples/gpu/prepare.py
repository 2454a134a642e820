"""Write the step of sheets as CUDA, their arrays, and what the program makes of them.

    python examples/gpu/prepare.py --out FOLDER [--elements N ...]

The hemisphere with holder at mid-stroke, and free plates. The folder then has all that
``on_gpu.py`` needs, which takes NumPy and CuPy alone.
"""

from __future__ import annotations

import argparse
import shutil
import sys
from pathlib import Path

import numpy as np
from source import bending_lines, contact, element_lines, equations, operation_count

from lcmchain.bench.hemisphere import at_mid_stroke
from lcmchain.bench.sizes import free_plate
from lcmchain.effects.fibre_bending import MIDDLE_ROWS, SHARE_ROW
from lcmchain.elements.blocks import LANES
from lcmchain.solver.simulation import Simulation

HERE = Path(__file__).parent
STEPS = 100  # after which positions are compared
SPEED = 5.0  # of the middle of the sheet at the start [m/s]
MOST_COMPARED = 70_000  # elements of a sheet whose result is written


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--elements", type=int, nargs="+", default=[4_000, 64_000, 256_000])
    arguments = parser.parse_args()
    arguments.out.mkdir(parents=True, exist_ok=True)
    write(arguments.out / "hemisphere", at_mid_stroke())
    for count in arguments.elements:
        simulation = free_plate(count)
        simulation.set_velocity(bulging(simulation.state.position))
        write(arguments.out / f"plate_{count}", simulation)
    body = simulation.model.only_body().data
    for name, lines in (
        ("an element along the fibres", element_lines(body.law, body.quick_options)),
        ("a parallelogram", element_lines(body.law, body.options)),
        ("bending at a node", bending_lines()),
    ):
        print(f"operations of {name}: {operation_count(lines)}")
    for name in ("step.cu", "on_gpu.py"):
        shutil.copy(HERE / name, arguments.out / name)
    print(f"{arguments.out}: python on_gpu.py there")


def bulging(position: np.ndarray) -> np.ndarray:
    """Return the velocities of a sheet that begins to bulge, highest in its middle."""
    velocity = np.zeros_like(position)
    low, high = position[:2].min(axis=1, keepdims=True), position[:2].max(axis=1, keepdims=True)
    velocity[2] = SPEED * np.sin(np.pi * (position[:2] - low) / (high - low)).prod(axis=0)
    return velocity


def write(folder: Path, simulation: Simulation) -> None:
    """Write the equations of a sheet, its arrays, and its positions after some steps."""
    folder.mkdir(exist_ok=True)
    model, state = simulation.model, simulation.state
    body = model.only_body().data
    dt = simulation.prepare_steps()
    simulation.make_steps(STEPS, dt)  # from here on the step is as long as the last one
    has_tools, is_compared = bool(model.interactions), model.element_count <= MOST_COMPARED
    text = equations(body) + (contact(model.tools) if has_tools else "")
    (folder / "equations.h").write_text(text, encoding="ascii")
    arrays = {
        "element_count": model.element_count,
        "dt": dt,
        "damping": model.environment.mass_damping,
        "position": state.position.copy(),
        "velocity": state.velocity.copy(),
        "corner_node": body.corner_node,
        "quick_data": body.quick_data.values,
        "quick_start": body.quick_data.start,
        "general_data": body.element_data.values,
        "general_start": body.element_data.start,
        "shared": state.history.copy(),
        "inverse_mass": model.nodes.inverse_mass,
        **bending_arrays(simulation),
    }
    if has_tools:
        arrays |= contact_arrays(simulation, dt)
    elif is_compared:
        simulation.make_steps(STEPS, dt)
    if is_compared:
        arrays |= {"steps": STEPS, "position_then": simulation.state.position}
    np.savez_compressed(folder / "arrays.npz", **arrays)


def contact_arrays(simulation: Simulation, dt: float) -> dict[str, np.ndarray]:
    """Return what contact asks for; makes the steps, for where the tools are in each of them."""
    model, state = simulation.model, simulation.state
    environment, nodes = model.environment, model.nodes
    if environment.depth_time is not None or model.averaging is not None or nodes.free is not None:
        raise SystemExit("depths held at zero, averaged damping and supports are not written down")
    found = {
        "stick": state.stick.copy(), "area": nodes.area, "impedance": nodes.impedance,
        "offset": nodes.offset, "penalty": environment.penalty,
        "tangential_ratio": environment.tangential_ratio,
        "damping_ratio": environment.contact_damping_ratio, "weight": environment.gravity,
    }  # fmt: skip
    travel, speed = np.empty((2, STEPS, len(model.tool_names)))
    for step in range(STEPS):
        travel[step], speed[step] = state.tool_travel, state.tool_velocity
        simulation.make_steps(1, dt)
    return found | {"travel": travel, "speed": speed}


def bending_arrays(simulation: Simulation) -> dict[str, np.ndarray]:
    """Return the fibres' bending as the kernels of ``step.cu`` read it, and the nodes' slots."""
    model = simulation.model
    bending = model.fibre_bending
    if bending is None or bending.data is None:
        raise SystemExit("a sheet without bending of the fibres in the plane is not written down")
    data, count = bending.data, bending.below.size
    blocks = data.start.size
    indices = data.indices.reshape(blocks, -1, LANES).transpose(1, 0, 2).reshape(-1, blocks * LANES)
    indices = indices[:, :count]
    # a place in the middles of blocks of 16 is a node of the mid-surface
    block, within = np.divmod(indices[2:6], MIDDLE_ROWS * LANES)
    near = np.concatenate([np.arange(count)[None], block * LANES + within])
    middle_of_node = np.full(model.node_count, -1, dtype=np.int32)
    middle_of_node[bending.below] = middle_of_node[bending.above] = np.arange(count)
    start = np.repeat(data.start, LANES)[:count] + np.tile(np.arange(LANES), blocks)[:count]
    slot = model.nodes.force_slot
    of_elements = np.where(slot < data.first_force, slot, data.first_force)
    return {
        "middle_nodes": np.stack([bending.below[near], bending.above[near]], axis=1),
        "middle_of_node": middle_of_node,
        "source": indices[6:],
        "bending_constants": data.constants,
        "bending_start": data.start,
        "share": data.constants[start + SHARE_ROW * LANES],
        "slot": of_elements[(of_elements != data.first_force).any(axis=1)],
    }


if __name__ == "__main__":
    sys.exit(main())
