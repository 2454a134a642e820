"""Steps of the cases that ``prepare.py`` wrote, on a graphics processor with CuPy.

    python on_gpu.py [--repetitions N]

Positions after some steps are compared with those of the program, in double and in single
precision of the elements' forces. Times are of graphs of 100 steps, medians, beginning and end of
a graph included; what else a run of the program does (checks, energies, forces on tools) is not
there.
"""

from __future__ import annotations

import argparse
import json
import statistics
from pathlib import Path
from typing import Any

import cupy
import numpy as np

THREADS = 128  # of a block, where none are given
GRAPH_STEPS = 100
OF_CONTACT = ("area", "impedance", "offset", "travel", "speed")
NUMBERS_OF_CONTACT = ("penalty", "tangential_ratio", "damping_ratio", "weight")
PADDING = 64  # zeros behind the forces, for places where nothing is sent
HERE = Path(__file__).parent


class Case:
    """A sheet in the memory of the graphics processor."""

    def __init__(self, folder: Path, real: str, threads: int) -> None:
        kind = {"double": np.float64, "float": np.float32}[real]
        self.given, self.threads = dict(np.load(folder / "arrays.npz")), threads
        options = ("-std=c++17", f"-Dreal={real}", f"-I{folder}")
        code = (HERE / "step.cu").read_text(encoding="ascii")
        module = cupy.RawModule(code=code, options=options)
        self.kernels = {
            name: module.get_function(name)
            for name in ("element_forces", "fibre_bending", "move_nodes")
        }
        g = self.given
        self.has_tools = "travel" in g
        self.element_count = int(g["element_count"])
        self.node_count, self.middle_count = g["position"].shape[1], g["share"].size
        exact = {"position", "velocity", "inverse_mass", *OF_CONTACT, "stick"}
        self.on_gpu = {}
        for name, array in g.items():
            if array.ndim:
                floats = np.float64 if name in exact else kind
                wanted = floats if array.dtype.kind == "f" else np.int32
                self.on_gpu[name] = cupy.asarray(np.ascontiguousarray(array, dtype=wanted))
        self.corner_force = cupy.zeros(g["quick_start"].size * 384 + PADDING, kind)
        self.sent = cupy.zeros(g["bending_start"].size * 192 + PADDING, kind)
        for name, (count, arguments) in self.work().items():  # loads them, before any graph
            self.launch(name, count, arguments)

    def launch(self, name: str, count: int, arguments: tuple) -> None:
        """Start a kernel with at least so many threads."""
        self.kernels[name]((-(-count // self.threads),), (self.threads,), arguments)

    def reset(self) -> None:
        """Return to the positions and velocities at the start."""
        for name in ("position", "velocity", *(["stick"] if self.has_tools else [])):
            self.on_gpu[name].set(self.given[name])
        cupy.cuda.Device().synchronize()  # graphs run on streams that wait for no other

    def work(self, step: int = 0) -> dict[str, tuple[int, tuple]]:
        """Return the number of threads and the arguments of each kernel."""
        of_contact: tuple = ()
        if self.has_tools:
            numbers = (np.float64(self.given[name]) for name in NUMBERS_OF_CONTACT)
            arrays = (self.on_gpu[name] for name in OF_CONTACT)
            of_contact = (np.int32(step), *arrays, *numbers, self.on_gpu["stick"])
        a, i = self.on_gpu, np.int32
        nodes, middles = i(self.node_count), i(self.middle_count)
        return {
            "element_forces": (
                self.element_count,
                (i(self.element_count), nodes, a["position"], a["corner_node"], a["quick_data"],
                 a["quick_start"], a["general_data"], a["general_start"], a["shared"],
                 self.corner_force),
            ),
            "fibre_bending": (
                self.middle_count,
                (middles, nodes, a["position"], a["middle_nodes"], a["bending_constants"],
                 a["bending_start"], self.sent),
            ),
            "move_nodes": (
                self.node_count,
                (nodes, i(a["slot"].shape[0]), middles, a["slot"], self.corner_force,
                 a["middle_of_node"], a["source"], self.sent, a["share"], a["inverse_mass"],
                 a["position"], a["velocity"], np.float64(self.given["dt"]),
                 np.float64(self.given["damping"]), *of_contact),
            ),
        }  # fmt: skip

    def graph(self, names: tuple[str, ...], steps: int = GRAPH_STEPS) -> cupy.cuda.Graph:
        """Return a graph of so many steps of some kernels, one after the other."""
        stream = cupy.cuda.Stream(non_blocking=True)
        with stream:
            stream.begin_capture()
            for step in range(steps):
                work = self.work(step)
                for name in names:
                    self.launch(name, *work[name])
            return stream.end_capture()


def measured(case: Case, names: tuple[str, ...], repetitions: int) -> float:
    """Return the time of a step [µs], the median of graphs of steps."""
    graph, stream = case.graph(names), cupy.cuda.Stream(non_blocking=True)
    begin, end = cupy.cuda.Event(), cupy.cuda.Event()
    times = []
    for _ in range(repetitions + 3):
        case.reset()
        begin.record(stream)
        graph.launch(stream)
        end.record(stream)
        end.synchronize()
        times.append(1e3 * cupy.cuda.get_elapsed_time(begin, end) / GRAPH_STEPS)
    return statistics.median(times[3:])


def compared(case: Case) -> float | None:
    """Return how far positions are from those of the program, over how far those moved (rms)."""
    g = case.given
    if "position_then" not in g:
        return None
    case.reset()
    stream = cupy.cuda.Stream(non_blocking=True)
    case.graph(tuple(case.kernels), int(g["steps"])).launch(stream)
    stream.synchronize()
    found = cupy.asnumpy(case.on_gpu["position"])
    moved = np.linalg.norm(g["position_then"] - g["position"])
    return float(np.linalg.norm(found - g["position_then"]) / moved)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--repetitions", type=int, default=21)
    parser.add_argument("--threads", type=int, default=THREADS, help="of a block")
    parser.add_argument("--json", type=Path)
    arguments = parser.parse_args()
    device = cupy.cuda.runtime.getDeviceProperties(0)["name"].decode()
    print(device, f"CuPy {cupy.__version__}")
    rows = []
    cases = [file.parent for file in HERE.glob("*/arrays.npz")]
    for folder in sorted(cases, key=lambda folder: (folder / "arrays.npz").stat().st_size):
        for real in ("double", "float"):
            case = Case(folder, real, arguments.threads)
            row: dict[str, Any] = {
                "case": folder.name,
                "elements": case.element_count,
                "real": real,
                "threads": case.threads,
                "device": device,
            }
            row["difference"] = compared(case)
            row["step"] = measured(case, tuple(case.kernels), arguments.repetitions)
            for name, kernel in case.kernels.items():
                row[name] = measured(case, (name,), arguments.repetitions)
                row[f"{name}_registers"] = kernel.num_regs
                row[f"{name}_local_bytes"] = kernel.local_size_bytes
            rows.append(row)
            print(json.dumps(row), flush=True)
    if arguments.json:
        arguments.json.write_text(json.dumps(rows, indent=1), encoding="utf-8")


if __name__ == "__main__":
    main()
