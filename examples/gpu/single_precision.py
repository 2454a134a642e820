"""Forces of the elements in single precision: how wrong, and how much sooner, on a processor.

    python examples/gpu/single_precision.py [--compiler clang] [--repetitions N]

The hemisphere with holder at mid-stroke. The equations of the program, written as C, are compiled
twice by one compiler, for either precision; positions are differences of double precision in both,
and forces are summed at the nodes in double precision. Times of both and of the program's own
kernel are taken in turn on one core, medians.
"""

from __future__ import annotations

import argparse
import ctypes
import statistics
import subprocess
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from source import equations

from lcmchain.bench.hemisphere import at_mid_stroke
from lcmchain.compilation.threads import use_threads
from lcmchain.elements.family import internal_forces
from lcmchain.solver.simulation import Simulation

HERE = Path(__file__).parent
KINDS: dict[str, Any] = {"double": np.float64, "float": np.float32}
FLAGS = "-O3 -march=native -mprefer-vector-width=512 -ffast-math -shared -fPIC".split()
CALLS = 50  # of a timing


def compiled(compiler: str, real: str, folder: Path) -> Any:
    """Return the function of ``on_cpu.c`` in one precision."""
    library = folder / f"{real}.so"
    command = [compiler, *FLAGS, f"-Dreal={real}", f"-I{folder}", HERE / "on_cpu.c", "-lm"]
    subprocess.run([*command, "-o", library], check=True)
    return ctypes.CDLL(str(library)).element_forces


def work_of(function: Any, simulation: Simulation, real: str) -> tuple[Callable[[], None], Any]:
    """Return the call of a function for all elements, and the array that it writes."""
    body, kind = simulation.model.only_body().data, KINDS[real]
    out = np.zeros(body.corner_node.size // 8 * 24, kind)
    arrays = (
        simulation.state.position,
        body.corner_node,
        body.quick_data.values.astype(kind),
        body.quick_data.start,
        body.element_data.values.astype(kind),
        body.element_data.start,
        simulation.state.history.astype(kind),
        out,
    )
    pointers = [array.ctypes.data_as(ctypes.c_void_p) for array in arrays]
    counts = ctypes.c_int(body.quick_data.start.size), ctypes.c_long(arrays[0].shape[1])
    return lambda *, _keep=arrays: function(*counts, *pointers), out


def at_nodes(simulation: Simulation, corner_force: np.ndarray) -> np.ndarray:
    """Return the forces at the nodes (3, N) [N], summed in double precision."""
    node = simulation.model.only_body().data.corner_node.reshape(-1, 8, 1, 16)
    node = np.broadcast_to(node, (node.shape[0], 8, 3, 16))
    force = corner_force.astype(float).reshape(node.shape)
    count = simulation.model.element_count
    kept = np.arange(node.shape[0] * 16).reshape(-1, 1, 1, 16) < count  # not what fills a block up
    total = np.zeros((3, simulation.model.node_count))
    for d in range(3):
        np.add.at(total[d], node[:, :, d], np.where(kept, force, 0.0)[:, :, d])
    return total


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--compiler", default="gcc")
    parser.add_argument("--repetitions", type=int, default=21)
    arguments = parser.parse_args()
    simulation = at_mid_stroke()
    use_threads(1)
    body = simulation.model.only_body().data
    own = np.zeros(body.corner_node.size // 8 * 24)
    position, history = simulation.state.position, simulation.state.history
    work: dict[str, Callable[[], None]] = {
        "the program": lambda: internal_forces(body, position, own, history)
    }
    written = {"the program": own}
    with tempfile.TemporaryDirectory() as name:
        (Path(name) / "equations.h").write_text(equations(body), encoding="ascii")
        for real in KINDS:
            function = compiled(arguments.compiler, real, Path(name))
            work[real], written[real] = work_of(function, simulation, real)
    times: dict[str, list[float]] = {key: [] for key in work}
    for _ in range(arguments.repetitions):
        for key, call in work.items():
            begin = time.process_time()
            for _ in range(CALLS):
                call()
            elapsed = (time.process_time() - begin) / CALLS
            times[key].append(1e6 * elapsed / simulation.model.element_count)
    exact = at_nodes(simulation, own)
    scale = np.abs(own).max()
    print(
        f"{simulation.model.element_count} elements; largest corner force {scale:.3g} N, ", end=""
    )
    print(f"of nodes out of balance {np.sqrt((exact**2).mean()):.3g} N (rms)")
    for key in work:
        corner = np.abs(written[key] - own).max()
        nodes = np.sqrt(((at_nodes(simulation, written[key]) - exact) ** 2).mean())
        print(
            f"{key:12} {statistics.median(times[key]):.4f} us per element; differences: corner "
            f"forces {corner / scale:.1e} of the largest, nodes {nodes:.1e} N (rms)"
        )


if __name__ == "__main__":
    main()
