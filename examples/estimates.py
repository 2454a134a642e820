"""Steps and computing time that ``lcmchain check`` expects beside those that a run takes.

    python examples/estimates.py [--quick] [--threads N]

Forms the scenes of this folder, at other angles and with the 2D approach too, prints a table, and
ends with an error where the steps are off by more than 10 %. ``--quick`` takes elements of 10 mm
and leaves out the tool from an STL file. All have the time of ``with_time.py``: where the pace is
found, a run alone tells its steps.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path

from with_time import entries_with_time

from lcmchain import read_scene
from lcmchain.check import estimate_run
from lcmchain.compilation.threads import use_threads
from lcmchain.solver.simulation import Simulation

EXAMPLES = Path(__file__).parent
TRIANGLES = ["element=membrane-shell", "permeability=none"]
CASES = [
    ("hemisphere_holder", []),
    ("hemisphere_free", []),
    ("hemisphere_holder", TRIANGLES),
    ("hemisphere_free", TRIANGLES),
    ("hemisphere_free", ["blank.fibre_angle=30 deg"]),
    ("hemisphere_free", ["blank.fibre_angle=45 deg"]),
    ("hemisphere_free", ["blank.fibre_angle=30 deg", *TRIANGLES]),
    ("stl_tool", []),
]
LARGEST_DIFFERENCE = 0.1


def main() -> None:
    """Form all cases and print a row for each."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="elements of 10 mm")
    parser.add_argument("--threads", type=int)
    arguments = parser.parse_args()
    use_threads(arguments.threads)
    print("| scene | steps expected (range) | steps made | | time expected | time taken | |")
    print("|---|---|---|---|---|---|---|")
    off = []
    for name, overrides in CASES:
        if arguments.quick and name == "stl_tool":
            continue
        coarse = ["blank.edge_length=10 mm"] if arguments.quick else []
        scene = read_scene(
            EXAMPLES / name / "scene.toml", [*entries_with_time(name), *overrides, *coarse]
        )
        simulation = Simulation.from_scene(scene)
        expected = estimate_run(simulation.model)
        simulation.compile()
        start = time.perf_counter()
        simulation.advance_to(scene.process.time)
        taken, made = time.perf_counter() - start, simulation.state.step_count
        share = expected.step_count / made
        least, most = expected.range
        print(
            f"| {' '.join([name, *overrides])} | {expected.step_count:,} ({least:,} to {most:,}) | "
            f"{made:,} | {share - 1.0:+.1%} | {expected.seconds:.0f} s | {taken:.0f} s | "
            f"{expected.seconds / taken - 1.0:+.0%} |",
            flush=True,
        )
        if abs(share - 1.0) > LARGEST_DIFFERENCE:
            off.append(name)
    if off:
        raise SystemExit(f"the steps of {', '.join(off)} are off by more than 10 %")


if __name__ == "__main__":
    main()
