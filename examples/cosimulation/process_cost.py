"""What a process of its own costs a unit of another tool: seconds per communication step.

    python examples/cosimulation/process_cost.py [--steps 2000] [--runs 7]

Two presses (`press.py`, made by pythonfmu) hand their velocities to each other: in a step one value
of each is read and one is set. They share the process of the master, or one or both have one of
their own. What a press computes takes microseconds: the rest is what the master and the way to the
units take. The arrangements take turns, so that a machine that others use too is as slow for each.
"""

from __future__ import annotations

import argparse
import statistics
import tempfile
import time
from pathlib import Path

from pythonfmu import FmuBuilder

from lcmchain.coupling.cosimulation.assembly import assemble
from lcmchain.coupling.cosimulation.system_file import system_from

HERE = Path(__file__).parent
WINDOW = 1e-4  # s
#: Processes of the two units.
ARRANGEMENTS = {
    "both shared": ("shared", "shared"),
    "one of its own": ("own", "shared"),
    "both of their own": ("own", "own"),
}


def system_of(folder: Path, processes: tuple[str, str], steps: int):
    """Return the system of two presses of which each pushes the other."""
    return system_from(
        {
            "stop_time": f"{(steps + 1) * WINDOW!r} s",
            "window": f"{WINDOW!r} s",
            "scheme": {"type": "gauss-seidel"},
            "units": [
                {"name": name, "fmu": "Press.fmu", "process": process}
                for name, process in zip(("left", "right"), processes, strict=True)
            ],
            "connections": [
                {"link": "left.velocity -> right.part_force", "factor": -100.0},
                {"link": "right.velocity -> left.part_force", "factor": -100.0},
            ],
        },
        None,
        directory=folder,
    )


def run_once(folder: Path, processes: tuple[str, str], steps: int) -> tuple[float, list[float]]:
    """Return the seconds per step, and the velocities that both end with."""
    with (
        tempfile.TemporaryDirectory() as unpacked,
        assemble(
            system_of(folder, processes, steps), Path(unpacked), lambda text: None
        ) as assembly,
    ):
        assembly.coupled.advance_to(WINDOW)  # what is done once
        begin = time.perf_counter()
        assembly.coupled.advance_to((steps + 1) * WINDOW)
        seconds = (time.perf_counter() - begin) / steps
        names = ["left.velocity", "right.velocity"]
        found = assembly.coupled.get_fields(names)
        return seconds, [float(found[name][0]) for name in names]


def measure(folder: Path, steps: int, runs: int) -> dict[str, float]:
    """Return the medians [s per step] by arrangement; all must end with the same bits."""
    FmuBuilder.build_FMU(HERE / "press.py", dest=folder, needsExecutionTool="false")
    taken: dict[str, list[float]] = {name: [] for name in ARRANGEMENTS}
    ends = []
    for _ in range(runs):
        for name, processes in ARRANGEMENTS.items():
            seconds, end = run_once(folder, processes, steps)
            taken[name].append(seconds)
            ends.append(end)
    assert all(end == ends[0] for end in ends), "a process changes no bit"
    return {name: statistics.median(values) for name, values in taken.items()}


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--steps", type=int, default=2000)
    parser.add_argument("--runs", type=int, default=7)
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        found = measure(Path(folder), given.steps, given.runs)
    shared = found["both shared"]
    print(f"medians of {given.runs} runs of {given.steps} communication steps")
    for name, seconds in found.items():
        print(f"{name:18} {1e6 * seconds:8.1f} us per step {seconds / shared:8.2f} times")
    added = 0.5 * (found["both of their own"] - shared)
    print(f"a process costs {1e6 * added:.0f} us per unit and step")


if __name__ == "__main__":
    main()
